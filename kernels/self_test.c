/* Self-test: one epoch of a small fit of made-up numbers.  Each op hands its result to the next, so
 * the first that is off is the one that is wrong. */
#include "kernels/kernels.h"

#include <math.h>

#include "kernels/adam.h"
#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "kernels/motion.h"
#include "kernels/sobolev.h"
#include "pipeline/random.h"

/* VERTS: whole blocks of the decoder under every tuning (tuning.c), so that nothing is padded. */
enum { VERTS = 192, FRAMES = 3, POINTS = 250, EDGES = 2 * VERTS - 3, CODE = 8, WIDTH = 64 };
#define CHANNELS ((size_t)NPG_LATENT_CHANNELS)

/* Of the made-up numbers: no edge is within 5e-5 of its length at rest, and no point has two nearest within that. */
#define SEED 2965

/* What each result comes to: a sum with weights that differ from place to place, and the root of the sum of squares.
 * These are the kernels' own where tests/kernels/test_kernels.c finds them equal to plain C in double; other orders of
 * sums are within 3e-7 of them. */
#define TOLERANCE 2e-5
static const struct answer {
    const char *op;
    double sum, size;
} answers[] = {
    {"sobolev", 7.506102, 18.664723},    {"latent", 2.3497773, 6.7745348},
    {"mlp", 0.2246214, 5.21684},         {"transform", -1.3114599, 12.276562},
    {"nearest", -784.90795, 3084.0673},  {"nearest", -55.561084, 3001.6827},
    {"chamfer", 6.1805728, 19.906097},   {"chamfer", 49.901273, 34.40681},
    {"isometry", 380.08539, 392.826},    {"isometry", -0.063821245, 4.111312},
    {"transform", -63.125412, 372.3879}, {"mlp", -407.9974, 404.03152},
    {"mlp", 20.501258, 72.328521},       {"latent", 5.2403323, 19.984723},
    {"adam", 15.330496, 24.087552},
};

typedef struct trial {
    npg_device *device; /* loan */
    const struct answer *next;
    npg_random random;
    npg_arena arena;
    npg_samples samples;
    npg_levels levels;
    npg_sobolev sobolev;
    npg_latent latent;
    npg_mlp mlp;
    npg_motion motion;
    npg_adam adam;
    npg_buffer u, nodes, dnodes;
} trial;

/* ---- numbers ---- */

/* n values in +-scale, from the arena; NULL when there is no memory, which its status tells. */
static float *draw(trial *t, size_t n, double scale)
{
    float *values = npg_arena_take(&t->arena, n, sizeof *values);
    for (size_t i = 0; values && i < n; i++)
        values[i] = (float)(scale * (2 * npg_random_real(&t->random) - 1));
    return values;
}

/* Points along a bent line, so that neighbours in the list are neighbours in space. */
static float *draw_line(trial *t, size_t n)
{
    float *points = draw(t, 3 * n, 0.1);
    for (size_t i = 0; points && i < n; i++) {
        points[3 * i] += (float)(1.6 * (double)i / (double)n - 0.8);
        points[3 * i + 1] += (float)(0.3 * sin(0.05 * (double)i));
    }
    return points;
}

/* ---- opening ---- */

static npg_status open_field(trial *t, const float *rest, const float *normals)
{
    size_t bytes = t->levels.row_count * CHANNELS * sizeof(float);
    const float *u = draw(t, t->levels.row_count * CHANNELS, 1);
    float *rates = draw(t, t->levels.row_count, 0.1);
    NPG_TRY(npg_arena_status(&t->arena));
    NPG_TRY(npg_samples_open(&t->samples, &t->levels, rest, normals, VERTS, VERTS));
    NPG_TRY(npg_sobolev_open(&t->sobolev, t->device, &t->levels));
    NPG_TRY(npg_latent_open(&t->latent, t->device, &t->samples));
    NPG_TRY(npg_adam_open(&t->adam, t->device, rates, CHANNELS, t->levels.row_count * CHANNELS));
    NPG_TRY(npg_buffer_from(&t->u, t->device, u, bytes));
    NPG_TRY(npg_buffer_open(&t->nodes, t->device, bytes));
    return npg_buffer_open(&t->dnodes, t->device, bytes);
}

static npg_status open_decoder(trial *t)
{
    const npg_mlp_shape shape = {WIDTH, WIDTH / 2, CODE};
    size_t count = npg_mlp_places_of(&shape).end, head = npg_mlp_places_of(&shape).head;
    float *params = draw(t, count, 0.2);
    const float *code = draw(t, FRAMES * CODE, 1);
    NPG_TRY(npg_arena_status(&t->arena));
    for (size_t at = head; at < npg_mlp_places_of(&shape).w1z;
         at++) { /* columns past the used ones are zero */
        bool is_bias = at >= npg_mlp_places_of(&shape).b2;
        size_t column = is_bias ? at - npg_mlp_places_of(&shape).head_bias : (at - head) % NPG_MLP_HEAD_ROW;
        if (column >= NPG_MLP_USED && column < NPG_MLP_HEAD_ROW) params[at] = 0;
    }
    NPG_TRY(npg_mlp_open(&t->mlp, t->device, &shape, VERTS, FRAMES, FRAMES));
    NPG_TRY(npg_buffer_write(&t->mlp.params, 0, params, count * sizeof *params));
    return npg_buffer_write(&t->mlp.code, 0, code, FRAMES * CODE * sizeof *code);
}

/* The edges are a strip: every vertex with the next two. */
static npg_status open_motion(trial *t, const float *rest)
{
    uint32_t edges[EDGES][2];
    npg_target targets[FRAMES];
    for (uint32_t e = 0; e < EDGES; e++) edges[e][0] = e / 2, edges[e][1] = e / 2 + 1 + e % 2;
    for (size_t f = 0; f < FRAMES; f++) targets[f] = (npg_target){draw_line(t, POINTS - f), POINTS - f};
    NPG_TRY(npg_arena_status(&t->arena));
    return npg_motion_open(&t->motion, t->device, rest, VERTS, VERTS, (const uint32_t(*)[2])edges, EDGES,
                           targets, FRAMES);
}

static npg_status open_trial(trial *t)
{
    const float *rest = draw_line(t, VERTS), *normals = draw(t, 3 * VERTS, 1);
    for (int l = 0; l < 3; l++)
        npg_levels_add(&t->levels, (npg_level){NPG_LEVEL_POSITION, 2 + 3 * l, 0, 0, 0, 30, 1.0 / 3, 0.4, 1});
    npg_levels_add(&t->levels, (npg_level){NPG_LEVEL_NORMAL, 4, 0, 0, 30, 32, 1, 0.4, 1});
    NPG_TRY(npg_arena_status(&t->arena));
    NPG_TRY(open_field(t, rest, normals));
    NPG_TRY(open_decoder(t));
    return open_motion(t, rest);
}

/* ---- the epoch ---- */

/* The first n numbers of a buffer against the next answer. */
static npg_status expect(trial *t, const npg_buffer *buffer, size_t n, bool is_index)
{
    const struct answer *want = t->next++;
    double sum = 0, size = 0;
    float *values = npg_arena_take(&t->arena, n, sizeof *values);
    NPG_TRY(npg_arena_status(&t->arena));
    NPG_TRY(npg_buffer_read(buffer, 0, values, n * sizeof *values));
    for (size_t i = 0; i < n; i++) {
        double value = is_index ? (double)((const int32_t *)(const void *)values)[i] : (double)values[i];
        sum += value * sin(1.7 * (double)i + 1);
        size += value * value;
    }
    size = sqrt(size);
    if (fabs(sum - want->sum) <= TOLERANCE * want->size && fabs(size - want->size) <= TOLERANCE * want->size)
        return NPG_OK;
    return npg_error(NPG_DEVICE, "%s computes op %s wrong: %.8g of %.8g, known answer %.8g of %.8g",
                     npg_device_facts(t->device)->name, want->op, sum, size, want->sum, want->size);
}

static npg_status go_forward(trial *t)
{
    NPG_TRY(npg_sobolev_solve(&t->sobolev, &t->nodes, &t->u));
    NPG_TRY(expect(t, &t->nodes, t->levels.row_count * CHANNELS, false));
    NPG_TRY(npg_latent_sample(&t->latent, &t->mlp.z, &t->nodes));
    NPG_TRY(expect(t, &t->mlp.z, VERTS * CHANNELS, false));
    return npg_mlp_begin(&t->mlp);
}

static npg_status decode(trial *t)
{
    NPG_TRY(npg_mlp_forward(&t->mlp, 0, FRAMES));
    NPG_TRY(expect(t, &t->mlp.out, FRAMES * VERTS * NPG_MLP_OUT, false));
    NPG_TRY(npg_motion_apply(&t->motion, &t->mlp.out, 0, FRAMES));
    return expect(t, &t->motion.x, FRAMES * VERTS * 3, false);
}

/* Twice: the second search has the answers of the first as candidates. */
static npg_status measure(trial *t)
{
    const float gains[FRAMES] = {0.5f, 2, 1};
    for (int i = 0; i < 2; i++) NPG_TRY(npg_motion_chamfer(&t->motion, 0.3, 0, FRAMES));
    NPG_TRY(expect(t, &t->motion.to_points, FRAMES * VERTS, true));
    NPG_TRY(expect(t, &t->motion.to_verts, FRAMES * POINTS - 3, true));
    NPG_TRY(expect(t, &t->motion.cd, FRAMES, false));
    NPG_TRY(expect(t, &t->motion.g, FRAMES * VERTS * 3, false));
    NPG_TRY(npg_motion_back(&t->motion, &t->mlp.dout, &t->mlp.out, gains, 7, 0, FRAMES));
    NPG_TRY(expect(t, &t->motion.g, FRAMES * VERTS * 3, false));
    NPG_TRY(expect(t, &t->motion.part, FRAMES * VERTS / NPG_LANES, false));
    return expect(t, &t->mlp.dout, FRAMES * VERTS * NPG_MLP_OUT, false);
}

static npg_status go_back(trial *t)
{
    size_t nodes = t->levels.row_count * CHANNELS;
    NPG_TRY(npg_mlp_backward(&t->mlp, 0, FRAMES));
    NPG_TRY(npg_mlp_end(&t->mlp));
    NPG_TRY(expect(t, &t->mlp.grad, npg_mlp_places_of(&t->mlp.shape).end, false));
    NPG_TRY(expect(t, &t->mlp.dz, VERTS * CHANNELS, false));
    NPG_TRY(npg_latent_back(&t->latent, &t->dnodes, &t->mlp.dz, &t->mlp.z));
    NPG_TRY(expect(t, &t->dnodes, nodes, false));
    NPG_TRY(npg_adam_step(&t->adam, &t->nodes, &t->u)); /* exact: a first step goes by signs alone */
    NPG_TRY(npg_adam_step(&t->adam, &t->nodes, &t->dnodes));
    return expect(t, &t->nodes, nodes, false);
}

static void close_trial(trial *t)
{
    npg_samples_close(&t->samples);
    npg_sobolev_close(&t->sobolev);
    npg_latent_close(&t->latent);
    npg_mlp_close(&t->mlp);
    npg_motion_close(&t->motion);
    npg_adam_close(&t->adam);
    npg_buffer_close(&t->u);
    npg_buffer_close(&t->nodes);
    npg_buffer_close(&t->dnodes);
    npg_arena_release(&t->arena);
}

npg_status npg_kernels_self_test(npg_device *device)
{
    trial t = {.device = device,
               .next = answers,
               .random = npg_random_stream(SEED, 10, 0),
               .arena.purpose = NPG_FOR_RUN};
    npg_status status = open_trial(&t);
    if (!status) status = go_forward(&t);
    if (!status) status = decode(&t);
    if (!status) status = measure(&t);
    if (!status) status = go_back(&t);
    close_trial(&t);
    return npg_error_prefix(status, "self-test");
}
