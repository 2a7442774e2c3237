/* neupig synth: moving bodies as captures, with their exact ground truth. */
#include <stddef.h>

#include "export/export.h"
#include "geometry/geometry.h"
#include "pipeline/file.h"
#include "pipeline/frame_box.h"
#include "tools/cli.h"
#include "tools/synth/synth.h"

typedef struct settings {
    const char *output;
    int format;
    int64_t frames;
    npg_scan scan; /* without what the first frame gives */
    double cell, cycles, travel, depth_noise_mm;
    bool normals, rig;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_synth_options[] = {
    /* type        name        place         default   least  most          shown as or words */
    NPG_ROW_TEXT  ("output",   AT(output),   "",       "DIR",
        "Folder for points/ and truth/ (also -o)"),
    NPG_ROW_INT   ("frames",   AT(frames),   "24",     1,     1e6,          NULL,
        "Frames"),
    NPG_ROW_INT   ("points",   AT(scan.point_count), "5000",   1,     1e8,          NULL,
        "Points per frame"),
    NPG_ROW_REAL  ("cycles",   AT(cycles),   "1",      0,     1e4,          NULL,
        "Cycles of the motion over all frames"),
    NPG_ROW_REAL  ("travel",   AT(travel),   "0",      -100,  100,          NULL,
        "Metres the walker goes forward per cycle"),
    NPG_ROW_REAL  ("cell",     AT(cell),     "0.025",  0.004, 0.06,         "M",
        "Size of the truth mesh's triangles, metres"),
    NPG_ROW_REAL  ("noise",    AT(scan.noise), "0",      0,     10,           "PERCENT",
        "Gaussian noise, deviation in % of the diagonal; along the rays with cameras"),
    NPG_ROW_REAL  ("outliers", AT(scan.outliers), "0",      0,     90,           "PERCENT",
        "Share of points replaced by points anywhere in the box, in %"),
    NPG_ROW_INT   ("holes",    AT(scan.holes), "0",      0,     1000,         NULL,
        "Balls of 6 % of the diagonal cut out of every frame"),
    NPG_ROW_FLAG  ("vary",     AT(scan.vary), "no",
        "Let the point count vary between half and all of --points"),
    NPG_ROW_FLAG  ("normals",  AT(normals),  "yes",
        "Write normals"),
    NPG_ROW_INT   ("cameras",  AT(scan.cameras), "0",      0,     64,           NULL,
        "See the body through a ring of this many depth cameras; 0: its whole surface"),
    NPG_ROW_INT   ("width",    AT(scan.width), "256",    16,    4096,         "PIXELS",
        "Width and height of a camera's picture, pixels"),
    NPG_ROW_INT   ("height",   AT(scan.height), "0",      0,     4096,         "PIXELS",
        "Its height, pixels; 0: as its width"),
    NPG_ROW_FLAG  ("rig",      AT(rig),      "no",
        "Write what the cameras see as a rig, DIR/rig with rig.json, depth and colour images of a textured "
        "body, instead of points; the truth has the colours"),
    NPG_ROW_REAL  ("depth-noise", AT(depth_noise_mm), "0", 0, 1000,         "MM",
        "Gaussian noise of a rig's depths, deviation in millimetres"),
    NPG_ROW_CHOICE("format",   AT(format),   "ply",    "ply|obj",
        "Of the files"),
    NPG_ROW_INT   ("seed",     AT(scan.seed), "0",      0,     4294967295.0, NULL,
        "Seed of all random numbers"),
    {0}};
/* clang-format on */

static npg_status write_arrays(const char *folder, const char *kind, int64_t frame, const settings *s,
                               const float *pos, const float *normals, size_t count, const npg_mesh *mesh)
{
    char path[4096];
    double *world;
    NPG_TRY(npg_alloc_array(&world, NPG_FOR_FILES, count, 3 * sizeof *world));
    for (size_t i = 0; i < 3 * count; i++) world[i] = (double)pos[i];
    npg_mesh_view view = {.vert_count = count, .vert_world = world, .vert_normals = normals};
    if (mesh) {
        view.faces = mesh->faces;
        view.vert_colours = mesh->vert_colours;
        view.face_count = mesh->face_count;
    }
    snprintf(path, sizeof path, "%s/%s/frame_%04lld.%s", folder, kind, (long long)frame,
             s->format ? "obj" : "ply");
    npg_status status = npg_write_mesh(path, &view);
    npg_release(&world);
    return status;
}

static npg_status make_folders(const settings *s)
{
    const char *const kinds[] = {s->rig ? "rig" : "points", "truth"};
    for (int i = 0; i < 2; i++) {
        char path[NPG_PATH_SIZE];
        NPG_TRY(npg_path_of(path, s->output, kinds[i]));
        NPG_TRY(npg_make_folder(path));
    }
    return NPG_OK;
}

static npg_scan capture_of(const settings *s, const npg_mesh *first)
{
    npg_scan capture = s->scan;
    npg_bounds bounds = npg_bounds_of(first->vert_pos, first->vert_count);
    capture.diagonal = npg_bounds_diagonal(&bounds);
    for (int k = 0; k < 3; k++) capture.centre[k] = 0.5 * (bounds.lo[k] + bounds.hi[k]);
    return capture;
}

/* The texture at the vertices of a body at rest. */
static npg_status paint(npg_mesh *mesh, const npg_mesh *rest)
{
    NPG_TRY(npg_alloc_array(&mesh->vert_colours, NPG_FOR_MESH, mesh->vert_count, 4));
    for (size_t i = 0; i < mesh->vert_count; i++) {
        const float *p = rest->vert_pos + 3 * i;
        npg_synth_colour(mesh->vert_colours + 4 * i,
                         (const double[3]){(double)p[0], (double)p[1], (double)p[2]});
    }
    return NPG_OK;
}

static npg_status write_points(const settings *s, const npg_scan *capture, const npg_mesh *mesh,
                               npg_scanned *points, int64_t t)
{
    NPG_TRY(npg_scan_frame(points, capture, mesh, (uint64_t)t));
    return write_arrays(s->output, "points", t, s, points->pos, s->normals ? points->normals : NULL,
                        points->count, NULL);
}

static npg_status write_images(const settings *s, const npg_scan *capture, const npg_moving *f, int64_t t)
{
    char folder[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(folder, s->output, "rig"));
    return npg_synth_rig_frame(folder, capture, f->mesh, f->body.rest, t, 0.001 * s->depth_noise_mm);
}

static npg_status make_frames(const settings *s, npg_moving *f, npg_scanned *points, size_t *total)
{
    npg_scan capture = {0};
    int64_t change = f->kind->change;
    for (int64_t t = 0; t < s->frames; t++) {
        npg_moment moment = {s->cycles * (double)t / (double)s->frames, s->travel, (double)(t - change)};
        if (t == 0 || t == change) NPG_TRY(npg_moving_open(f, s->cell, t >= change));
        npg_mesh *mesh = f->mesh;
        if (s->rig && !mesh->vert_colours) NPG_TRY(paint(mesh, f->body.rest));
        npg_moving_pose(f, &moment);
        if (t == 0) capture = capture_of(s, mesh);
        NPG_TRY(s->rig ? write_images(s, &capture, f, t) : write_points(s, &capture, mesh, points, t));
        NPG_TRY(write_arrays(s->output, "truth", t, s, mesh->vert_pos, mesh->vert_normals, mesh->vert_count,
                             mesh));
        *total += points->count;
    }
    return NPG_OK;
}

npg_status npg_synth(const npg_cli *cli, npg_figure *kind)
{
    const settings *s = cli->values;
    npg_moving f = {.kind = kind};
    npg_scanned points = {0};
    size_t total = 0;
    if (!s->output[0]) return npg_error(NPG_USAGE, "no output folder; say where with -o DIR");
    if (s->rig && !s->scan.cameras) return npg_error(NPG_USAGE, "a rig needs cameras: --cameras 4, say");
    if (kind->change < 0) kind->change = s->frames / 2;
    npg_status status = make_folders(s);
    if (!status) status = make_frames(s, &f, &points, &total);
    if (!status && s->rig)
        printf("%lld frames of %lld cameras", (long long)s->frames, (long long)s->scan.cameras);
    if (!status && !s->rig)
        printf("%lld frames, %.0f points each", (long long)s->frames, (double)total / (double)s->frames);
    if (!status)
        printf(", truth of %zu vertices and %zu faces\n%-7s %s/%s\ntruth   %s/truth\n", f.mesh->vert_count,
               f.mesh->face_count, s->rig ? "rig" : "points", s->output, s->rig ? "rig/rig.json" : "points",
               s->output);
    npg_scanned_close(&points);
    npg_moving_close(&f);
    return status;
}

npg_status npg_verb_synth(const npg_cli *cli)
{
    npg_figure walker = npg_walker;
    return npg_synth(cli, &walker);
}
