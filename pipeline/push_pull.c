/* Push and pull: what a program gives to a run, and takes from it, while it is walked. */
#include <string.h>

#include "pipeline/run_internal.h"
#include "pipeline/struct_size.h"

/* What to return when the run's end was closed: why it failed, or that it was stopped. */
static npg_status why_closed(npg_run *run)
{
    npg_status status = npg_run_wait(run);
    return status < 0 ? status : npg_error(NPG_STOPPED, "stopped on request");
}

/* ---- push ---- */

static npg_status frame_of_cloud(npg_frame *frame, npg_run *run, const npg_cloud *cloud)
{
    npg_facts *facts = &run->facts;
    size_t n = cloud->point_count;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, n, 3 * sizeof(float)));
    for (size_t i = 0; !facts->origin.known && i < n; i++)
        npg_origin_offer(&facts->origin, cloud->points + 3 * i);
    for (size_t i = 0; i < 3 * n; i++)
        frame->pos_local[i] = (float)(cloud->points[i] - facts->origin.world[i % 3]);
    if (cloud->normals && n) {
        NPG_TRY(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, n, 3 * sizeof(float)));
        memcpy(frame->normals, cloud->normals, n * 3 * sizeof(float));
    }
    if (cloud->colours && n) {
        NPG_TRY(npg_alloc_array(&frame->colours, NPG_FOR_FRAMES, n, 4));
        memcpy(frame->colours, cloud->colours, 4 * n);
    }
    frame->point_count = n;
    frame->number = cloud->number;
    frame->fields = NPG_FIELD_POINTS;
    return NPG_OK;
}

static npg_status refuse_push(const npg_run *run)
{
    const npg_settings *settings = &run->settings;
    return npg_error(NPG_USAGE, "this run reads its frames from %s",
                     settings->input[0] ? settings->input : settings->follow);
}

npg_status npg_run_push(npg_run *run, const npg_cloud *given)
{
    npg_cloud cloud;
    npg_frame frame = {0};
    npg_chunk *chunk = NULL;
    NPG_REQUIRE(run);
    NPG_TRY(npg_struct_take(&cloud, sizeof cloud, given, NPG_SIZE_UP_TO(npg_cloud, normals), "the cloud"));
    NPG_REQUIRE(cloud.points || !cloud.point_count);
    if (!run->feed) return refuse_push(run);
    if (npg_latch_wait(run->begun_latch, 1)) return why_closed(run); /* facts may be restored until then */
    if (cloud.number <= run->pushed_number)
        return npg_error(NPG_USAGE, "frame %lld was pushed after frame %lld", (long long)cloud.number,
                         (long long)run->pushed_number);
    npg_status status = frame_of_cloud(&frame, run, &cloud);
    if (!status) status = npg_chunk_open(&chunk, 1);
    if (!status) {
        npg_chunk_add(chunk, &frame);
        status = npg_ring_push(run->feed, &chunk);
    }
    if (!status) run->pushed_number = cloud.number;
    npg_frame_clear(&frame);
    npg_chunk_close(&chunk);
    return status == NPG_ABORTED ? why_closed(run) : status;
}

npg_status npg_run_wanted_number(npg_run *run, int64_t *number)
{
    NPG_REQUIRE(run && number);
    *number = INT64_MIN;
    if (!run->feed) return refuse_push(run);
    if (npg_latch_wait(run->begun_latch, 1)) return why_closed(run);
    *number = run->facts.wanted_number;
    return NPG_OK;
}

npg_status npg_run_finish(npg_run *run)
{
    NPG_REQUIRE(run);
    if (!run->feed) return refuse_push(run);
    npg_ring_end(run->feed);
    return NPG_OK;
}

/* ---- pull ---- */

typedef struct own_result {
    npg_arena arena; /* of what the result points to */
    npg_result given;
} own_result;

static npg_status open_result(npg_result **out, const npg_run *run, const npg_frame *frame)
{
    const npg_mesh *reference = run->facts.reference;
    const uint8_t *seen = frame->vert_colours ? frame->vert_colours : reference->vert_colours;
    own_result *result;
    NPG_TRY(npg_object_open(&result, NPG_FOR_FRAMES, sizeof *result));
    npg_arena *arena = &result->arena;
    double *vertices = npg_arena_take(arena, frame->vert_count, 3 * sizeof(double));
    uint32_t *faces = npg_arena_copy(arena, reference->faces, reference->face_count, 3 * sizeof(uint32_t));
    uint8_t *colours = seen ? npg_arena_copy(arena, seen, frame->vert_count, 4) : NULL;
    npg_status status = npg_arena_status(arena);
    if (status) npg_object_close(&result);
    NPG_TRY(status);
    npg_box_unit_to_world(&run->facts.box, vertices, frame->vert_unit, frame->vert_count);
    result->given = (npg_result){sizeof result->given,
                                 frame->index,
                                 frame->number,
                                 frame->vert_count,
                                 reference->face_count,
                                 vertices,
                                 faces,
                                 frame->figures.point_dist_median,
                                 frame->figures.coverage,
                                 colours,
                                 frame->figures.good};
    *out = &result->given;
    return NPG_OK;
}

npg_status npg_run_pull(npg_run *run, npg_result **result)
{
    NPG_REQUIRE(run && result);
    *result = NULL;
    if (!run->results) return npg_error(NPG_USAGE, "results can be pulled only with the option pull = yes");
    for (;;) {
        while (run->pulled && run->pulled_at < npg_chunk_count(run->pulled)) {
            npg_frame *frame = npg_chunk_frame(run->pulled, run->pulled_at++);
            if (frame->fields & NPG_FIELD_VERTICES) return open_result(result, run, frame);
        }
        npg_chunk_close(&run->pulled);
        run->pulled_at = 0;
        npg_status status = npg_ring_pop(run->results, &run->pulled);
        if (status == NPG_ABORTED) return why_closed(run);
        if (status) return status;
    }
}

void npg_result_close(npg_result **slot)
{
    if (!slot || !*slot) return;
    void *result = (char *)*slot - offsetof(own_result, given);
    *slot = NULL;
    npg_object_close(&result);
}
