/* Live plan: the windows of a capture whose end is not known yet. */
#include "pipeline/live_plan.h"

#include <assert.h>

static int64_t min_of(int64_t a, int64_t b)
{
    return a < b ? a : b;
}
static int64_t max_of(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

/* The last frame there can be. */
static int64_t last_of(int64_t total)
{
    return (total < 0 ? NPG_FRAMES_OPEN : total) - 1;
}

static int64_t step_of(const npg_plan *plan)
{
    return max_of(plan->window - plan->overlap, 1);
}

static npg_window key_window(const npg_plan *plan, int64_t total)
{
    int64_t last = min_of(max_of(plan->key - plan->window / 2, 0) + plan->window - 1, last_of(total));
    int64_t first = max_of(last - plan->window + 1, 0);
    return (npg_window){first, last, -1, first, last, 0};
}

static int64_t windows_for(const npg_plan *plan, int64_t frames)
{
    return frames / step_of(plan) + (frames % step_of(plan) != 0);
}

static int64_t backward_count(const npg_plan *plan, int64_t total)
{
    return windows_for(plan, key_window(plan, total).first);
}

int64_t npg_live_window_count(const npg_plan *plan, int64_t total)
{
    if (!npg_plan_is_open(plan)) return npg_plan_window_count(plan);
    if (total < 0) return INT64_MAX;
    npg_window key = key_window(plan, total);
    return 1 + windows_for(plan, key.first) + windows_for(plan, total - 1 - key.last);
}

static npg_window backward_window(const npg_plan *plan, const npg_window *key, int64_t i, int64_t total)
{
    int64_t new_last = key->first - 1 - (i - 1) * step_of(plan);
    int64_t new_first = max_of(new_last - step_of(plan) + 1, 0);
    int64_t last = min_of(new_first + plan->window - 1, last_of(total));
    return (npg_window){new_first, last, i - 1, new_first, new_last, -1};
}

static npg_window forward_window(const npg_plan *plan, const npg_window *key, int64_t i, int64_t total)
{
    int64_t place = i - windows_for(plan, key->first) - 1;
    int64_t new_first = key->last + 1 + place * step_of(plan);
    int64_t new_last = min_of(new_first + step_of(plan) - 1, last_of(total));
    int64_t first =
        new_first - min_of(plan->overlap, plan->window - 1); /* never earlier, even where it ends */
    return (npg_window){first, new_last, place ? i - 1 : 0, new_first, new_last, 1};
}

npg_window npg_live_window(const npg_plan *plan, int64_t i, int64_t total)
{
    if (!npg_plan_is_open(plan)) return npg_plan_window(plan, i);
    assert(i >= 0 && i < npg_live_window_count(plan, total));
    npg_window key = key_window(plan, total);
    if (i == 0) return key;
    return i <= windows_for(plan, key.first) ? backward_window(plan, &key, i, total)
                                             : forward_window(plan, &key, i, total);
}

int64_t npg_live_frame(const npg_plan *plan, int64_t i)
{
    if (!npg_plan_is_open(plan)) return npg_plan_frame(plan, i);
    npg_window key = key_window(plan, -1);
    int64_t in_key = key.last - key.first + 1;
    assert(i >= 0);
    if (i == 0) return plan->key;
    if (plan->key + i <= key.last) return plan->key + i;
    if (i < in_key) return key.last - i;
    i -= in_key;
    return i < key.first ? key.first - 1 - i : key.last + 1 + (i - key.first);
}

/* The inverse of npg_plan_frame(). */
static int64_t plan_place(const npg_plan *plan, int64_t index)
{
    npg_window key = npg_plan_key_window(plan);
    if (plan->appended_at) return index - plan->appended_at;
    if (index >= plan->key && index <= key.last) return index - plan->key;
    if (index < plan->key && index >= key.first) return key.last - index;
    return index > key.last ? index - key.first : plan->frame_count - 1 - index;
}

int64_t npg_live_place(const npg_plan *plan, int64_t index)
{
    if (!npg_plan_is_open(plan)) return plan_place(plan, index);
    npg_window key = key_window(plan, -1);
    if (index > key.last) return index;
    if (index >= plan->key) return index - plan->key;
    return key.last - index;
}

/* Frames of window 0 that a source ends before. */
static int64_t missing_count(const npg_plan *plan, int64_t total)
{
    return npg_plan_is_open(plan) && total >= 0 ? max_of(key_window(plan, -1).last - (total - 1), 0) : 0;
}

int64_t npg_live_next_place(const npg_plan *plan, int64_t read, int64_t total)
{
    return read > total - plan->key ? read + missing_count(plan, total) : read;
}

bool npg_live_is_read(const npg_plan *plan, int64_t index, int64_t read, int64_t total)
{
    return npg_live_place(plan, index) < npg_live_next_place(plan, read, total);
}

int64_t npg_live_read_before(const npg_plan *plan, int64_t i, int64_t total)
{
    if (!npg_plan_is_open(plan)) return npg_plan_read_before(plan, i);
    npg_window window = npg_live_window(plan, i, total), key = key_window(plan, total);
    return window.direction > 0 ? window.new_last + 1 : key.last + 1 - window.new_first;
}

/* Those are windows 1 of either side: the first that do not are followed by none. */
bool npg_live_is_first_needed_after(const npg_plan *plan, int64_t i, int64_t total)
{
    int64_t count = npg_live_window_count(plan, total);
    if (plan->appended_at) return false;
    if (npg_plan_is_open(plan)) count = min_of(count, backward_count(plan, total) + 2);
    for (int64_t w = max_of(i + 1, 1); w < count; w++)
        if (npg_live_window(plan, w, total).from == 0) return true;
    return false;
}

static bool holds(const npg_plan *plan, int64_t index, int64_t i, int64_t total)
{
    npg_window window = npg_live_window(plan, i, total);
    return index >= window.first && index <= window.last;
}

bool npg_live_is_needed_after(const npg_plan *plan, int64_t index, int64_t i, int64_t total)
{
    int64_t count = npg_live_window_count(plan, total);
    /* Behind the backward windows of an open plan the first of those left begins earliest. */
    int64_t backward = npg_plan_is_open(plan) ? backward_count(plan, total) : count - 1;
    for (int64_t w = i + 1; w <= backward; w++)
        if (holds(plan, index, w, total)) return true;
    int64_t next = max_of(i, backward) + 1;
    return next < count && index >= npg_live_window(plan, next, total).first;
}
