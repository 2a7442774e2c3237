/* Fuzz target of the configuration file, for libFuzzer: any bytes as a file, over the run's own options and a
 * stage that has one of every type. */
#include <string.h>

#include "tests/support/fuzz_chain.h"
#include "tests/support/fuzz_target.h"

/* What was accepted can be asked for, and is still acceptable. */
static void ask_all(const npg_options *loaded)
{
    const npg_option *option;
    for (size_t i = 0; (option = npg_option_at(i, NULL)); i++) {
        const char *text = npg_options_get(loaded, option->name);
        expect(text && npg_option_check(option, text) == NPG_OK, option->name);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    npg_options *loaded;
    const char *path = fuzz_file(&fd, "config.json", data, size);
    expect(npg_options_open(&loaded) == NPG_OK, "options");
    fuzz_bound(size);
    npg_status status = npg_options_load(loaded, path);
    expect(status == NPG_OK || status == NPG_USAGE, "status");
    expect(status == NPG_OK || strstr(npg_error_text(), path), "the message does not name the file");
    ask_all(loaded);
    npg_options_close(&loaded);
    fuzz_end();
    return 0;
}
