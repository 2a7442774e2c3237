/* Job motion: replayed windows in the coordinates of the run's files. */
#include "tools/job_motion.h"

#include <math.h>
#include <stdio.h>

#include "optimize/optimize.h"
#include "pipeline/file.h"
#include "pipeline/frame_box.h"

/* Of the diagonal, between reference.ply and the reference of the windows: more than their rounding. */
#define OFF_MOST 1e-4

/* file[a] = scale sign[a] unit[from[a]] + shift[a]: what --axes, --scale, --centre and the box have made of
 * unit coordinates.  It is found again by comparing the two forms of the reference. */
typedef struct placement {
    int from[3];
    double factor[3], shift[3];
} placement;

struct npg_job_motion {
    npg_device *device;
    npg_replay *replay;
    placement place;
    size_t vert_count;
};

/* ---- the coordinates ---- */

typedef struct moments { /* of the unit (u) and the file's (w) coordinates about their means */
    double mean_u[3], mean_w[3], of_u[3], of_w[3], both[3][3]; /* both[a][b]: w_a u_b */
} moments;

static moments moments_of(const float *unit, const float *file, size_t count)
{
    moments m = {0};
    for (size_t i = 0; i < 3 * count; i++) {
        m.mean_u[i % 3] += (double)unit[i] / (double)count;
        m.mean_w[i % 3] += (double)file[i] / (double)count;
    }
    for (size_t v = 0; v < count; v++)
        for (int a = 0; a < 3; a++) {
            double w = (double)file[3 * v + (size_t)a] - m.mean_w[a];
            double own = (double)unit[3 * v + (size_t)a] - m.mean_u[a];
            m.of_w[a] += w * w;
            m.of_u[a] += own * own;
            for (int b = 0; b < 3; b++) m.both[a][b] += w * ((double)unit[3 * v + (size_t)b] - m.mean_u[b]);
        }
    return m;
}

/* The factors for one order of the axes, and the sum of squares that they leave. */
static double try_order(placement *place, const moments *m, const int from[3])
{
    double both = 0, of_u = 0, of_w = 0;
    for (int a = 0; a < 3; a++) {
        both += fabs(m->both[a][from[a]]);
        of_u += m->of_u[a];
        of_w += m->of_w[a];
    }
    double scale = of_u > 0 ? both / of_u : 0;
    for (int a = 0; a < 3; a++) {
        place->from[a] = from[a];
        place->factor[a] = m->both[a][from[a]] < 0 ? -scale : scale;
        place->shift[a] = m->mean_w[a] - place->factor[a] * m->mean_u[from[a]];
    }
    return of_w - 2 * scale * both + scale * scale * of_u; /* sum of (w - scale u)^2 */
}

static void place_points(const placement *place, float *out, const float *unit, size_t count)
{
    for (size_t v = 0; v < count; v++) {
        const float u[3] = {unit[3 * v], unit[3 * v + 1], unit[3 * v + 2]};
        for (size_t a = 0; a < 3; a++)
            out[3 * v + a] = (float)(place->factor[a] * (double)u[place->from[a]] + place->shift[a]);
    }
}

static npg_status find_placement(npg_job_motion *motion, const npg_mesh *reference)
{
    static const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    const float *rest = npg_replay_rest(motion->replay);
    size_t count = reference->vert_count;
    moments m = moments_of(rest, reference->vert_pos, count);
    double best = (double)INFINITY, off = 0;
    for (int i = 0; i < 6; i++) {
        placement trial;
        double left = try_order(&trial, &m, orders[i]);
        if (left >= best) continue;
        best = left;
        motion->place = trial;
    }
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, reference->vert_pos, count);
    for (size_t v = 0; v < count; v++) {
        float at[3];
        place_points(&motion->place, at, rest + 3 * v, 1);
        for (size_t a = 0; a < 3; a++)
            off = fmax(off, fabs((double)at[a] - (double)reference->vert_pos[3 * v + a]));
    }
    if (off <= OFF_MOST * npg_bounds_diagonal(&bounds)) return NPG_OK;
    return npg_error(NPG_BAD_INPUT,
                     "reference.ply is not the reference that the windows in job/ move: they differ by %.3g",
                     off);
}

/* ---- the motion ---- */

static npg_status load_motion(npg_job_motion *motion, const char *job, const npg_mesh *reference,
                              const char *device)
{
    char *folder;
    NPG_TRY(npg_device_open(&motion->device, device));
    NPG_TRY(npg_join_path(&folder, job, "job"));
    npg_status status = npg_replay_open(&motion->replay, motion->device, folder);
    npg_release(&folder);
    NPG_TRY(status);
    motion->vert_count = npg_replay_vert_count(motion->replay);
    if (motion->vert_count != reference->vert_count)
        return npg_error(NPG_BAD_INPUT, "reference.ply has %zu vertices, the windows in job/ move %zu",
                         reference->vert_count, motion->vert_count);
    return find_placement(motion, reference);
}

npg_status npg_job_motion_open(npg_job_motion **out, const char *job, const npg_mesh *reference,
                               const char *device)
{
    npg_job_motion *motion;
    *out = NULL;
    NPG_TRY(npg_alloc(&motion, NPG_FOR_FIT, sizeof *motion));
    npg_status status = load_motion(motion, job, reference, device);
    if (status) npg_job_motion_close(&motion);
    *out = motion;
    return status;
}

void npg_job_motion_close(npg_job_motion **slot)
{
    if (!slot || !*slot) return;
    npg_replay_close(&(*slot)->replay);
    npg_device_close(&(*slot)->device);
    npg_release(slot);
}

npg_status npg_job_motion_pose(npg_job_motion *motion, float *vert_pos, double index)
{
    NPG_TRY(npg_replay_vertices(motion->replay, vert_pos, index));
    place_points(&motion->place, vert_pos, vert_pos, motion->vert_count);
    return NPG_OK;
}
