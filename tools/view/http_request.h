/* One request of HTTP/1: what may be asked, and what is refused. */
#ifndef NPG_HTTP_REQUEST_H
#define NPG_HTTP_REQUEST_H

#include <stddef.h>

enum { NPG_HTTP_HEAD_MAX = 8192, NPG_HTTP_PATH_MAX = 128 };

/* Reads the head of a request (size bytes, so far).  0: not whole yet.  200: a GET of `path` (letters,
 * digits, "/", "-", "." and "_" alone, no query) from a page of this very server: its Host is 127.0.0.1 or
 * localhost, with this port, so that a name that somebody else points here (DNS rebinding) is refused.  Else
 * the code to answer with: 400 malformed, 403 another host, 405 not GET, 414 path too long, 431 head too
 * long, 505 another protocol. */
int npg_http_read_request(char path[NPG_HTTP_PATH_MAX], const char *text, size_t size, int port);

#endif
