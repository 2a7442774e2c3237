/* neupig render: meshes and clouds to a PNG, without a display. */
#include <stddef.h>
#include <string.h>

#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "tools/cli.h"
#include "tools/view/view.h"

typedef struct settings {
    const char *output;
    int colour, up, view;
    int64_t height, width, columns, count, samples;
    double azimuth, elevation, point_size;
} settings;

enum { UP_AUTO = NPG_UP_MINUS_Z + 1 }; /* the last word of --up */

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_render_options[] = {
    /* type        name          place           default  least  most  shown as or words */
    NPG_ROW_TEXT  ("output",     AT(output),     "",      "FILE.png",
        "The picture (also -o)"),
    NPG_ROW_INT   ("height",     AT(height),     "512",   8,     8192, "PIXELS",
        "Height of a tile, pixels"),
    NPG_ROW_INT   ("width",      AT(width),      "0",     0,     8192, "PIXELS",
        "Width of a tile, pixels; 0: as what is drawn needs"),
    NPG_ROW_INT   ("columns",    AT(columns),    "0",     0,     256,  NULL,
        "Tiles in a row; 0: up to 8"),
    NPG_ROW_INT   ("count",      AT(count),      "0",     0,     4096, NULL,
        "Draw this many of the files, spread evenly; 0: all"),
    NPG_ROW_CHOICE("view",       AT(view),       "free",  "free|front|back|left|right|top|bottom",
        "Where to look from; free: --azimuth and --elevation"),
    NPG_ROW_REAL  ("azimuth",    AT(azimuth),    "25",    -3600, 3600, "DEGREES",
        "Degrees around the upward axis; 0: from the front (+z, -y with z up; where up is minus, from the other side, "
        "where cameras stand)"),
    NPG_ROW_REAL  ("elevation",  AT(elevation),  "12",    -90,   90,   "DEGREES",
        "Degrees above the horizon"),
    NPG_ROW_CHOICE("up",         AT(up),         "auto",  "y|z|-y|-z|auto",
        "The upward axis; auto: of a rig, and what a run made of it, as its sensors stand, else y"),
    NPG_ROW_CHOICE("colour",     AT(colour),     "auto",  "plain|vertex|normal|identity|auto",
        "auto: clouds in their own colours, meshes plain; vertex: colours in the file; normal; "
        "identity: by place in the first file, to see vertices keep their place on the body"),
    NPG_ROW_REAL  ("point-size", AT(point_size), "0.35",  0.01,  20,   "PERCENT",
        "Radius of a cloud's points, in % of the diagonal"),
    NPG_ROW_INT   ("samples",    AT(samples),    "2",     1,     8,    NULL,
        "Rays per pixel and axis"),
    {0}};
/* clang-format on */

static void thin_out(npg_listing *files, size_t count)
{
    size_t all = files->count;
    if (!count || count >= all) return;
    for (size_t i = 0; i < count; i++)
        files->paths[i] = files->paths[count == 1 ? all / 2 : i * (all - 1) / (count - 1)];
    files->count = count;
}

static npg_status list_files(npg_listing *files, const settings *s, const npg_cli *cli)
{
    if (!s->output[0]) return npg_error(NPG_USAGE, "no picture to write; say where with -o FILE.png");
    for (int i = 0; i < cli->operand_count; i++)
        NPG_TRY(npg_listing_add(files, cli->operands[i], NPG_CLOUDS));
    thin_out(files, (size_t)s->count);
    return NPG_OK;
}

/* To the folder that a path lies in. */
static void go_up(char path[NPG_PATH_SIZE])
{
    char *slash = strrchr(path, '/');
    if (slash)
        *slash = 0;
    else
        snprintf(path, NPG_PATH_SIZE, strcmp(path, ".") ? "." : "..");
}

/* Of the run whose result the file is (OUT/reference.ply, OUT/meshes/...). */
static npg_status up_of_run(npg_up *up, const char *file)
{
    char folder[NPG_PATH_SIZE], path[NPG_PATH_SIZE];
    json_t *report = NULL;
    snprintf(folder, sizeof folder, "%s", file);
    for (int levels = 0; levels < 2 && !report; levels++) {
        go_up(folder);
        NPG_TRY(npg_path_of(path, folder, "report.json"));
        report = json_load_file(path, 0, NULL);
    }
    *up = npg_view_up(report);
    json_decref(report);
    return NPG_OK;
}

/* As the sensors of a rig stand, and so in what a run has made of it; else y. */
static npg_status find_up(npg_up *up, const settings *s, const npg_listing *files)
{
    *up = s->up == UP_AUTO ? NPG_UP_Y : (npg_up)s->up;
    if (s->up != UP_AUTO || !files->count) return NPG_OK;
    if (npg_rig_is_frame(files->paths[0])) return npg_rig_up_of(up, files->paths[0]);
    return up_of_run(up, files->paths[0]);
}

static npg_status draw(const npg_listing *files, npg_up up, const settings *s)
{
    /* as the words of --view */
    static const double angles[][2] = {{0, 0}, {0, 0}, {180, 0}, {-90, 0}, {90, 0}, {0, 90}, {0, -90}};
    const npg_picture_settings all = {.struct_size = sizeof all,
                                      .width = s->width,
                                      .height = s->height,
                                      .columns = s->columns,
                                      .samples = s->samples,
                                      .azimuth = s->view ? angles[s->view][0] : s->azimuth,
                                      .elevation = s->view ? angles[s->view][1] : s->elevation,
                                      .up = up,
                                      .colour = (npg_picture_colour)s->colour,
                                      .point_size = 0.01 * s->point_size};
    npg_picture picture = {.struct_size = sizeof picture};
    NPG_TRY(npg_picture_write(&picture, s->output, (const char *const *)files->paths, files->count, &all));
    if (picture.points_drawn < picture.points_total)
        fprintf(stderr, "neupig render: drew %zu of %zu points\n", picture.points_drawn,
                picture.points_total);
    printf("%s: %lld x %lld\n", s->output, (long long)picture.width, (long long)picture.height);
    return NPG_OK;
}

npg_status npg_verb_render(const npg_cli *cli)
{
    npg_listing files = {.arena = &(npg_arena){.purpose = NPG_FOR_FILES}};
    npg_up up;
    npg_status status = list_files(&files, cli->values, cli);
    if (!status) status = find_up(&up, cli->values, &files);
    if (!status) status = draw(&files, up, cli->values);
    npg_arena_release(files.arena);
    return status;
}
