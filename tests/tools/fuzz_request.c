/* Fuzz target of requests to the server of neupig view --live, for libFuzzer: any bytes of a connection. */
#include <string.h>

#include "tests/support/fuzz_target.h"
#include "tools/view/http_request.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const int codes[] = {0, 200, 400, 403, 405, 414, 431, 505};
    char path[NPG_HTTP_PATH_MAX];
    bool is_known = false;
    char *text = malloc(size + 1); /* of its own, so that a byte too far is seen */
    expect(text != NULL, "memory");
    memcpy(text, data, size);
    text = realloc(text, size ? size : 1);
    int code = npg_http_read_request(path, text, size, 8080);
    for (size_t i = 0; i < sizeof codes / sizeof *codes; i++) is_known = is_known || code == codes[i];
    expect(is_known, "code");
    expect(memchr(path, 0, sizeof path) != NULL, "the path has no end");
    if (code == 200)
        expect(path[0] == '/' &&
                   strspn(path, "/abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._") ==
                       strlen(path),
               "a path that could mean something else");
    free(text);
    return 0;
}
