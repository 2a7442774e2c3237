/* One request of HTTP/1: what may be asked, and what is refused. */
#include "tools/view/http_request.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

typedef struct span {
    const char *text;
    size_t size;
} span;

static bool is_word(span s, const char *word)
{
    return s.size == strlen(word) && !memcmp(s.text, word, s.size);
}

/* What stands before the next `end`, which is passed over; false where there is none. */
static bool take_until(span *rest, span *out, const char *end)
{
    const char *at = memmem(rest->text, rest->size, end, strlen(end));
    if (!at) return false;
    *out = (span){rest->text, (size_t)(at - rest->text)};
    rest->size -= out->size + strlen(end);
    rest->text = at + strlen(end);
    return true;
}

static bool is_path_char(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           (c && strchr("/-._", c));
}

static int read_path(char path[NPG_HTTP_PATH_MAX], span target)
{
    if (target.size >= NPG_HTTP_PATH_MAX) return 414;
    if (!target.size || target.text[0] != '/') return 400;
    for (size_t i = 0; i < target.size; i++)
        if (!is_path_char(target.text[i])) return 400;
    memcpy(path, target.text, target.size);
    path[target.size] = 0;
    return 200;
}

static bool is_own_host(span host, int port)
{
    static const char *const names[] = {"127.0.0.1", "localhost"};
    char own[64];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(own, sizeof own, "%s:%d", names[i], port);
        if (is_word(host, own) || (port == 80 && is_word(host, names[i]))) return true;
    }
    return false;
}

/* Whether there is one Host, and it is this server. */
static int check_fields(span fields, int port)
{
    span line;
    int hosts = 0;
    while (take_until(&fields, &line, "\r\n")) {
        span name, value = line;
        if (!line.size) break;
        if (!take_until(&value, &name, ":") || !name.size) return 400;
        if (name.size != 4 || strncasecmp(name.text, "host", 4) != 0) continue;
        while (value.size && *value.text == ' ') value = (span){value.text + 1, value.size - 1};
        while (value.size && value.text[value.size - 1] == ' ') value.size--;
        if (!is_own_host(value, port)) return 403;
        hosts++;
    }
    return hosts == 1 ? 200 : 400;
}

int npg_http_read_request(char path[NPG_HTTP_PATH_MAX], const char *text, size_t size, int port)
{
    span rest = {text, size}, line, method, target;
    path[0] = 0;
    if (!memmem(text, size, "\r\n\r\n", 4)) return size >= NPG_HTTP_HEAD_MAX ? 431 : 0;
    if (memchr(text, 0, size)) return 400;
    if (!take_until(&rest, &line, "\r\n") || !take_until(&line, &method, " ") ||
        !take_until(&line, &target, " "))
        return 400;
    if (!is_word(line, "HTTP/1.1") && !is_word(line, "HTTP/1.0")) return 505;
    if (!is_word(method, "GET")) return 405;
    int code = read_path(path, target);
    return code == 200 ? check_fields(rest, port) : code;
}
