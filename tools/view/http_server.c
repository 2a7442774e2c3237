/* Server: HTTP/1.1 on 127.0.0.1 alone. */
#include "tools/view/http_server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "tools/view/http_request.h"

enum { CONNECTIONS = 32, BACKLOG = 32 };
#define PATIENCE_S 10 /* a connection that is not done by then is closed */

typedef struct connection {
    int fd; /* -1: free */
    double begun_s;
    char head[NPG_HTTP_HEAD_MAX];
    size_t head_size;
    npg_bytes reply; /* head and body; empty while the request comes in */
    size_t sent;
} connection;

struct npg_http_server {
    int fd, port;
    connection all[CONNECTIONS];
};

/* ---- open and close ---- */

static npg_status listen_on(npg_http_server *server, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    socklen_t size = sizeof at;
    int yes = 1;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    server->fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (server->fd < 0) return npg_error_errno(NPG_FAILED, "can't open a socket");
    setsockopt(server->fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(server->fd, (struct sockaddr *)&at, sizeof at) || listen(server->fd, BACKLOG) ||
        getsockname(server->fd, (struct sockaddr *)&at, &size))
        return npg_error_errno(NPG_FAILED, "can't serve on 127.0.0.1, port %d", port);
    server->port = ntohs(at.sin_port);
    return NPG_OK;
}

npg_status npg_http_open(npg_http_server **out, int port)
{
    npg_http_server *server;
    NPG_TRY(npg_alloc(&server, NPG_FOR_RUN, sizeof *server));
    server->fd = -1;
    for (size_t i = 0; i < CONNECTIONS; i++) server->all[i].fd = -1;
    npg_status status = listen_on(server, port);
    if (status) npg_http_close(&server);
    *out = server;
    return status;
}

static void end_connection(connection *c)
{
    if (c->fd >= 0) close(c->fd);
    npg_release(&c->reply.data);
    c->fd = -1;
    c->reply = (npg_bytes){0};
    c->head_size = c->sent = 0;
}

void npg_http_close(npg_http_server **slot)
{
    npg_http_server *server = *slot;
    if (!server) return;
    for (size_t i = 0; i < CONNECTIONS; i++) end_connection(&server->all[i]);
    if (server->fd >= 0) close(server->fd);
    npg_release(slot);
}

int npg_http_port(const npg_http_server *server)
{
    return server->port;
}

/* ---- a reply ---- */

static const char *word_of(int code)
{
    switch (code) {
    case 200: return "OK";
    case 403: return "Forbidden";
    case 404: return "Not Found";
    case 405: return "Method Not Allowed";
    case 414: return "URI Too Long";
    case 431: return "Request Header Fields Too Large";
    case 500: return "Internal Server Error";
    case 505: return "HTTP Version Not Supported";
    default: return "Bad Request";
    }
}

static npg_status compose(npg_bytes *reply, int code, const char *type, const npg_bytes *body)
{
    char head[512];
    int size = snprintf(head, sizeof head,
                        "HTTP/1.1 %d %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\nConnection: close\r\n"
                        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
                        "Cross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\n%s\r\n",
                        code, word_of(code), type, body->size, code == 405 ? "Allow: GET\r\n" : "");
    NPG_TRY(npg_bytes_add(reply, head, (size_t)size));
    return npg_bytes_add(reply, body->data, body->size);
}

static npg_status reply_to(connection *c, int code, const char *path, npg_http_answer *answer, void *user,
                           size_t *answered)
{
    npg_bytes body = {0};
    const char *type = "text/plain; charset=utf-8";
    if (code == 200) code = answer(user, &body, &type, path);
    if (code != 200) {
        type = "text/plain; charset=utf-8";
        body.size = 0;
        npg_bytes_add(&body, word_of(code), strlen(word_of(code)));
    }
    *answered += code == 200;
    npg_status status = compose(&c->reply, code, type, &body);
    npg_release(&body.data);
    return status;
}

/* ---- connections ---- */

static void accept_all(npg_http_server *server)
{
    for (size_t i = 0; i < CONNECTIONS; i++) {
        connection *c = &server->all[i];
        if (c->fd >= 0) continue;
        c->fd = accept4(server->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (c->fd < 0) return;
        c->begun_s = npg_clock_s();
    }
}

static npg_status receive(connection *c, int port, npg_http_answer *answer, void *user, size_t *answered)
{
    char path[NPG_HTTP_PATH_MAX];
    ssize_t got = recv(c->fd, c->head + c->head_size, sizeof c->head - c->head_size, 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return NPG_OK;
    if (got <= 0) {
        end_connection(c);
        return NPG_OK;
    }
    c->head_size += (size_t)got;
    int code = npg_http_read_request(path, c->head, c->head_size, port);
    return code ? reply_to(c, code, path, answer, user, answered) : NPG_OK;
}

static void send_some(connection *c)
{
    ssize_t sent = send(c->fd, c->reply.data + c->sent, c->reply.size - c->sent, MSG_NOSIGNAL);
    if (sent < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (sent > 0) c->sent += (size_t)sent;
    if (sent > 0 && c->sent < c->reply.size) return;
    shutdown(c->fd, SHUT_WR);
    end_connection(c);
}

static npg_status work(npg_http_server *server, const struct pollfd *ready, npg_http_answer *answer,
                       void *user, size_t *answered)
{
    double now_s = npg_clock_s();
    for (size_t i = 0; i < CONNECTIONS; i++) {
        connection *c = &server->all[i];
        if (c->fd < 0 || ready[i].fd != c->fd) continue;
        bool is_reading = !c->reply.size;
        if (ready[i].revents && is_reading) NPG_TRY(receive(c, server->port, answer, user, answered));
        if (ready[i].revents && !is_reading) send_some(c);
        if (c->fd >= 0 && now_s - c->begun_s > PATIENCE_S) end_connection(c);
    }
    return NPG_OK;
}

npg_status npg_http_serve(npg_http_server *server, int milliseconds, npg_http_answer *answer, void *user,
                          size_t *answered)
{
    double end_s = npg_clock_s() + 1e-3 * milliseconds;
    *answered = 0;
    for (double left_s; (left_s = end_s - npg_clock_s()) > 0;) {
        struct pollfd ready[CONNECTIONS + 1];
        bool has_room = false;
        for (size_t i = 0; i < CONNECTIONS; i++) {
            const connection *c = &server->all[i];
            ready[i] = (struct pollfd){.fd = c->fd, .events = c->reply.size ? POLLOUT : POLLIN};
            has_room = has_room || c->fd < 0;
        }
        ready[CONNECTIONS] = (struct pollfd){.fd = has_room ? server->fd : -1, .events = POLLIN};
        int count = poll(ready, CONNECTIONS + 1, (int)(1e3 * left_s) + 1);
        if (count < 0 && errno == EINTR) return NPG_OK;
        if (count < 0) return npg_error_errno(NPG_FAILED, "can't wait for requests");
        NPG_TRY(work(server, ready, answer, user, answered));
        if (ready[CONNECTIONS].revents) accept_all(server);
    }
    return NPG_OK;
}
