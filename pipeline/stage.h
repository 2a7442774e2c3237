/* Stage: the interface between the run and the parts of the chain.
 *
 * A stage is one const struct; stages/chain.c lists them in the order of the data's way.  Each stage in a
 * pass works in a thread of its own and talks to nothing but its npg_worker. */
#ifndef NPG_STAGE_H
#define NPG_STAGE_H

#include <jansson.h>
#include <stdatomic.h>

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/json_file.h"
#include "pipeline/mesh.h"
#include "pipeline/plan.h"
#include "pipeline/ring.h"

/* What becomes of the colours of the points. */
typedef enum npg_colour_mode { NPG_COLOUR_REFERENCE, NPG_COLOUR_FRAMES, NPG_COLOUR_NO } npg_colour_mode;

/* The options of the run itself, those that no single stage owns. */
typedef struct npg_settings {
    const char *input, *follow, *output, *device;
    const char *reference; /* the user's own mesh; "": one is to be made */
    int method, effort;    /* places of their words */
    int colour;            /* npg_colour_mode */
    int64_t seed;
    int64_t ring_capacity;  /* chunks per ring                       */
    int64_t chunk_frames;   /* frames per chunk                      */
    int64_t max_memory_mib; /* 0: no limit                           */
    bool keep_going;        /* skip frames that can't be used        */
    bool confine;           /* refuse what lies outside its folder   */
    bool pull;              /* finished frames are also to be pulled */
} npg_settings;

/* A pass is one walk of the capture through the stages that take part in it.  Of a live source the passes
 * before SOLVE walk the look-ahead, as if it were the capture; SOLVE goes on behind it. */
typedef enum npg_pass {
    NPG_PASS_MEASURE = 1, /* find count, box and sizes                */
    NPG_PASS_SCORE = 2,   /* score every frame, choose the keyframe   */
    NPG_PASS_SOLVE = 4,   /* the work itself                          */
    NPG_PASS_CHOOSE = 8,  /* after SCORE, and while brief.compares: look closer at a few frames */
    NPG_PASS_FUSE = 16    /* while facts.brief.rounds_left: all frames' points */
} npg_pass;

/* The frames that the choosing pass reads, in time order. */
#define NPG_CHOICE_FRAMES 48
#define NPG_CHOICE_MAX    5 /* candidates among them */
typedef struct npg_choice {
    size_t count, candidate_count; /* count 0: there is no choosing pass */
    int64_t frames[NPG_CHOICE_FRAMES];
    bool is_candidate[NPG_CHOICE_FRAMES]; /* may become the keyframe; plan.key is one of them */
    int64_t second; /* the candidate to try where most frames fail with the one chosen; -1: none */
    bool is_open;   /* the user has named no keyframe: where it fails, another of these frames may be tried */
    bool is_tried;  /* the key alone is read: others are compared if its pass says that one could do better */
} npg_choice;

#define NPG_VIEWPOINTS_MOST NPG_FRAME_SENSORS_MOST /* and a bit for each */

/* From where the keyframe was seen, if nobody says so (track/track.h). */
typedef struct npg_viewpoints {
    size_t count;                               /* 0 where points are hidden                              */
    double directions[3 * NPG_VIEWPOINTS_MOST]; /* unit vectors, from the cloud's middle                  */
    bool sees_hidden;                           /* more than NPG_FEW of the points no sensor can have seen */
    bool explain_bare; /* most of what has no points can't be seen from them; else there are holes         */
} npg_viewpoints;

/* Whether the frame with this index is one of the candidates. */
static inline bool npg_choice_is_candidate(const npg_choice *choice, int64_t index)
{
    for (size_t i = 0; i < choice->count; i++)
        if (choice->frames[i] == index) return choice->is_candidate[i];
    return false;
}

/* How the next pass over all frames is walked: what the reference's owner decides between passes
 * (reference/loop.h). */
typedef struct npg_brief {
    int64_t
        rounds_left; /* fusing passes that are still to be walked: each follows the reference so far through
                               all frames and gathers their points for the next one */
    bool compares;   /* a choosing pass compares candidates first: another may do better than the key tried */
    int64_t key;     /* index of the keyframe; negative: as planned */
    bool is_attempt; /* ... of which it is to be seen whether it does better than the one before */
    bool keeps_gathered; /* what the pass that ended has gathered is kept; else what the one before had */
    bool takes_gathered; /* the next reference is made from what was gathered ...   */
    bool takes_poses;    /* ... and the poses found are good to start from; else frames are followed anew */
    int64_t gathers_from, gathers_to; /* index of the first and last frame whose points are gathered */
    bool is_last_look; /* the pass is walked for what frames contradict of what was gathered last, no more */
    bool is_best;      /* no reference of this keyframe did better than the one followed: it is kept ... */
    bool takes_back;   /* ... and the next one is what was kept: those after it did worse */
    bool trims_only;   /* the next reference is the one so far, without what the frames followed contradict */
    bool is_side;      /* the reference is a side of the body, of which sensors see a part in a frame */
    bool leaves_open;  /* the next reference has what one frame saw, and is not closed over what none did */
    bool was_open;     /* such a one was made before */
    double explained_least; /* share of a frame's points that a side that bends must have places for: it is
                               followed to the last frame before one of which it has fewer                 */
} npg_brief;

/* What the stages find out about the capture as a whole.  A fact is written by its owner, the stage named,
 * and by nobody else (npg_own), before it passes on the first chunk (or ends the pass) that depends on it; the
 * rings' locks publish it downstream.  What resumes a run (begin) writes all of them, before the passes.
 * Where a live source goes on behind the look-ahead, number_min, number_max, point_count_max and bounds_local
 * are those of the look-ahead, and plan is an open one (pipeline/plan.h) in all passes. */
typedef struct npg_facts {
    /* ingest */
    bool is_live;          /* frames come once, and how many is not known before   */
    npg_origin origin;     /* world; a point of the first frame                    */
    int64_t planned_count; /* frames that the passes before SOLVE walk, from index 0: T, or the look-ahead;
                              of a live source known once they are measured                              */
    _Atomic int64_t frame_count; /* T, gaps included; -1 while a live source is open     */
    int64_t skipped_count;       /* frames left out under --missing skip or --keep-going; live: at the end */
    /* keyframe */
    size_t point_count_max;         /* of all frames, as read */
    bool has_normals;               /* all frames with points, as read */
    size_t sensor_count_max;        /* of all frames; 0: where sensors stood is not known */
    size_t view_count_max;          /* those of them whose images are known               */
    int64_t number_min, number_max; /* of all frames          */
    npg_bounds bounds_local;        /* of all usable points   */
    npg_frame_box box;
    npg_plan plan;                       /* its key is the one by score until the choosing pass has ended   */
    int64_t window_asked, overlap_asked; /* as the options say; the plan's fit the capture                  */
    npg_choice choice;                   /* what the choosing pass should look at                           */
    size_t own_verts;                    /* vertices of the user's own mesh; 0: the reference is to be made */
    /* reference */
    npg_brief brief; /* between passes */
    /* align, at the end of a fusing pass */
    int64_t
        unreached_count; /* frames that see too much that the reference does not have, and those beyond them */
    /* mesh */
    npg_mesh *reference;   /* unit coordinates, with normals; owned by the run; made anew in each fusing pass
                            and in the solving one, before the first frame is passed on */
    int64_t reference_key; /* index of the frame that it is made around */
    double unseen_share;   /* share of the reference's area that no point of its frame saw */
    npg_viewpoints viewpoints; /* of the keyframe's own surface */
    /* evaluate, at the end of a fusing pass and of the solving one; forward and backward from the keyframe */
    bool has_changed[2];   /* the reference does not explain the capture any more ... */
    int64_t changed_at[2]; /* ... from the frame of this index on                     */
    int64_t unfit_count;   /* of a fusing pass: frames below the bar ...                  */
    int64_t unfit_within;  /* ... those of them that the reference explains ...          */
    int64_t unfit_worst;   /* ... and the index of the one that is farthest below it     */
    /* job, before the first pass */
    bool is_resumed;       /* all facts above are known; only the solving pass is walked */
    int64_t resumed_read;  /* frames of the plan that need not be read again             */
    int64_t wanted_number; /* pushed frames: those with smaller numbers need not come again; else INT64_MIN */
} npg_facts;

typedef struct npg_worker npg_worker;
typedef struct npg_option npg_option; /* pipeline/options.h */
typedef struct npg_store npg_store;   /* job/store.h */

/* A fact whose type is a room's own.  The kind names its owner, a stage: nobody else can write it,
 * and it is written once in a run. */
typedef struct npg_fact_kind {
    const char *name, *owner;
    void (*release)(void *value); /* when the run closes */
} npg_fact_kind;

typedef struct npg_stage {
    const char *name, *help;
    const npg_option *options; /* may be NULL                                         */
    size_t state_size;         /* zeroed, filled from the options, then given to init */
    unsigned passes;           /* NPG_PASS_* it takes part in                         */
    uint32_t needs, gives;     /* NPG_FIELD_*, in the solving pass                    */

    /* False: under these options the stage is left out of all passes.  The state has the options,
     * nothing else is known yet.  NULL: it always takes part. */
    bool (*takes_part)(const npg_worker *worker);
    /* Before the first pass, on the run's own thread: NPG_END when there is nothing left to do and the run
     * ends well at once; with facts.is_resumed only the solving pass is walked.  Who has this hook takes part in
     * no pass, and its report stands beside those of the stages.  May be NULL. */
    npg_status (*begin)(npg_worker *worker);
    /* Take what the pass needs.  Called on the stage's own thread.  May be NULL. */
    npg_status (*init)(npg_worker *worker);
    /* Take one chunk.  Left in *chunk, it is passed on; nulled, the stage kept it (or pushed it itself).
     * The first stage of a chain is called with *chunk NULL and makes one, or returns NPG_END. */
    npg_status (*process)(npg_worker *worker, npg_chunk **chunk);
    /* The stream ended: push on what was held back.  May be NULL. */
    npg_status (*flush)(npg_worker *worker);
    /* All stages have ended the pass well, and none is closed yet; on the run's own thread, those behind first:
     * what the pass came to, and what follows from it for the next.  May be NULL. */
    npg_status (*settle)(npg_worker *worker);
    /* Free everything, after success and failure alike.  May be NULL. */
    void (*uninit)(npg_worker *worker);
    /* Bytes the stage holds at most in the solving pass, and how many chunks of them it may hold back; facts
     * up to the plan are known.  The run prints the sum before it begins.  May be NULL. */
    size_t (*memory)(const npg_worker *worker, size_t *chunks_held);
    /* Of the stage that gives NPG_FIELD_REFERENCE: how many vertices it will have at most.  Read from options
     * and facts alone, from any thread. */
    size_t (*verts_at_most)(const npg_worker *worker);
    /* Add to a state on disk what this stage must find there when the run is resumed.
     * Called from the thread that writes the state, while a stage behind that has seen the frames that are
     * written and no other; one before it may be at work on later ones, where the state is that behind the
     * first `read` frames of the plan.  May be NULL. */
    npg_status (*save)(const npg_worker *worker, npg_store *out, int64_t read);
    /* Processor seconds that the stage expects to take in a pass (CHOOSE, FUSE or SOLVE), on whatever
     * machine: the run's progress is the share of these that is done, and only their ratios matter.  Read
     * from options and facts, before the pass.  NULL: not worth counting. */
    double (*expects)(const npg_worker *worker, npg_pass pass);
    /* After all stages ended well: the last word (files that must come last).  May be NULL. */
    npg_status (*conclude)(npg_worker *worker);
    /* In the place of all passes, where begin() of another stage found that the run was done before: what is still to
     * be made of its results.  May be NULL. */
    npg_status (*again)(npg_worker *worker);
} npg_stage;

/* In the order of the data's way, NULL at the end (stages/chain.c). */
extern const npg_stage *const npg_chain[];

/* ---- what a stage may ask of its worker ---- */

void *npg_worker_state(const npg_worker *worker);
const npg_facts *npg_worker_facts(const npg_worker *worker);

/* A fact that the worker's stage owns, to be written: *npg_own(worker, unreached_count) = 3.  Of another's fact the
 * caller gets one that nobody reads, and the run fails with NPG_USAGE. */
#define npg_own(worker, fact) (&npg_worker_own_facts((worker), offsetof(npg_facts, fact), #fact)->fact)
npg_facts *npg_worker_own_facts(npg_worker *worker, size_t offset, const char *fact);

/* For begin(): all facts as an earlier run had them. */
npg_status npg_worker_restore_facts(npg_worker *worker, const npg_facts *facts);
const npg_settings *npg_worker_settings(const npg_worker *worker);
const npg_options *npg_worker_options(const npg_worker *worker);
npg_pass npg_worker_pass(const npg_worker *worker);

/* Vertices of the reference mesh; before it is known, as many as the stage that makes it may give it. */
size_t npg_worker_verts_at_most(const npg_worker *worker);

/* Whether frames have this field (NPG_FIELD_*) when they come to the worker's stage in the solving pass of
 * this run.  Can be asked in any pass. */
bool npg_worker_has_field(const npg_worker *worker, uint32_t field);

/* Write a fact of the stage's own kind, once, or again after it was taken.  The run owns the value from now
 * on, in case of failure, too. */
npg_status npg_worker_publish(npg_worker *worker, const npg_fact_kind *kind, void *value);

/* Read one: NULL while nobody has written it.  A loan for the run's whole life. */
void *npg_worker_fact(const npg_worker *worker, const npg_fact_kind *kind);

/* Read it for the last time: the caller releases the value, and the fact is gone. */
void *npg_worker_take_fact(npg_worker *worker, const npg_fact_kind *kind);

/* A latch that the run aborts when it stops or fails.  A loan for the run's whole life. */
npg_status npg_worker_open_latch(npg_worker *worker, npg_latch **latch, int64_t count);

/* What a stage keeps from pass to pass (its state is new in each): NULL until it says so.  release is called
 * on the thing when the run closes; NULL: it is one piece of memory, and npg_release()d. */
void npg_worker_keep(npg_worker *worker, void *thing, void (*release)(void *thing));
void *npg_worker_kept(const npg_worker *worker);

/* Hand a chunk to the next stage; waits while the ring is full.  Chunks of the last stage go to
 * npg_run_pull() or are freed. */
npg_status npg_worker_push(npg_worker *worker, npg_chunk **chunk);

/* For the first stage of a live run: the next chunk that npg_run_push() brought; NPG_END after
 * npg_run_finish(). */
npg_status npg_worker_feed(npg_worker *worker, npg_chunk **chunk);

/* True once the run should stop: long loops ask at least once a second and then return NPG_STOPPED. */
bool npg_worker_stopping(const npg_worker *worker);

/* The same of an npg_worker, as libraries and the parts of stages ask: their should_stop(user). */
bool npg_worker_should_stop(void *worker);

/* The output holds another job than this run's: npg_error_text() with what to do about it.  NPG_USAGE. */
npg_status npg_worker_refuse_job(const npg_worker *worker);

/* A line of the log; frame is the number of the frame it is about, -1 if none. */
void npg_worker_log(npg_worker *worker, npg_log_level level, int64_t frame, const char *format, ...)
    NPG_PRINTF(4, 5);

/* Something the user must not overlook: goes to the log as a warning and to the report's list.  With
 * `partial` the run ends with NPG_PARTIAL. */
void npg_worker_warn(npg_worker *worker, bool partial, int64_t frame, const char *format, ...)
    NPG_PRINTF(4, 5);

/* Report how far things are: `share` is that of the stage's work in this pass, which the run turns into the
 * whole run's by what all stages expect to take; in a run where none expects anything, of the whole run.
 * Fields the stage does not know are filled by the run. */
void npg_worker_progress(npg_worker *worker, const npg_progress *progress);

/* The same of a stage that goes through things one by one: `step` of `steps` are done. */
void npg_worker_step(npg_worker *worker, double share, int64_t step, int64_t steps);

/* This stage's object in the report; only this stage's thread may change it while a pass goes on. */
json_t *npg_worker_report(npg_worker *worker);

/* What this stage's report has now belongs to states on disk; what it adds later in this pass a resumed run
 * adds again. */
void npg_worker_close_report(npg_worker *worker);

/* What a resumed run must report again of what came before: warnings, whether the run is partial, and the
 * stages' reports, as they were before the solving pass or when they were closed.  One JSON object (a new
 * reference). */
json_t *npg_worker_save_reports(npg_worker *worker);
void npg_worker_restore_reports(npg_worker *worker, const json_t *saved);

/* Let every stage add to a state on disk what it needs to be resumed (npg_stage.save). */
npg_status npg_worker_save_stages(const npg_worker *worker, npg_store *out, int64_t read);

/* The whole report, for conclude(). */
json_t *npg_worker_run_report(npg_worker *worker);

#endif
