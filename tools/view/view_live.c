/* Live: a page that follows a run which is at work. */
#include "tools/view/view_live.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/clock.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "tools/view/http_server.h"
#include "tools/view/run_watch.h"

#define LINGER_S     3   /* after the end, since the last request */
#define LINGER_MAX_S 120 /* after the end, in all                 */

typedef struct live {
    const char *path; /* loan */
    size_t point_limit;
    npg_view_template page;
    npg_view_result result;
    npg_view_frames *frames; /* one for each part that has a reference, owned */
    npg_run_watch watch;
    char problem[512]; /* why the last look at the folder failed; "": it did not */
} live;

static void close_frames(live *l)
{
    for (size_t i = 0; l->frames && i < l->result.part_count; i++) npg_view_frames_close(&l->frames[i]);
    npg_release(&l->frames);
}

static npg_status open_frames(live *l)
{
    NPG_TRY(npg_alloc_array(&l->frames, NPG_FOR_FILES, l->result.part_count, sizeof *l->frames));
    for (size_t i = 0; i < l->result.part_count; i++)
        if (l->result.parts[i].reference)
            NPG_TRY(npg_view_frames_open(&l->frames[i], &l->result.parts[i], l->point_limit));
    return NPG_OK;
}

/* Look at the folder again where something in it has changed.  What can't be read just now (a run begins
 * anew) is said, and what was known before stays. */
static npg_status refresh(live *l)
{
    npg_view_result now;
    if (!npg_run_watch_look(&l->watch, l->path)) return NPG_OK;
    npg_status status = npg_view_result_open(&now, l->path, 1, true);
    if (status == NPG_MEMORY) return status;
    snprintf(l->problem, sizeof l->problem, "%s", status ? npg_error_text() : "");
    if (status) {
        npg_run_watch_again(&l->watch);
        return NPG_OK;
    }
    close_frames(l);
    npg_view_result_close(&l->result);
    l->result = now;
    return open_frames(l);
}

/* ---- answers ---- */

static int give_text(npg_bytes *body, char *text)
{
    int code = text && !npg_bytes_add(body, text, strlen(text)) ? 200 : 500;
    free(text);
    return code;
}

static int give_page(const live *l, npg_bytes *body)
{
    static const char facts[] =
        "<script type=\"application/json\" id=\"facts\">{\"format\":1,\"live\":true}</script>\n";
    const npg_view_template *page = &l->page;
    if (npg_bytes_add(body, page->text, page->data) || npg_bytes_add(body, facts, sizeof facts - 1) ||
        npg_bytes_add(body, page->text + page->data, page->size - page->data))
        return 500;
    return 200;
}

static int give_state(live *l, npg_bytes *body)
{
    if (refresh(l)) return 500;
    json_t *results = json_array();
    if (l->result.part_count) json_array_append_new(results, npg_view_result_json(&l->result));
    json_t *parts = json_object_get(json_array_get(results, 0), "parts"), *part;
    size_t i;
    json_array_foreach(parts, i, part)
    {
        json_object_set_new(part, "id",
                            json_integer((json_int_t)npg_run_watch_reference(&l->result.parts[i])));
    }
    json_t *state = npg_view_page_json(true, results);
    if (state) {
        json_object_set_new(state, "phase", json_string(npg_run_phase_word(l->watch.phase)));
        json_object_set_new(state, "problem", npg_json_text(l->problem));
    }
    int code = give_text(body, npg_view_json_text(state));
    json_decref(state);
    return code;
}

/* The part with a reference that a path names, NULL: none; *rest is what follows its number. */
static npg_view_frames *part_of(live *l, const char *path, const char *prefix, const char **rest)
{
    size_t length = strlen(prefix), digits;
    if (strncmp(path, prefix, length) != 0) return NULL;
    digits = strspn(path + length, "0123456789");
    *rest = path + length + digits;
    if (!digits || digits > 6) return NULL;
    size_t place = (size_t)strtoul(path + length, NULL, 10);
    return l->frames && place < l->result.part_count && l->frames[place].part ? &l->frames[place] : NULL;
}

static int give_part(live *l, npg_bytes *body, const char *path)
{
    const char *rest;
    npg_view_frames *frames = part_of(l, path, "/part-", &rest);
    if (!frames || *rest) return 404;
    return npg_view_part_block(body, frames, false) ? 500 : 200;
}

static int give_frame(live *l, npg_bytes *body, const char *path)
{
    const char *rest;
    npg_view_frames *frames = part_of(l, path, "/frame-", &rest);
    if (!frames || *rest != '-') return 404;
    size_t digits = strspn(rest + 1, "0123456789");
    if (!digits || digits > 12 || rest[1 + digits]) return 404;
    int64_t index = strtoll(rest + 1, NULL, 10);
    for (size_t i = 0; i < frames->part->count; i++)
        if (frames->part->frames[i].index == index)
            return npg_view_group_block(body, frames, i, 1) ? 500 : 200;
    return 404;
}

static int answer(void *user, npg_bytes *body, const char **type, const char *path)
{
    live *l = user;
    if (!strcmp(path, "/")) {
        *type = "text/html; charset=utf-8";
        return give_page(l, body);
    }
    if (!strcmp(path, "/state")) {
        *type = "application/json";
        return give_state(l, body);
    }
    *type = "application/octet-stream";
    return !strncmp(path, "/part-", 6) ? give_part(l, body, path) : give_frame(l, body, path);
}

/* ---- until the end ---- */

static volatile sig_atomic_t is_asked_to_end;

static void ask_to_end(int number)
{
    (void)number;
    is_asked_to_end = 1;
}

static void catch_signals(void)
{
    struct sigaction action = {.sa_handler = ask_to_end};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

static npg_status serve(live *l, npg_http_server *server)
{
    double ended_s = 0, asked_s = npg_clock_s();
    while (!is_asked_to_end) {
        size_t answered;
        NPG_TRY(npg_http_serve(server, 500, answer, l, &answered));
        NPG_TRY(refresh(l));
        double now_s = npg_clock_s();
        if (answered) asked_s = now_s;
        if (!npg_run_phase_is_end(l->watch.phase)) {
            ended_s = 0;
            continue;
        }
        if (ended_s <= 0) ended_s = now_s;
        bool is_idle = now_s - asked_s > LINGER_S && now_s - ended_s > LINGER_S;
        if (is_idle || now_s - ended_s > LINGER_MAX_S) break;
    }
    return NPG_OK;
}

static npg_status begin(live *l, npg_http_server **server, int port)
{
    NPG_TRY(npg_view_template_open(&l->page));
    NPG_TRY(npg_view_result_open(&l->result, l->path, 1, true)); /* a folder of no run is refused here */
    NPG_TRY(open_frames(l));
    NPG_TRY(npg_http_open(server, port));
    catch_signals();
    printf("http://127.0.0.1:%d/\n", npg_http_port(*server));
    fflush(stdout);
    return NPG_OK;
}

npg_status npg_view_live(const char *path, size_t point_limit, int port)
{
    live l = {.path = path, .point_limit = point_limit};
    npg_http_server *server = NULL;
    npg_status status = begin(&l, &server, port);
    if (!status) status = serve(&l, server);
    if (!status && !is_asked_to_end)
        printf("the run is %s; the page to keep is made without --live\n", npg_run_phase_word(l.watch.phase));
    npg_http_close(&server);
    close_frames(&l);
    npg_view_result_close(&l.result);
    npg_view_template_close(&l.page);
    return status;
}
