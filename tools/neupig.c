/* neupig: the command.  One verb per file; this one holds their table and the small verbs. */
#include <malloc.h>
#include <signal.h>
#include <stddef.h>
#include <string.h>

#include "pipeline/options.h"
#include "tools/cli.h"

const npg_verb npg_verbs[] = {
    {"run", "INPUT -o DIR", 0, 1, "Turn a capture into a moving mesh",
     "INPUT (a folder, a pattern like frame_%04d.ply, a list file, a rig.json, or - for standard input) becomes "
     "one moving mesh in DIR.  "
     "Its point clouds are read in time order, and one mesh per frame is written, all with the same faces, to "
     "DIR/meshes, with reference.ply, report.json, frames.jsonl and, last of all, done.json beside them.  "
     "A run that was stopped or killed is resumed when it is started again.  "
     "With --segments auto, where the topology changes another reference takes over: DIR/segment_* are then "
     "runs by themselves, and DIR/segments.json lists their frames, why they were cut, and their overlaps.",
     npg_run_verb_options, true, npg_verb_run},
    {"append", "DIR", 1, 1, "Continue a finished job with frames that came since",
     "DIR is the output folder of a run.  "
     "Frames that its input has after the last one of then are solved with the same options, "
     "from the last forward window on; the frames of the overlap before them are solved again, "
     "all other meshes stay as they are.  A job that was stopped is first brought to its end.",
     npg_append_options, false, npg_verb_append},
    {"batch", "MANIFEST|DIR [-o DIR]", 1, 1, "Run many captures, each in its own folder and process",
     "MANIFEST is a JSON file: {\"output\": \"results\", "
     "\"defaults\": {\"method\": \"best\", \"max-time\": 7200}, "
     "\"captures\": [{\"input\": \"dancer\"}, {\"input\": \"scan_%04d.ply\", \"name\": \"horse\"}]}; "
     "what stands in defaults and captures are options of neupig run and keys of its method, "
     "and \"max-time\" and \"segments\"; paths are seen from the file; the command line wins.  "
     "Of a DIR every sub-folder is a capture; the folders of the paper's published code "
     "(point_clouds/ or gt/ in each) are understood.  "
     "Each capture gets OUT/NAME with its results, log.jsonl and verdict.json; "
     "a capture that fails does not touch the others.  "
     "What links lead out of a capture's folder is not read "
     "unless the batch says --no-confine or \"confine\": false.  "
     "A run that takes longer than --max-time is asked to stop and then killed.  "
     "Started again, what is done is left alone and what was stopped is resumed.  "
     "At the end OUT/batch.json and a table report on all captures.  "
     "Exit code 0 when all are done, 7 when all are done but some with frames skipped "
     "or below the quality bar, 1 when one is not done, 75 after a signal.",
     npg_batch_options, true, npg_verb_batch},
    {"export", "OUT --export LIST", 1, 1, "Write other formats of a finished run",
     "OUT is the output folder of a run that is done, without segments.  "
     "Formats of the list that are not there yet are made of its meshes, as the run would have made them, "
     "and done.json then lists them, too.  "
     "Broken off, the result is what it was.  Frames that are appended later make them anew.",
     npg_export_options, false, npg_verb_export},
    {"apply", "JOB --mesh FILE -o OUT", 1, 1, "Carry another mesh or points through a finished run",
     "JOB is the output folder of a run that is done.  "
     "FILE (a mesh, or points alone) lies on or near the reference.ply of the run; "
     "it is tied to that surface and written once per frame, OUT/frame_0000.ply and so on, "
     "with its own faces, colours, texture coordinates and turned normals, and OUT/done.json last of all.  "
     "An OBJ file written as OBJ keeps all its other lines: seams, polygons, groups and material names "
     "(put the material files beside).  With --fps-scale K there are K steps from each frame to the next, "
     "those between on curves through the run's meshes.  "
     "Exit code 7 when points lie far from the reference.",
     npg_apply_options, false, npg_verb_apply},
    {"probe", "INPUT", 1, 1, "Look at a capture: counts, boxes, gaps, faults, estimates",
     "Reads every frame of INPUT and says what is in it, what a run would trip over, "
     "and what it would cost in memory, disk and time.  Exit code 7 when something needs attention.  "
     "Of depth images: also, per sensor, how many it has, how much it sees of what others see, how far it lies "
     "from theirs, and how far its pose is off (with --align-sensors: was off, and what is left).",
     npg_probe_options, true, npg_verb_probe},
    {"eval", "PREDICTED TRUTH", 2, 2, "Measure a mesh sequence against a ground truth",
     "Compares the meshes of PREDICTED (a folder of meshes, or the output folder of a run) "
     "with those of TRUTH, frame by frame, and prints Chamfer distance (x 1e5), normal consistency, "
     "F-score and correspondence error; lengths are in diagonals of the first ground-truth frame's box.",
     npg_eval_options, false, npg_verb_eval},
    {"verify", "OUT...", 1, 4096, "Check that results are as they were written",
     "OUT is the output folder of run or apply.  "
     "Size and checksum of every file that its done.json lists, those of segments among them, are compared; each that "
     "is gone or has other bytes is named.  Exit code 0 when all are as they were written, 3 when one is not "
     "or there is no done.json.",
     NULL, false, npg_verb_verify},
    {"synth", "-o DIR", 0, 0, "Make a capture with an exact ground truth",
     "Writes a moving body as point clouds (DIR/points) and as meshes whose vertices keep their identity "
     "(DIR/truth).  The same options and seed give the same bytes.",
     npg_synth_options, false, npg_verb_synth},
    {"render", "FILE... -o IMAGE.png", 1, 4096, "Draw meshes or clouds to a PNG without a display",
     "Draws each FILE (a mesh or a cloud; a folder stands for its files, a rig.json for its frames) into one tile of a picture.  "
     "All tiles share one camera, so that motion shows.",
     npg_render_options, false, npg_verb_render},
    {"view", "OUT [OTHER] [-o PAGE.html]", 1, 2, "A page with the moving mesh and where it is wrong",
     "OUT is the output folder of a run.  "
     "The page is one HTML file that opens in any browser without a network: the meshes over time, "
     "coloured by vertex colours, identity, normals, error, stretch, coverage "
     "or in how many frames they were seen, "
     "the points of each frame, and a time line with the error and what the run reports.  "
     "Of two results the page shows both side by side, in one view and on one time line.  "
     "With --live the page is written anew as the frames of a run that is at work come.",
     npg_view_options, false, npg_verb_view},
    {"bench", "", 0, 0, "Time the kernels and the parts of a run",
     "Times, on a walking figure: the kernels of fits without alignment (decoder forward and backward, "
     "transform, nearest points, isometry; four frames a call), the closest points of a surface, "
     "the alignment of one frame, the joint fit of a window of frames, and Poisson.  "
     "Wall and processor time of one call, the median of several.",
     npg_bench_options, false, npg_verb_bench},
    {"doctor", "", 0, 0, "Check devices and libraries on this machine",
     "Lists the OpenCL devices and the versions of the libraries in use and compares "
     "every kernel on each device with its plain twin.  "
     "Exit code 4 when there is no device or one computes wrong.",
     npg_doctor_options, false, npg_verb_doctor},
    {"help", "[VERB|method|report|done]", 0, 1,
     "Show the verbs, the options of one, the keys of the method, or of a run's files",
     "Without VERB, lists the verbs; with one, its usage and options.  "
     "help method lists what --method of run takes, help report and help done what these files of a run hold.",
     npg_help_options, false, npg_verb_help},
    {"man", "", 0, 0, "Print the manual page",
     "Prints the manual page in roff, made from the same tables as the help.  "
     "Read it with: neupig man | man -l -",
     NULL, false, npg_verb_man},
    {"version", "", 0, 0, "Print the version", "Prints the version of neupig.", NULL, false,
     npg_verb_version},
    {0}};

/* NULL when there is none of that name. */
static const npg_verb *find_verb(const char *name)
{
    for (const npg_verb *verb = npg_verbs; verb->name; verb++)
        if (!strcmp(verb->name, name)) return verb;
    return NULL;
}

static npg_status unknown_verb(const char *name)
{
    npg_nearest nearest = npg_nearest_to(name);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++) npg_nearest_offer(&nearest, verb->name);
    if (!strcmp(name, "tune"))
        return npg_error(NPG_USAGE, "verb tune went: the set of kernel parameters is chosen by device");
    if (nearest.word)
        return npg_error(NPG_USAGE, "there is no verb \"%s\"; did you mean %s?", name, nearest.word);
    return npg_error(NPG_USAGE, "there is no verb \"%s\"; neupig help lists them", name);
}

typedef struct help_settings {
    bool all, json;
} help_settings;

/* clang-format off */
const npg_option npg_help_options[] = {
    /* type       name        place                         default */
    NPG_ROW_FLAG("help-all", offsetof(help_settings, all),  "no",
        "All options of neupig run, not only those that most need"),
    NPG_ROW_FLAG("json",     offsetof(help_settings, json), "no",
        "The same as JSON; of method, report and done a JSON schema"),
    {0}};
/* clang-format on */

npg_status npg_verb_help(const npg_cli *cli)
{
    const help_settings *s = cli->values;
    const char *subject = cli->operand_count ? cli->operands[0] : "";
    const npg_verb *verb = find_verb(subject);
    if (!*subject)
        npg_help_verbs(stdout);
    else if (!strcmp(subject, "method"))
        s->json ? npg_help_method_json() : npg_help_method();
    else if (verb)
        s->json ? npg_help_verb_json(verb) : npg_help_verb(verb, s->all);
    else if (!npg_help_file(subject, s->json))
        return unknown_verb(subject);
    return NPG_OK;
}

npg_status npg_verb_version(const npg_cli *cli)
{
    (void)cli;
    printf("neupig %s\n", npg_version());
    return NPG_OK;
}

/* Output that could not be written (a full disk, a closed pipe) is a failure too. */
static int close_stdout(int code)
{
    if (fflush(stdout) == 0 && !ferror(stdout)) return code;
    perror("neupig: standard output");
    return code ? code : npg_status_exit_code(NPG_DISK);
}

/* Have glibc return free memory to the system.  Windows take and give back arrays of many MiB beside
 * small blocks that stay, on a dozen threads.  Left alone, glibc raises the size from which a block gets its
 * own mapping with every such array that is freed (to 32 MiB), so that arrays come to lie among the
 * small blocks, and has up to eight arenas a core, each as large as the largest moment it saw: of 380 MiB of
 * heap 100 were free, and how many was a matter of which thread came to which arena.  A library must leave
 * this to its program. */
static void set_heap(void)
{
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 20); /* no longer raised */
    mallopt(M_TRIM_THRESHOLD, 4 << 20); /* with 1 MiB the same pages went and came in every frame */
    mallopt(M_ARENA_MAX, 4);
#endif
}

int main(int argc, char **argv)
{
    set_heap();
    signal(SIGXFSZ, SIG_IGN); /* then a file past ulimit -f is a failed write (5), named like any other */
    if (argc < 2) {
        npg_help_verbs(stderr);
        return npg_status_exit_code(NPG_USAGE);
    }
    static char help[] = "help", version[] = "version";
    const char *name = argv[1];
    if (!strcmp(name, "--help") || !strcmp(name, "-h")) argv[1] = help;
    if (!strcmp(name, "--version") || !strcmp(name, "-V")) argv[1] = version;
    const npg_verb *verb = find_verb(argv[1]);
    if (verb) return close_stdout(npg_cli_run(verb, argc - 1, argv + 1));
    npg_status status = unknown_verb(name);
    fprintf(stderr, "neupig: %s\n", npg_error_text());
    return npg_status_exit_code(status);
}
