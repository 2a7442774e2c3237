/* Page: one HTML file that needs no other, of one result or of two side by side. */
#include "tools/view/view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/child.h"
#include "pipeline/clock.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"

/* ---- the page without data ---- */

/* As the build has bundled it: build/view/page.html, or share/neupig/view/page.html of what is installed. */
typedef struct template
{
    npg_arena arena; /* of the text */
    char *text;
    size_t size; /* in bytes */
    size_t data; /* where data go in */
}
template;

#define NAME      "view/page.html"
#define MARK      "<!--neupig-data-->"
#define SIZE_MOST ((size_t)64 << 20)

/* NPG_FAILED where it was not built, with what to install. */
static npg_status open_template(template *page)
{
    char path[4096];
    *page = (template){.arena = {.purpose = NPG_FOR_FILES}};
    if (!npg_find_installed(path, "share/neupig/", NAME))
        snprintf(path, sizeof path, "%s/%s", NPG_DATA_DIR, NAME);
    if (access(path, R_OK))
        return npg_error(NPG_FAILED,
                         "the page's script was not built: it needs Node and npm. Install them "
                         "(Debian: nodejs and npm), configure with -DNPG_VIEW=ON and build again");
    NPG_TRY(npg_file_whole(&page->arena, &page->text, &page->size, path, SIZE_MOST, "page"));
    const char *mark = strstr(page->text, MARK);
    if (!mark) {
        npg_arena_release(&page->arena);
        return npg_error(NPG_FAILED, "%s is not the page that belongs to this program", path);
    }
    page->data = (size_t)(mark - page->text);
    return NPG_OK;
}

/* ---- data ---- */

/* JSON as text for inside of a script element: ASCII, without "<", "&" and ">". */
static npg_status write_json(npg_file *file, json_t *results, bool is_live)
{
    json_t *page =
        json_pack("{si ss sb so}", "format", 1, "neupig", npg_version(), "live", is_live, "results", results);
    char *text = page ? json_dumps(page, JSON_COMPACT | JSON_ENSURE_ASCII | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(page);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the page");
    npg_file_print(file, "<script type=\"application/json\" id=\"facts\">");
    for (const char *c = text; *c;) {
        size_t plain = strcspn(c, "<>&");
        npg_file_write(file, c, plain);
        c += plain;
        if (*c) npg_file_print(file, "\\u%04x", (unsigned)*c++);
    }
    npg_file_print(file, "</script>\n");
    free(text);
    return NPG_OK;
}

static void write_base64(npg_file *file, const uint8_t *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        size_t left = size - i;
        uint32_t three = (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) |
                         (left > 2 ? bytes[i + 2] : 0);
        const char four[4] = {digits[three >> 18], digits[three >> 12 & 63],
                              left > 1 ? digits[three >> 6 & 63] : '=', left > 2 ? digits[three & 63] : '='};
        npg_file_write(file, four, sizeof four);
    }
}

/* share: of the page's frames, about, that are there with this block; what the page says while it loads. */
static void write_block(npg_file *file, npg_bytes *block, const char *id, double share)
{
    npg_file_print(file, "<script type=\"text/plain\" id=\"%s\" data-share=\"%.3f\">", id, share);
    write_base64(file, block->data, block->size);
    npg_file_print(file, "</script>\n");
    block->size = 0;
}

/* A part's name in the page, and how much of the page is there before and with it. */
typedef struct part_place {
    char id[48];
    double before, with;
} part_place;

static npg_status write_groups(npg_file *file, npg_view_frames *frames, const part_place *place)
{
    const npg_view_part *part = frames->part;
    npg_bytes block = {0};
    npg_status status = NPG_OK;
    char id[80];
    for (size_t first = 0; first < part->count && !status; first += part->group) {
        size_t left = part->count - first;
        status = npg_view_group_block(&block, frames, first, left < part->group ? left : part->group);
        snprintf(id, sizeof id, "%s-%zu", place->id, first / part->group);
        double share = fmin(1, (double)(first + part->group) / (double)part->count);
        if (!status) write_block(file, &block, id, place->before + share * (place->with - place->before));
    }
    if (!status) status = npg_view_part_block(&block, frames);
    if (!status) write_block(file, &block, place->id, place->with);
    npg_release(&block.data);
    return status;
}

static npg_status write_part(npg_file *file, npg_view_facts *facts, json_t *json, const npg_view_part *part,
                             const part_place *place, size_t point_limit)
{
    npg_view_frames frames;
    NPG_TRY(npg_view_frames_open(&frames, part, point_limit));
    npg_status status = write_groups(file, &frames, place);
    if (frames.without_points && !facts->without_points) memcpy(facts->why, frames.why, sizeof facts->why);
    facts->without_points += frames.without_points;
    facts->frames += part->count;
    if (part->reference->vert_count > facts->vertices) facts->vertices = part->reference->vert_count;
    json_object_set_new(json, "with_points", json_integer((json_int_t)frames.with_points));
    if (frames.noise_count)
        json_object_set_new(json, "noise",
                            json_real(frames.noise_sum / (double)frames.noise_count / part->diagonal));
    if (frames.without_points) json_object_set_new(json, "no_points", npg_json_text(frames.why));
    npg_arena_release(&frames.arena);
    return status;
}

static npg_status write_result(npg_file *file, npg_view_facts *facts, json_t *results, size_t place,
                               const npg_view_order *order)
{
    npg_view_result result;
    NPG_TRY(npg_view_result_open(&result, order->paths[place], order->every, order->is_live));
    json_t *json = npg_view_result_json(&result), *parts = json_object_get(json, "parts");
    npg_status status = json ? NPG_OK : npg_error(NPG_MEMORY, "no memory for the page");
    if (!status && order->every > 1)
        json_object_set_new(json, "every", json_integer((json_int_t)order->every));
    for (size_t i = 0; i < result.part_count && !status; i++) {
        double all = (double)(order->path_count * result.part_count);
        double before = (double)(place * result.part_count + i) / all;
        part_place at = {.before = before, .with = before + 1 / all};
        if (!result.parts[i].reference) continue; /* not there yet */
        snprintf(at.id, sizeof at.id, "data-%zu-%zu", place, i);
        status = write_part(file, facts, json_array_get(parts, i), &result.parts[i], &at, order->point_limit);
    }
    if (!status)
        json_array_append_new(results, json);
    else
        json_decref(json);
    npg_view_result_close(&result);
    return status;
}

static npg_status write_page(npg_file *file, npg_view_facts *facts, const template *page,
                             const npg_view_order *order)
{
    json_t *results = json_array();
    npg_status status = npg_file_write(file, page->text, page->data);
    for (size_t i = 0; i < order->path_count && !status; i++)
        status = write_result(file, facts, results, i, order);
    if (status)
        json_decref(results);
    else
        status = write_json(file, results, order->is_live);
    if (!status) status = npg_file_write(file, page->text + page->data, page->size - page->data);
    facts->bytes = npg_file_size(file);
    return status;
}

npg_status npg_view_page_write(npg_view_facts *facts, const npg_view_order *order)
{
    template page;
    npg_file *file = NULL;
    *facts = (npg_view_facts){0};
    NPG_TRY(open_template(&page));
    npg_status status = npg_file_open(&file, order->output);
    if (!status) status = write_page(file, facts, &page, order);
    npg_arena_release(&page.arena);
    return npg_file_end(&file, status);
}

/* ---- of a run that is at work ---- */

#define LOOK_S     2  /* between two looks at the folder; a run that begins is not taken for one that ended */
#define PAUSE_MOST 10 /* a page that takes long to make is made more rarely: a tenth of a processor at most */

/* Whether any process has a lock on this file of the folder.  Asked of the system's list: to try the lock
 * oneself could keep a run from it.  Where there is no list it counts as held. */
static bool is_locked(const char *folder, const char *name)
{
    char path[4096], line[256];
    struct stat info;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (stat(path, &info)) return false;
    FILE *list = fopen("/proc/locks", "re");
    bool found = !list;
    while (list && !found && fgets(line, sizeof line, list)) {
        unsigned long long there;
        found = sscanf(line, "%*d: %*s %*s %*s %*d %*x:%*x:%llu", &there) == 1 &&
                there == (unsigned long long)info.st_ino;
    }
    if (list) fclose(list);
    return found;
}

static bool is_at_work(const char *path)
{
    return is_locked(path, "job/lock") || is_locked(path, ".segments.lock");
}

/* How many frames there are; -1: the lists can't be read just now (a run begins anew). */
static int64_t count_frames(const char *path)
{
    npg_view_result result;
    int64_t count = 0;
    if (npg_view_result_open(&result, path, 1, true)) return -1;
    for (size_t i = 0; i < result.part_count; i++) count += (int64_t)result.parts[i].count;
    npg_view_result_close(&result);
    return count;
}

npg_status npg_view_follow(npg_view_facts *facts, const npg_view_order *order)
{
    npg_view_order now = *order;
    int64_t shown = -2;
    double due_s = 0;
    now.is_live = true;
    for (bool was_at_work = true;; sleep(LOOK_S)) {
        bool is_now = is_at_work(order->paths[0]);
        if (!is_now && !was_at_work) return npg_view_page_write(facts, order);
        was_at_work = is_now;
        int64_t count = count_frames(order->paths[0]);
        double begin_s = npg_clock_s();
        if (count == shown || count < 0 || begin_s < due_s) continue;
        NPG_TRY(npg_view_page_write(facts, &now));
        if (shown == -2) {
            printf("%s\n", order->output);
            fflush(stdout);
        }
        shown = count;
        due_s = npg_clock_s() + PAUSE_MOST * (npg_clock_s() - begin_s);
    }
}
