/* Loop: keyframes, rounds and growth. */
#include "reference/loop.h"
#include "geometry/limits.h"

#include <math.h>

#define GROW_PASSES 40 /* at most */
/* Share of a frame's points that must have a place on a surface that grows: a frame that sees much more is
 * wrongly followed, and adds limbs where they are not.  In the end half, in steps, after passes that reached no
 * more frames. */
#define EXPLAINED_STEP 0.1

static void begin_with(npg_reference_loop *loop, int64_t key)
{
    loop->brief = (npg_brief){.rounds_left = loop->rounds,
                              .key = key,
                              .takes_gathered = true,
                              .keeps_gathered = true,
                              .takes_poses = true,
                              .gathers_from = INT64_MIN,
                              .gathers_to = INT64_MAX,
                              .explained_least = NPG_MOST};
    loop->grown = loop->unreached_before = loop->in_vain = 0;
    loop->bad_least = INT64_MAX;
    loop->is_limited = false;
}

npg_brief npg_reference_begin(npg_reference_loop *loop, int64_t rounds, size_t attempts)
{
    *loop = (npg_reference_loop){.rounds = rounds, .attempts = attempts};
    begin_with(loop, -1);
    return loop->brief;
}

/* Whether one count of frames is more than the other by more than a few of all. */
static bool is_more(const npg_pass_result *result, int64_t one, int64_t other)
{
    return (double)(one - other) > NPG_FEW * (double)result->frame_count;
}

/* How a reference that does not reach all frames goes on. */
static void grow(npg_reference_loop *loop, int64_t unreached)
{
    npg_brief *brief = &loop->brief;
    bool has_gained = !loop->grown || unreached < loop->unreached_before;
    bool asks_less = !has_gained && brief->explained_least > NPG_MAJORITY + EXPLAINED_STEP / 2;
    if (asks_less) brief->explained_least = fmax(brief->explained_least - EXPLAINED_STEP, NPG_MAJORITY);
    loop->in_vain = has_gained || asks_less ? 0 : loop->in_vain + 1;
    brief->leaves_open = unreached && loop->in_vain < 2 && loop->grown < GROW_PASSES;
    loop->grown += unreached > 0;
    brief->was_open = loop->grown > 0;
}

/* ---- which keyframe ---- */

/* Whether the keyframe of the pass that ended last is the best so far. */
static bool keeps_last(const npg_reference_loop *loop)
{
    return loop->kept == loop->tried_count - 1;
}

bool npg_reference_is_new(const npg_reference_loop *loop, int64_t key)
{
    size_t i = 0;
    while (i < loop->tried_count && loop->tried[i].key != key) i++;
    return key >= 0 && key != loop->brief.key && i == loop->tried_count;
}

/* Count what the keyframe of the pass that ended came to; its last word is the one that counts. */
static void note(npg_reference_loop *loop, const npg_pass_result *result)
{
    bool is_known = loop->tried_count && loop->tried[loop->tried_count - 1].key == result->key;
    loop->tried[is_known ? loop->tried_count - 1 : loop->tried_count++] = *result;
    loop->kept = 0;
    for (size_t i = 1; i < loop->tried_count; i++)
        if (loop->tried[i].bad_count < loop->tried[loop->kept].bad_count) loop->kept = i;
}

/* Of those counted none is without fault, and one is left that may be. */
static bool may_try(const npg_reference_loop *loop, int64_t next)
{
    return loop->tried[loop->kept].bad_count && loop->tried_count <= loop->attempts &&
           npg_reference_is_new(loop, next);
}

/* Whether another keyframe is to be followed before anything is made of the pass that ended.  A side of the body
 * fails by what it lacks, which growth adds: it is compared in the end. */
static bool tries_another(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_brief *brief = &loop->brief;
    if (loop->is_settled) return false;
    note(loop, result);
    if (result->is_side || result->unreached_count || !may_try(loop, result->next)) return false;
    brief->key = result->next;
    brief->is_attempt = true;
    brief->keeps_gathered = keeps_last(loop);
    brief->takes_gathered = brief->takes_poses = false;
    return true;
}

/* What follows is decided of the best keyframe's pass, whichever was the last. */
static const npg_pass_result *settle_key(npg_reference_loop *loop)
{
    const npg_pass_result *kept = &loop->tried[loop->kept];
    loop->is_settled = true;
    loop->brief.key = kept->key;
    loop->brief.is_attempt = false;
    loop->brief.takes_poses = loop->brief.keeps_gathered = keeps_last(loop);
    return kept;
}

/* ---- a side that has grown ---- */

/* A keyframe whose surface is a side of the body has grown, or stands still.  Where frames fail even with the best that
 * it came to, it lacks what no growth gave it, and another, that shows what fails, is grown in its place.  The one that
 * fails least is taken in the end: where it is one before, its passes are walked once more (their poses are stored). */
static void compare_grown(npg_reference_loop *loop, const npg_pass_result *result)
{
    if (loop->is_taken_back) return;
    note(loop, result);
    bool tries = is_more(result, loop->tried[loop->kept].bad_count, 0) &&
                 is_more(result, loop->bad_least, 0) && may_try(loop, result->next);
    if (!tries && keeps_last(loop)) return;
    loop->is_taken_back = !tries;
    begin_with(loop, tries ? result->next : loop->tried[loop->kept].key); /* from its own surface */
    loop->brief.is_attempt = true;
    loop->brief.takes_gathered = loop->brief.takes_poses = false;
}

/* ---- what comes next ---- */

/* Whether frames fail that the next reference can be hoped to explain: this one has fewer of them than any before, and
 * still some.  The best is the last that has hardly more than any: brief.is_best. */
static bool has_gained(npg_reference_loop *loop, const npg_pass_result *result)
{
    bool gains = is_more(result, loop->bad_least, result->bad_count);
    loop->brief.is_best = !is_more(result, result->bad_count, loop->bad_least);
    if (result->bad_count < loop->bad_least) loop->bad_least = result->bad_count;
    return gains && is_more(result, result->bad_count, 0);
}

/* The last one that a side has grown to does worse than one before: that is walked once more, with the poses that were
 * found for it, so that frames can contradict it, and is the reference. */
static void take_back(npg_brief *brief)
{
    brief->takes_back = brief->is_last_look = true;
    brief->trims_only = false;
    brief->rounds_left = 1;
}

static void end_taken_back(npg_brief *brief)
{
    brief->takes_back = brief->is_last_look = brief->is_best = false;
    brief->trims_only = true;
    brief->rounds_left = 0;
}

/* How the keyframe that is settled on goes on after a pass.  true: a side stands still, with nothing gained. */
static bool go_on(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_brief *brief = &loop->brief;
    /* What a side has taken from past its border was not followed yet: what other frames see through shows then. */
    bool is_whole_now =
        loop->unreached_before ? !result->unreached_count : result->is_side && !brief->is_side;
    bool gains = result->is_side && has_gained(loop, result);
    bool stands_still = result->is_side && result->has_images && !gains &&
                        !is_more(result, loop->unreached_before, result->unreached_count);
    grow(loop, result->unreached_count);
    loop->unreached_before = result->unreached_count;
    brief->rounds_left -= !brief->leaves_open && !is_whole_now && !gains;
    /* What was gathered last is followed by nothing yet that could contradict it. */
    brief->trims_only = brief->is_last_look;
    brief->is_last_look =
        !brief->is_last_look && !brief->rounds_left && result->is_side && result->has_images;
    brief->rounds_left += brief->is_last_look;
    /* A side of the body never explains all. */
    brief->is_side = result->is_side;
    brief->takes_gathered = result->is_side || !result->has_changed || loop->is_limited;
    brief->takes_poses &= brief->takes_gathered;
    if (!brief->takes_gathered && result->explained_to > result->explained_from + 1) {
        loop->is_limited = true;
        brief->gathers_from = result->explained_from;
        brief->gathers_to = result->explained_to;
        brief->rounds_left++;
    }
    if (result->is_side && result->has_images && !brief->rounds_left && !brief->is_best) take_back(brief);
    return stands_still;
}

npg_brief npg_reference_next(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_brief *brief = &loop->brief;
    if (result->is_beatable && !loop->is_compared) {
        loop->trial = *result;
        brief->compares = true;
        return *brief;
    }
    brief->takes_poses = brief->keeps_gathered = true;
    if (tries_another(loop, result)) return *brief;
    if (!loop->is_settled) result = settle_key(loop);
    brief->is_attempt = false;
    bool is_over = result->has_no_surface;
    if (brief->takes_back)
        end_taken_back(brief);
    else if (!is_over)
        is_over = go_on(loop, result);
    if (result->is_side && (!brief->rounds_left || is_over)) compare_grown(loop, result);
    return *brief;
}

npg_brief npg_reference_doubt(npg_reference_loop *loop)
{
    loop->trial.key = -1;
    loop->brief.compares = true;
    return loop->brief;
}

npg_brief npg_reference_compared(npg_reference_loop *loop, int64_t key)
{
    loop->is_compared = true;
    loop->brief.compares = false;
    if (key == loop->trial.key) return npg_reference_next(loop, &loop->trial);
    loop->brief.takes_gathered = loop->brief.takes_poses = false;
    return loop->brief;
}
