/* Loop: keyframes, rounds and growth. */
#include "reference/loop.h"
#include "geometry/limits.h"

#include <math.h>

/* Share of a frame's points that must have a place on a surface that grows: a frame that sees much more is
 * wrongly followed, and adds limbs where they are not.  In the end half, in steps, after passes that reached no
 * more frames. */
#define EXPLAINED_STEP 0.1

static void begin_with(npg_reference_loop *loop, int64_t key)
{
    loop->now = (npg_reference_walk){.brief = {.rounds_left = loop->rounds,
                                               .key = key,
                                               .takes_gathered = true,
                                               .keeps_gathered = true,
                                               .takes_poses = true,
                                               .is_best = loop->now.brief.is_best, /* of the pass before */
                                               .gathers_from = INT64_MIN,
                                               .gathers_to = INT64_MAX,
                                               .explained_least = NPG_MOST},
                                     .bad_least = INT64_MAX};
}

npg_brief npg_reference_begin(npg_reference_loop *loop, int64_t rounds, size_t attempts)
{
    *loop = (npg_reference_loop){.rounds = rounds, .attempts = attempts};
    begin_with(loop, -1);
    return loop->now.brief;
}

/* Whether one count of frames is more than the other by more than a few of all, which of a short capture is one. */
static bool is_more(const npg_pass_result *result, int64_t one, int64_t other)
{
    return (double)(one - other) > fmax(1, NPG_FEW * (double)result->frame_count);
}

/* How a reference that does not reach all frames goes on. */
static void grow(npg_reference_walk *now, int64_t unreached)
{
    npg_brief *brief = &now->brief;
    bool has_gained = !now->grown || unreached < now->unreached_least;
    bool asks_less = !has_gained && brief->explained_least > NPG_MAJORITY + EXPLAINED_STEP / 2;
    if (asks_less) brief->explained_least = fmax(brief->explained_least - EXPLAINED_STEP, NPG_MAJORITY);
    now->in_vain = has_gained || asks_less ? 0 : now->in_vain + 1;
    brief->leaves_open = unreached && now->in_vain < 2 && now->grown < NPG_GROWN_MOST;
    now->grown += unreached > 0;
    if (has_gained) now->unreached_least = unreached;
    brief->was_open = now->grown > 0;
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
    return key >= 0 && key != loop->now.brief.key && i == loop->tried_count;
}

/* Count what the keyframe of the pass that ended came to; a side, which can be taken back, at its best. */
static void note(npg_reference_loop *loop, const npg_pass_result *result)
{
    bool is_known = loop->tried_count && loop->tried[loop->tried_count - 1].key == result->key;
    npg_pass_result *tried = &loop->tried[is_known ? loop->tried_count - 1 : loop->tried_count++];
    *tried = *result;
    if (loop->now.bad_least < tried->bad_count) tried->bad_count = loop->now.bad_least;
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

/* The pass to come is of another keyframe than the one that ended, of which nothing is of use. */
static void set_apart(npg_brief *brief)
{
    brief->is_attempt = true;
    brief->takes_gathered = brief->takes_poses = false;
}

/* Whether another keyframe is to be followed before anything is made of the pass that ended.  A side of the body
 * fails by what it lacks, which growth adds: it is compared in the end. */
static bool tries_another(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_brief *brief = &loop->now.brief;
    if (loop->is_settled) return false;
    note(loop, result);
    if (result->is_side || result->unreached_count || !may_try(loop, result->next)) return false;
    brief->key = result->next;
    brief->keeps_gathered = keeps_last(loop);
    set_apart(brief);
    return true;
}

/* What follows is decided of the best keyframe's pass, whichever was the last. */
static const npg_pass_result *settle_key(npg_reference_loop *loop)
{
    const npg_pass_result *kept = &loop->tried[loop->kept];
    loop->is_settled = true;
    loop->now.brief.key = kept->key;
    loop->now.brief.is_attempt = false;
    loop->now.brief.takes_poses = loop->now.brief.keeps_gathered = keeps_last(loop);
    return kept;
}

/* ---- a side that has grown ---- */

/* The best side is followed once more, with the poses that were found for it. */
static void take_back(npg_reference_loop *loop)
{
    loop->now = loop->best;
    loop->now.brief.takes_back = loop->now.brief.takes_gathered = loop->now.brief.takes_poses = true;
    loop->now.brief.is_best = loop->now.brief.trims_only = false;
}

/* A keyframe whose surface is a side of the body has grown, or stands still.  Where more than a few frames fail even
 * with the best that it came to, it lacks what no growth gave it, and another, that shows what fails, is grown in its
 * place.  true: it is, or the one before, whose best fails less, grows on. */
static bool changes_key(npg_reference_loop *loop, const npg_pass_result *result)
{
    if (loop->is_key_back) return false;
    note(loop, result);
    if (is_more(result, loop->tried[loop->kept].bad_count, 0) && may_try(loop, result->next)) {
        begin_with(loop, result->next); /* from its own surface */
        set_apart(&loop->now.brief);
        return true;
    }
    if (keeps_last(loop)) return false;
    loop->is_key_back = true;
    take_back(loop);
    set_apart(&loop->now.brief);
    return true;
}

/* ---- what comes next ---- */

/* Whether frames fail that the next reference can be hoped to explain: this one has fewer of them than any before, and
 * still some.  The best is the last that has hardly more than any, of a keyframe that no other has come up to:
 * brief.is_best. */
static bool has_gained(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_reference_walk *now = &loop->now;
    const npg_pass_result *kept = &loop->tried[loop->kept];
    bool gains = is_more(result, now->bad_least, result->bad_count);
    int64_t least = result->bad_count < now->bad_least ? result->bad_count : now->bad_least;
    now->brief.is_best = !is_more(result, result->bad_count, least) &&
                         (kept->key == now->brief.key || least < kept->bad_count);
    if (now->brief.is_best) loop->best = *now;
    now->bad_least = least;
    if (now->passes < NPG_GROWN_MOST) now->bad_after[now->passes++] = least;
    return gains && is_more(result, result->bad_count, 0);
}

/* Whether another keyframe than the best is behind where that was a pass earlier: growth builds on what it has. */
static bool is_behind(const npg_reference_loop *loop, const npg_pass_result *result)
{
    const npg_pass_result *kept = &loop->tried[loop->kept];
    int64_t then = loop->now.passes - 2;
    if (then < 0 || loop->is_key_back || result->key == kept->key) return false;
    return is_more(result, loop->now.bad_least,
                   then < loop->best.passes ? loop->best.bad_after[then] : kept->bad_count);
}

/* How the keyframe that is settled on goes on after a pass.  true: a side stands still, with nothing gained, or is behind. */
static bool go_on(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_reference_walk *now = &loop->now;
    npg_brief *brief = &now->brief;
    /* What a side has taken from past its border was not followed yet: what other frames see through shows then. */
    bool is_whole_now = brief->leaves_open ? !result->unreached_count : result->is_side && !brief->is_side;
    bool gains = result->is_side && has_gained(loop, result);
    bool stands_still =
        result->has_images && !gains && !is_more(result, now->unreached_least, result->unreached_count);
    bool is_over = result->is_side && (stands_still || is_behind(loop, result));
    grow(now, result->unreached_count);
    brief->takes_back = false;
    brief->rounds_left -= !brief->leaves_open && !is_whole_now && !gains;
    /* What was gathered last is followed by nothing yet that could contradict it. */
    brief->trims_only = brief->is_last_look;
    brief->is_last_look =
        !brief->is_last_look && !brief->rounds_left && result->is_side && result->has_images;
    brief->rounds_left += brief->is_last_look;
    /* A side of the body never explains all. */
    brief->is_side = result->is_side;
    brief->takes_gathered = result->is_side || !result->has_changed || now->is_limited;
    brief->takes_poses &= brief->takes_gathered;
    if (!brief->takes_gathered && result->explained_to > result->explained_from + 1) {
        now->is_limited = true;
        brief->gathers_from = result->explained_from;
        brief->gathers_to = result->explained_to;
        brief->rounds_left++;
    }
    return is_over;
}

/* The last one that a side has grown to does worse than one before, which is the reference then ... */
static void end_with_best(npg_reference_loop *loop)
{
    take_back(loop);
    loop->now.brief.is_last_look = loop->is_ending = true;
    loop->now.brief.rounds_left = 1;
}

/* ... without what frames have contradicted. */
static npg_brief end(npg_reference_loop *loop)
{
    npg_brief *brief = &loop->now.brief;
    brief->rounds_left = brief->takes_back = brief->is_last_look = false;
    brief->trims_only = brief->takes_gathered = true;
    return *brief;
}

npg_brief npg_reference_next(npg_reference_loop *loop, const npg_pass_result *result)
{
    npg_brief *brief = &loop->now.brief;
    if (result->is_beatable && !loop->is_compared) {
        loop->trial = *result;
        brief->compares = true;
        return *brief;
    }
    brief->takes_poses = brief->keeps_gathered = true;
    if (tries_another(loop, result)) return *brief;
    if (!loop->is_settled) result = settle_key(loop);
    brief->is_attempt = false;
    if (loop->is_ending) return end(loop);
    bool is_over = result->has_no_surface || go_on(loop, result);
    if (!result->is_side || (brief->rounds_left && !is_over)) return *brief;
    if (!changes_key(loop, result) && result->has_images && !brief->rounds_left && !brief->is_best)
        end_with_best(loop);
    return *brief;
}

npg_brief npg_reference_doubt(npg_reference_loop *loop)
{
    loop->trial.key = -1;
    loop->now.brief.compares = true;
    return loop->now.brief;
}

npg_brief npg_reference_compared(npg_reference_loop *loop, int64_t key)
{
    loop->is_compared = true;
    loop->now.brief.compares = false;
    if (key == loop->trial.key) return npg_reference_next(loop, &loop->trial);
    loop->now.brief.takes_gathered = loop->now.brief.takes_poses = false;
    return loop->now.brief;
}
