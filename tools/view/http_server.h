/* Server: HTTP/1.1 on 127.0.0.1 alone, for a page that follows a run.  It answers GET, reads no file by
 * itself and writes none; what is asked for goes to one function. */
#ifndef NPG_HTTP_SERVER_H
#define NPG_HTTP_SERVER_H

#include "tools/view/view_codec.h"

typedef struct npg_http_server npg_http_server;

/* Fill body and type ("text/html; charset=utf-8"; a constant) for a path; returns the code: 200, 404, 500. */
typedef int npg_http_answer(void *user, npg_bytes *body, const char **type, const char *path);

/* port 0: one that is free.  NPG_FAILED with the cause. */
npg_status npg_http_open(npg_http_server **server, int port);
void npg_http_close(npg_http_server **server);

int npg_http_port(const npg_http_server *server);

/* Answer for so many milliseconds; a signal ends that early.  *answered: requests answered with 200. */
npg_status npg_http_serve(npg_http_server *server, int milliseconds, npg_http_answer *answer, void *user,
                          size_t *answered);

#endif
