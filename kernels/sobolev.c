/* sobolev: tables of the levels and the six passes. */
#include "kernels/sobolev.h"

#include "kernels/jacobi.h"

typedef struct tables {
    int32_t level[NPG_LEVELS_MAX][NPG_GRID];
    int32_t eigen_first[NPG_LEVELS_MAX];
    float lambda[NPG_LEVELS_MAX];
    size_t matrix_size, eigen_size, lines;
} tables;

static bool is_smoothed(const npg_level *level)
{
    return level->lambda > 0;
}

static void fill_tables(tables *t, const npg_levels *levels)
{
    for (int l = 0; l < levels->count; l++) {
        const npg_level *level = &levels->level[l];
        size_t n = is_smoothed(level) ? (size_t)level->nodes : 0;
        t->level[l][NPG_GRID_NODES] = (int32_t)n;
        t->level[l][NPG_GRID_ROW] = (int32_t)level->first_row;
        t->level[l][NPG_GRID_LINE] = (int32_t)t->lines;
        t->level[l][NPG_GRID_MATRIX] = (int32_t)t->matrix_size;
        t->eigen_first[l] = (int32_t)t->eigen_size;
        t->lambda[l] = (float)level->lambda;
        t->matrix_size += n * n;
        t->eigen_size += n;
        t->lines += n ? n * n : level->row_count;
    }
}

#define SWEEPS 60 /* of rotations, ample: what is 0 already is passed over */

/* What makes the smoothing of a grid diagonal, axis by axis.  Along one axis of n nodes M = 2 D - A is a
 * tridiagonal matrix: D counts a node's neighbours on the axis (1 at the ends, 2 between), A joins neighbours.  An
 * n^3 grid's 2 D - A is the Kronecker sum of three of these.  M = matrix^T diag(eigen) matrix, rows orthonormal. */
static npg_status fill_transform(float *matrix, float *eigen, size_t n)
{
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    double *m = npg_arena_take(&scratch, n * n, sizeof *m);
    double *vectors = npg_arena_take(&scratch, n * n, sizeof *vectors); /* columns */
    npg_status status = npg_arena_status(&scratch);
    for (size_t i = 0; i < n && !status; i++) {
        m[i * n + i] = 2 * ((i > 0) + (i < n - 1));
        if (i) m[i * n + i - 1] = m[(i - 1) * n + i] = -1;
    }
    if (!status) npg_jacobi(m, vectors, (int)n, SWEEPS);
    for (size_t k = 0; k < n && !status; k++) {
        eigen[k] = (float)m[k * n + k];
        for (size_t j = 0; j < n; j++) matrix[k * n + j] = (float)vectors[j * n + k];
    }
    npg_arena_release(&scratch);
    return status;
}

static npg_status upload_transforms(npg_sobolev *sobolev, npg_device *device, const tables *t)
{
    float *matrices = NULL, *eigen = NULL;
    npg_status status = npg_alloc_array(&matrices, NPG_FOR_FIT, t->matrix_size + 1, sizeof(float));
    if (!status) status = npg_alloc_array(&eigen, NPG_FOR_FIT, t->eigen_size + 1, sizeof(float));
    for (int l = 0; !status && l < sobolev->level_count; l++)
        if (t->level[l][NPG_GRID_NODES])
            status = fill_transform(matrices + t->level[l][NPG_GRID_MATRIX], eigen + t->eigen_first[l],
                                    (size_t)t->level[l][NPG_GRID_NODES]);
    if (!status)
        status = npg_buffer_from(&sobolev->matrices, device, matrices, (t->matrix_size + 1) * sizeof(float));
    if (!status)
        status = npg_buffer_from(&sobolev->eigen, device, eigen, (t->eigen_size + 1) * sizeof(float));
    npg_release(&matrices);
    npg_release(&eigen);
    return status;
}

npg_status npg_sobolev_open(npg_sobolev *sobolev, npg_device *device, const npg_levels *levels)
{
    tables t = {0};
    size_t bytes = levels->row_count * NPG_LATENT_CHANNELS * sizeof(float);
    fill_tables(&t, levels);
    *sobolev = (npg_sobolev){.level_count = levels->count, .line_count = t.lines};
    npg_status status = npg_program_open(&sobolev->program, device, "sobolev", "");
    if (!status) status = npg_buffer_from(&sobolev->levels, device, t.level, sizeof t.level);
    if (!status) status = npg_buffer_from(&sobolev->eigen_first, device, t.eigen_first, sizeof t.eigen_first);
    if (!status) status = npg_buffer_from(&sobolev->lambda, device, t.lambda, sizeof t.lambda);
    if (!status) status = upload_transforms(sobolev, device, &t);
    if (!status) status = npg_buffer_open(&sobolev->a, device, bytes);
    if (!status) status = npg_buffer_open(&sobolev->b, device, bytes);
    if (status) npg_sobolev_close(sobolev);
    return status;
}

void npg_sobolev_close(npg_sobolev *sobolev)
{
    npg_buffer_close(&sobolev->levels);
    npg_buffer_close(&sobolev->matrices);
    npg_buffer_close(&sobolev->eigen);
    npg_buffer_close(&sobolev->eigen_first);
    npg_buffer_close(&sobolev->lambda);
    npg_buffer_close(&sobolev->a);
    npg_buffer_close(&sobolev->b);
}

static npg_status pass(npg_sobolev *s, const npg_buffer *out, const npg_buffer *in, int axis, int back,
                       int scale)
{
    return NPG_LAUNCH(s->program, "sobolev_pass", s->line_count, 1, NPG_BUF(out), NPG_BUF(in),
                      NPG_BUF(&s->levels), NPG_BUF(&s->matrices), NPG_BUF(&s->eigen),
                      NPG_BUF(&s->eigen_first), NPG_BUF(&s->lambda), NPG_INT(s->level_count),
                      NPG_INT(s->line_count), NPG_INT(axis), NPG_INT(back), NPG_INT(scale));
}

npg_status npg_sobolev_solve(npg_sobolev *s, const npg_buffer *x, const npg_buffer *y)
{
    NPG_TRY(pass(s, &s->a, y, 0, 0, 0));
    NPG_TRY(pass(s, &s->b, &s->a, 1, 0, 0));
    NPG_TRY(pass(s, &s->a, &s->b, 2, 0, 1));
    NPG_TRY(pass(s, &s->b, &s->a, 2, 1, 0));
    NPG_TRY(pass(s, &s->a, &s->b, 1, 1, 0));
    return pass(s, x, &s->a, 0, 1, 0);
}
