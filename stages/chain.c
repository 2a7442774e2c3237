/* Chain: the order of the data's way.  The program's table of contents. */
#include "pipeline/options.h"
#include "pipeline/stage.h"

extern const npg_stage npg_stage_ingest, npg_stage_outlier, npg_stage_keyframe, npg_stage_mesh,
    npg_stage_align, npg_stage_fuse, npg_stage_reference, npg_stage_optimize, npg_stage_evaluate,
    npg_stage_export, npg_stage_job;

const npg_stage *const npg_chain[] = {
    &npg_stage_job,       /* resumes what an earlier run of the same job left     */
    &npg_stage_ingest,    /* files, a stream or pushed frames -> chunks of points */
    &npg_stage_outlier,   /* drops what is no surface, makes or mends normals     */
    &npg_stage_keyframe,  /* box, keyframe, plan of the windows                   */
    &npg_stage_mesh,      /* the reference surface of the keyframe                */
    &npg_stage_align,     /* the reference brought coarsely into each frame       */
    &npg_stage_fuse,      /* the points of all frames, for a better reference     */
    &npg_stage_reference, /* which keyframe, how many passes: decided between them */
    &npg_stage_optimize,  /* its deformation in every frame                       */
    &npg_stage_evaluate,  /* figures and a verdict per frame                      */
    &npg_stage_export,    /* meshes, report, done.json                            */
    NULL};

/* clang-format off */
/* Parts that nearly touch are held apart in the keyframe, as by default: legs that Poisson joins are drawn to each
 * other's points, early and for good. */
#define PAPER                                                                                                \
    {"align", "no"},                   /* from the reference */                                              \
        {"keyframe-choice", "paper"},  /* by score alone */                                                  \
        {"poisson-depth", "10"},                                                                             \
        {"smooth", "no"},              /* the keyframe's points as they are */                               \
        {"unseen", "keep"},            /* as Poisson closed it */                                            \
        {"window", "-1"}               /* all frames at once, up to 60 */
static const npg_preset_value paper[] = {PAPER, {"epochs", "250"}, {NULL, NULL}};
static const npg_preset_value paper_1000[] = {PAPER, {"epochs", "1000"}, {NULL, NULL}}; /* the slower setting */
static const npg_preset_value grids[] = {
    {"solver",    "grids"}, /* over aligned poses */
    {"width-1",   "64"},    /* ways from the smoothed poses are small and smooth: */
    {"width-2",   "64"},    /* 128 takes three times as long for hardly more      */
    {"time-frequencies", "5"}, /* up to about that of the frames */
    {"grid-levels", "6"},      /* of few vertices: eight cost a third more for 0.002 of the energy */
    {"grid-rate", "0.03"},
    {"mlp-rate",  "0.004"},
    {"epochs",    "100"},
    {NULL, NULL}};
static const npg_preset_value quick[] = {
    {"keyframe-choice", "paper"}, {"reference-from", "key"}, {NULL, NULL}};
static const npg_preset_value best[] = {
    {"reference-rounds", "2"}, /* a finer graph gains nothing: tests/bed/decisions.md */
    {"attempts", "4"},
    {NULL, NULL}};
static const npg_preset_value none[] = {
    {NULL, NULL}};
/* clang-format on */

const npg_preset npg_presets[] = {
    {"method", "default", "alignment frame by frame, then a joint fit of windows of frames", none},
    {"method", "paper",
     "the method as the paper has it: every vertex, from the reference, all frames at once up to 60; beyond, "
     "windows from aligned poses",
     paper},
    {"method", "paper-1000", "the same with its 1000 epochs", paper_1000},
    {"method", "grids",
     "the same as default, the fit of windows by the paper's grids and decoder over the aligned poses",
     grids},
    {"effort", "quick", "the reference from one frame, which is not compared with others", quick},
    {"effort", "best", "points gathered twice, and four other keyframes where frames fail", best},
    {NULL, NULL, NULL, NULL}};
