/* Fuzz target of the batch manifest, for libFuzzer: any bytes as the file that neupig batch is given. */
#include <string.h>

#include "tests/support/fuzz_chain.h"
#include "tests/support/fuzz_target.h"
#include "tools/batch/batch.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    npg_batch *batch = NULL;
    npg_options *options;
    const char *path = fuzz_file(&fd, "manifest.json", data, size);
    expect(npg_options_open(&options) == NPG_OK && npg_options_set(options, "output", "/nowhere") == NPG_OK,
           "options");
    const npg_batch_given given = {.options = options, .max_time_s = -1};
    npg_status status = npg_batch_open(&batch, path, &given);
    expect(status == NPG_OK || status == NPG_USAGE || status == NPG_BAD_INPUT, "status");
    for (size_t i = 0; batch && i < batch->count; i++)
        expect(batch->captures[i].name && !strchr(batch->captures[i].name, '/') &&
                   strcmp(batch->captures[i].name, "..") != 0,
               "a capture's folder leads out of the output");
    npg_batch_close(&batch);
    npg_options_close(&options);
    fuzz_end();
    return 0;
}
