/* Stages of one's own in the chain: one takes the floor away before anything else looks at the points, one
 * watches the finished meshes go by.
 *
 *     custom_stage CAPTURE OUT FLOOR      points with y below FLOOR are dropped
 *
 * Build:  cc custom_stage.c -o custom_stage $(pkg-config --cflags --libs neupig) */
#include <neupig.h>
#include <stdio.h>
#include <stdlib.h>

/* After ingest: points only, nothing cleaned yet.  The capture is read several times before it is solved (to
 * measure, to find the keyframe), so this sees every frame more than once and must say the same each time. */
static npg_status drop_floor(void *user, npg_frame_view *frame)
{
    const double *floor_y = user;
    for (size_t i = 0; i < frame->point_count; i++) {
        /* floats are kept near 0; the world is points_origin away */
        double y = frame->points_origin[1] + (double)frame->points[3 * i + 1];
        if (y < *floor_y) frame->keep[i] = 0;
    }
    return NPG_OK;
}

typedef struct watch {
    long long frames;
    double highest;
} watch;

/* After evaluate: every frame once, with its mesh and how well it explains the points. */
static npg_status note_height(void *user, npg_frame_view *frame)
{
    watch *w = user;
    for (size_t v = 0; v < frame->vertex_count; v++) {
        double y = frame->vertices_origin[1] + frame->vertices_unit * (double)frame->vertices[3 * v + 1];
        if (!w->frames || y > w->highest) w->highest = y;
    }
    if (frame->coverage < 0.05) return npg_error_set(NPG_BAD_INPUT, "nearly nothing of the body was seen");
    w->frames++;
    return NPG_OK;
}

/* A small reference and a small network: quick rather than good. */
static npg_status open_options(npg_options **options, const char *input, const char *output)
{
    const char *const settings[][2] = {
        {"input", input}, {"output", output}, {"epochs", "10"}, {"faces", "800"}};
    npg_status status = npg_options_open(options);
    for (size_t i = 0; i < sizeof settings / sizeof *settings && !status; i++)
        status = npg_options_set(*options, settings[i][0], settings[i][1]);
    return status;
}

int main(int argc, char **argv)
{
    double floor_y = argc > 3 ? atof(argv[3]) : 0;
    watch seen = {0, 0};
    npg_custom_stage floor_stage = {sizeof floor_stage, "floor", "ingest", &floor_y, drop_floor};
    npg_custom_stage watch_stage = {sizeof watch_stage, "watch", "evaluate", &seen, note_height};
    npg_options *options = NULL;
    npg_run *run = NULL;
    if (argc < 4) {
        fprintf(stderr, "usage: custom_stage CAPTURE OUT FLOOR\n");
        return 2;
    }
    npg_status status = open_options(&options, argv[1], argv[2]);
    /* Structs and texts are copied; what user points to must live until the run is closed. */
    if (!status) status = npg_options_add_stage(options, &floor_stage);
    if (!status) status = npg_options_add_stage(options, &watch_stage);
    if (!status) status = npg_run_open(&run, options, NULL);
    if (!status) status = npg_run_wait(run); /* the stages' threads are done when this returns */
    if (status >= 0) printf("%lld frames, the highest vertex at y = %.3f\n", seen.frames, seen.highest);
    if (status < 0) fprintf(stderr, "custom_stage: %s\n", npg_error_text());
    npg_run_close(&run);
    npg_options_close(&options);
    return npg_status_exit_code(status);
}
