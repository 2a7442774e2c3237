/* neupig render: meshes and clouds to a PNG, without a display. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "tools/cli.h"
#include "tools/listing.h"
#include "tools/render/render_image.h"

typedef struct settings {
    const char *output;
    int colour, up, view;
    int64_t height, width, columns, count, samples;
    double azimuth, elevation, point_size;
} settings;

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
        "Degrees around the upward axis; 0: from the front (+z, or -y with z up)"),
    NPG_ROW_REAL  ("elevation",  AT(elevation),  "12",    -90,   90,   "DEGREES",
        "Degrees above the horizon"),
    NPG_ROW_CHOICE("up",         AT(up),         "y",     "y|z",
        "The upward axis"),
    NPG_ROW_CHOICE("colour",     AT(colour),     "plain", "plain|vertex|normal|identity",
        "plain; vertex: colours in the file; normal; "
        "identity: by place in the first file, to see vertices keep their place on the body"),
    NPG_ROW_REAL  ("point-size", AT(point_size), "0.35",  0.01,  20,   "PERCENT",
        "Radius of a cloud's points, in % of the diagonal"),
    NPG_ROW_INT   ("samples",    AT(samples),    "2",     1,     8,    NULL,
        "Rays per pixel and axis"),
    {0}};
/* clang-format on */

#define PIXELS_MAX ((int64_t)1 << 28) /* 768 MiB of colours */

typedef struct job {
    settings s;
    npg_listing files;
    npg_origin origin;
    npg_bounds reach; /* along the eye's axes */
    npg_eye eye;
    npg_image image;
    npg_mesh *first; /* the first file's mesh, for identity colours */
    int64_t columns, tile_width;
} job;

static void turn_eye(npg_eye *eye, const settings *s)
{
    static const double angles[][2] = {{0, 0}, {0, 0}, {180, 0}, {-90, 0}, {90, 0}, {0, 90}, {0, -90}};
    if (s->view)
        npg_eye_turn(eye, angles[s->view][0], angles[s->view][1], s->up + 1);
    else
        npg_eye_turn(eye, s->azimuth, s->elevation, s->up + 1);
}

static void thin_out(npg_listing *files, size_t count)
{
    size_t all = files->count;
    if (!count || count >= all) return;
    for (size_t i = 0, next = 0; i < all; i++) {
        size_t wanted = count == 1 ? all / 2 : next * (all - 1) / (count - 1);
        if (next < count && i == wanted)
            files->paths[next++] = files->paths[i];
        else
            npg_release(&files->paths[i]);
    }
    files->count = count;
}

static npg_status list_files(job *j, const npg_cli *cli)
{
    static const char endings[] = ".ply .obj .xyz .xyzn .txt .pts .npy .pcd";
    if (!j->s.output[0]) return npg_error(NPG_USAGE, "no picture to write; say where with -o FILE.png");
    for (int i = 0; i < cli->operand_count; i++)
        NPG_TRY(npg_listing_add(&j->files, cli->operands[i], endings));
    thin_out(&j->files, (size_t)j->s.count);
    for (size_t i = 0; i < j->files.count; i++)
        NPG_TRY(npg_scene_measure(&j->reach, j->files.paths[i], &j->origin, j->eye.axes));
    if (!(j->reach.lo[0] <= j->reach.hi[0]))
        return npg_error(NPG_BAD_INPUT, "%s: nothing to draw", j->files.paths[0]);
    return NPG_OK;
}

static npg_status lay_out(job *j)
{
    const int64_t count = (int64_t)j->files.count;
    double aspect = j->s.width ? (double)j->s.width / (double)j->s.height : 0;
    npg_eye_fit(&j->eye, &aspect, &j->reach);
    j->tile_width = j->s.width ? j->s.width : (int64_t)lrint((double)j->s.height * aspect);
    j->columns = j->s.columns ? j->s.columns : 8;
    if (j->columns > count) j->columns = count;
    int64_t rows = (count + j->columns - 1) / j->columns, width = j->columns * j->tile_width;
    if (width * rows * j->s.height > PIXELS_MAX)
        return npg_error(NPG_USAGE,
                         "the picture would have %lld x %lld pixels; choose a smaller --height or --count",
                         (long long)width, (long long)(rows * j->s.height));
    return npg_image_open(&j->image, width, rows * j->s.height);
}

static npg_status draw_tile(job *j, size_t i)
{
    npg_scene scene;
    int64_t column = (int64_t)i % j->columns, row = (int64_t)i / j->columns;
    double radius = 0.01 * j->s.point_size * npg_bounds_diagonal(&j->reach);
    NPG_TRY(npg_scene_open(&scene, j->files.paths[i], &j->origin, radius, j->s.colour, j->first));
    if (!j->first && !scene.ball_middle) j->first = npg_mesh_ref(scene.mesh);
    if (scene.shown < scene.total)
        fprintf(stderr, "neupig render: %s: drawing %zu of %zu points\n", j->files.paths[i], scene.shown,
                scene.total);
    npg_status status = npg_image_draw(&j->image, &scene, &j->eye, column * j->tile_width, row * j->s.height,
                                       j->tile_width, j->s.height, j->s.samples);
    npg_scene_close(&scene);
    return npg_error_prefix(status, "%s", j->files.paths[i]);
}

int npg_verb_render(int argc, char **argv)
{
    job j = {.reach = npg_bounds_empty()};
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &j.s, NULL, argc, argv);
    if (!status) turn_eye(&j.eye, &j.s);
    if (!status) status = list_files(&j, &cli);
    if (!status) status = lay_out(&j);
    for (size_t i = 0; i < j.files.count && !status; i++) status = draw_tile(&j, i);
    if (!status) status = npg_image_write(&j.image, j.s.output);
    if (!status) printf("%s: %lld x %lld\n", j.s.output, (long long)j.image.width, (long long)j.image.height);
    npg_image_close(&j.image);
    npg_mesh_unref(&j.first);
    npg_listing_close(&j.files);
    return npg_cli_end(argv[0], status);
}
