/* Loop: what is decided between two passes over all frames, of which each follows the reference so far and
 * gathers the points for the next one.
 *
 * The first pass is a trial of the keyframe.  Where frames fail with it, one that fails is tried as the keyframe:
 * what touches in one frame is joined in its surface, and is not in the surface of a frame where it parts.  The
 * keyframe with the fewest failures is kept, with what was gathered for it.  A reference that is one side of the
 * body lacks things that growth adds: there keyframes are compared by what they have grown to.
 *
 * One owner decides it all: how many passes there are, whether a reference that is one side of the body grows,
 * what is asked of frames that it is to reach, and whether what was gathered makes the next reference.  The
 * stages read its brief and report what a pass came to.  No thread, no file, no run: it is a function of what
 * it is told. */
#ifndef NPG_REFERENCE_LOOP_H
#define NPG_REFERENCE_LOOP_H

#include "pipeline/stage.h"

/* What a pass came to. */
typedef struct npg_pass_result {
    int64_t key;         /* index of the keyframe whose reference was followed */
    int64_t frame_count; /* of the capture; of a live source of the look-ahead */
    int64_t bad_count;   /* frames below the bar, and those that the reference does not explain; of a side,
                                which never explains all, those that it does not reach */
    int64_t unreached_count; /* frames that see too much that the reference does not have, and those beyond */
    bool has_changed;        /* it does not explain the capture to both its ends ...    */
    int64_t explained_from, explained_to; /* ... but from and to the frames of these indices */
    int64_t next;                         /* the keyframe to try where it fails; -1: none */
    bool has_no_surface;                  /* none could be made of it: the one before was followed   */
    bool is_side;     /* it is a side of the body: what it lacks says nothing of how that is joined */
    bool has_images;  /* frames can contradict it */
    bool is_beatable; /* another keyframe's reference could do better */
} npg_pass_result;

#define NPG_ATTEMPTS_MOST 5
#define NPG_GROWN_MOST    40 /* passes that a side of the body grows through */

/* How far a keyframe has come before a pass. */
typedef struct npg_reference_walk {
    npg_brief brief;         /* of the pass */
    int64_t grown;           /* passes that a side of the body has grown through   */
    int64_t unreached_least; /* the fewest that a pass has left ...                 */
    int64_t in_vain;         /* ... and passes in a row that reached no more since */
    bool is_limited;         /* the pass is for what the reference explains alone  */
    int64_t bad_least;       /* the fewest frames that failed in a pass with a side of the keyframe */
    int64_t passes, bad_after[NPG_GROWN_MOST]; /* and after each of them */
} npg_reference_walk;

/* {0} before npg_reference_begin().  Nothing to close. */
typedef struct npg_reference_loop {
    npg_reference_walk now;                       /* its brief is the last one given */
    npg_reference_walk best;                      /* before the pass with the best side of all keyframes */
    npg_pass_result tried[NPG_ATTEMPTS_MOST + 1]; /* what each keyframe came to ...        */
    size_t tried_count, kept;                     /* ... and which is the best so far */
    int64_t rounds;                               /* that each keyframe has, at least */
    size_t attempts;                              /* that may be made after the first */
    bool is_settled;  /* the keyframe is no longer in question, or only when its side has grown */
    bool is_key_back; /* a side of a keyframe before the last one was the best, and grows on */
    bool is_ending;   /* the best side is followed once more, for what frames contradict, and that is all */
    bool is_compared; /* the keyframe was chosen among candidates ... */
    npg_pass_result trial; /* ... after the pass that came to this         */
} npg_reference_loop;

/* The brief of the first pass, of `rounds` that are to gather points, with so many attempts with other keyframes
 * (NPG_ATTEMPTS_MOST at most). */
npg_brief npg_reference_begin(npg_reference_loop *loop, int64_t rounds, size_t attempts);

/* The brief of the next one.  Parts that come, go or open belong to no common surface, and hiding them in one would
 * silence the alarm: where the reference does not explain all frames, those that it explains are followed once
 * more and gathered alone, if there are three.  A side of the body grows until all frames are reached, or two passes in a row
 * that ask for the least have reached no more, and for as long as each pass leaves fewer of them below the bar; one
 * that has grown for the worse is taken back to its best.  Where more than a few frames fail in the end, or when a
 * pass gains nothing and images can tell, another keyframe is grown, for as long as it is not behind what the best had
 * come to in a pass less, and the one whose best fails least goes on from there.  What has grown, or been taken
 * from past its border by a side that reaches all, is gathered once more: the last frames that were reached had nothing
 * around them yet, and what others see through there shows when it is followed. */
npg_brief npg_reference_next(npg_reference_loop *loop, const npg_pass_result *result);

/* Whether there is such a keyframe, and it was not tried yet. */
bool npg_reference_is_new(const npg_reference_loop *loop, int64_t key);

/* The brief where another keyframe could do better before any pass has shown it. */
npg_brief npg_reference_doubt(npg_reference_loop *loop);

/* The brief after candidates were compared, where the one before asked for it: `key` is the best.  Another than was
 * tried is followed from the beginning; of the same all goes on. */
npg_brief npg_reference_compared(npg_reference_loop *loop, int64_t key);

#endif
