/* Fuzz target of rig.json, for libFuzzer: any bytes as the description; the images it names are not there. */
#include <string.h>

#include "ingest/rig/rig_internal.h"
#include "tests/support/fuzz_target.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    npg_rig *rig;
    const char *path = fuzz_file(&fd, "rig.json", data, size);
    const npg_rig_settings settings = {.step_share = 0.02, .margin = 1, .confine = true};
    fuzz_bound(size);
    npg_status status = npg_rig_open(&rig, path, &settings);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "status");
    npg_rig_close(&rig);
    fuzz_end();
    return 0;
}
