/* Least: a copy of the state with the least loss. */
#include "optimize/fit_least.h"

#include <string.h>

double npg_fit_plain_loss(const npg_fit_step *step, double isometry_weight)
{
    return step->chamfer + isometry_weight * step->isometry;
}

static npg_status alloc_copies(npg_fit_least *least, const npg_fit_knowns *now, size_t code_count)
{
    if (least->rows) return NPG_OK;
    least->row_bytes = now->rows->size;
    least->param_bytes = now->params->size;
    least->code_bytes = code_count * sizeof(double);
    NPG_TRY(npg_alloc(&least->params, NPG_FOR_FIT, now->params->size));
    NPG_TRY(npg_alloc_array(&least->code, NPG_FOR_FIT, code_count + 1, sizeof(double)));
    return npg_alloc(&least->rows, NPG_FOR_FIT, now->rows->size);
}

npg_status npg_fit_least_offer(npg_fit_least *least, const npg_fit_step *step, double loss,
                               const npg_fit_knowns *now)
{
    size_t code_count;
    int64_t *code_step;
    const double *code = npg_time_code_parts(now->time_code, &code_count, &code_step);
    if (least->rows && !(loss < least->loss)) return NPG_OK; /* nor what is no number */
    NPG_TRY(alloc_copies(least, now, code_count));
    NPG_TRY(npg_buffer_read(now->rows, 0, least->rows, now->rows->size));
    NPG_TRY(npg_buffer_read(now->params, 0, least->params, now->params->size));
    if (code_count) memcpy(least->code, code, code_count * sizeof *code);
    least->step = *step;
    least->loss = loss;
    return NPG_OK;
}

npg_status npg_fit_least_restore(const npg_fit_least *least, const npg_fit_knowns *to)
{
    size_t code_count;
    int64_t *code_step;
    double *code = npg_time_code_parts(to->time_code, &code_count, &code_step);
    NPG_REQUIRE(least->rows);
    NPG_TRY(npg_buffer_write(to->rows, 0, least->rows, to->rows->size));
    NPG_TRY(npg_buffer_write(to->params, 0, least->params, to->params->size));
    if (code_count) memcpy(code, least->code, code_count * sizeof *code);
    return NPG_OK;
}

void npg_fit_least_clear(npg_fit_least *least)
{
    npg_release(&least->rows);
    npg_release(&least->params);
    npg_release(&least->code);
}

/* ---- on disk ---- */

typedef struct saved_least {
    npg_fit_step step;
    double loss;
} saved_least;

npg_status npg_fit_least_save(const npg_fit_least *least, npg_archive_writer *archive)
{
    const saved_least saved = {least->step, least->loss};
    if (!least->rows) return NPG_OK;
    NPG_TRY(npg_archive_put(archive, "least.step", &saved, sizeof saved));
    NPG_TRY(npg_archive_put(archive, "least.rows", least->rows, least->row_bytes));
    NPG_TRY(npg_archive_put(archive, "least.decoder", least->params, least->param_bytes));
    return npg_archive_put(archive, "least.time", least->code, least->code_bytes);
}

static npg_status load(void *out, size_t *bytes, const npg_archive *archive, const char *block)
{
    if (!npg_archive_find(archive, block, bytes))
        return npg_error(NPG_BAD_INPUT, "the block %s is missing", block);
    NPG_TRY(npg_alloc(out, NPG_FOR_FIT, *bytes + sizeof(double)));
    return npg_archive_get(archive, block, *(void **)out, *bytes);
}

npg_status npg_fit_least_load(npg_fit_least *least, const npg_archive *archive)
{
    saved_least saved;
    size_t size;
    npg_fit_least_clear(least);
    if (!npg_archive_find(archive, "least.step", &size)) return NPG_OK;
    NPG_TRY(npg_archive_get(archive, "least.step", &saved, sizeof saved));
    least->step = saved.step;
    least->loss = saved.loss;
    NPG_TRY(load(&least->params, &least->param_bytes, archive, "least.decoder"));
    NPG_TRY(load(&least->code, &least->code_bytes, archive, "least.time"));
    return load(&least->rows, &least->row_bytes, archive, "least.rows");
}
