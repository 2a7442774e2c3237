/* neupig apply: another mesh, or points, carried through all frames of a finished run. */
#include <stddef.h>

#include "export/export.h"
#include "tools/cli.h"
#include "tools/segments/segments.h"

typedef struct settings {
    const char *mesh, *output, *prefix, *list;
    int64_t fps_scale;
    double far_share;
    bool overwrite;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_apply_options[] = {
    /* type        name         place          default  least  most  shown as or words */
    NPG_ROW_TEXT  ("mesh",      AT(mesh),      "",      "FILE",
        "Mesh (PLY, OBJ) or points (also XYZ, NPY, PCD) to carry, in the coordinates of JOB/reference.ply"),
    NPG_ROW_TEXT  ("output",    AT(output),    "",      "OUT",
        "Folder for the carried meshes (also -o)"),
    NPG_ROW_INT   ("fps-scale", AT(fps_scale), "1",     1,     1000, "K",
        "Steps from each frame to the next; "
        "more than 1 adds in-between frames, on curves through the run's, and numbers the files 0, 1, 2 ..."),
    NPG_ROW_REAL  ("far",       AT(far_share), "0.05",  0,     1e6,  "SHARE",
        "Points farther from the reference than this share of its diagonal are reported (exit code 7)"),
    NPG_ROW_TEXT  ("export",    AT(list),      "",      "LIST",
        NPG_EXPORT_FORMS ": what to write, as of neupig run. Without: OBJ of an OBJ file, PLY of others"),
    NPG_ROW_TEXT  ("prefix",    AT(prefix),    "frame", "NAME",
        "First part of the files' names"),
    NPG_ROW_FLAG  ("overwrite", AT(overwrite), "no",
        "Remove files of the same prefix that lie in the output folder"),
    {0}};
/* clang-format on */

npg_status npg_verb_apply(const npg_cli *cli)
{
    const settings *s = cli->values;
    const char *job = cli->operands[0];
    npg_applied applied = {.struct_size = sizeof applied};
    const npg_apply_settings all = {sizeof all, job,          s->mesh,      s->output,   s->prefix,
                                    s->list,    s->fps_scale, s->far_share, s->overwrite};
    NPG_TRY(npg_segments_refuse(job, "apply", false));
    npg_status status = npg_apply(&applied, &all);
    if (applied.far_count)
        fprintf(stderr,
                "neupig apply: %zu of %zu points of %s lie farther than %g diagonals from the reference; "
                "the worst, point %zu, %.3g away (%.3g diagonals)\n",
                applied.far_count, applied.point_count, s->mesh, s->far_share, applied.worst,
                applied.worst_dist, applied.worst_share);
    NPG_TRY(status);
    printf("%zu frames of %s in %s\n", applied.frames, s->mesh, s->output);
    return applied.far_count ? NPG_PARTIAL : NPG_OK;
}
