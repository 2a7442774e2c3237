/* Fuzz target of the PNG and JPEG decoders, for libFuzzer: headers and all that follows.  The first byte says
 * what kind of image is expected. */
#include "ingest/rig/rig_internal.h"
#include "tests/support/fuzz_target.h"

/* Sizes are checked before memory is taken: what is larger than this is never decoded here. */
enum { SIDE = 24 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    npg_image image;
    if (!size) return 0;
    const char *path = fuzz_file(&fd, "image", data + 1, size - 1);
    fuzz_bound(size);
    npg_status status = npg_image_read(&image, path, (npg_image_kind)(data[0] % 3), SIDE, SIDE);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "image");
    expect(status == NPG_OK || (!image.depth && !image.bytes), "left-overs");
    npg_image_clear(&image);
    fuzz_end();
    return 0;
}
