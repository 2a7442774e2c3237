/* Plan: which frames are solved together, and in what order the solving pass reads the capture. */
#include "pipeline/plan.h"

#include <assert.h>

static int64_t min_of(int64_t a, int64_t b)
{
    return a < b ? a : b;
}
static int64_t max_of(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

/* One latent space is good for so many frames (tests/bed/decisions.md; the paper's own table has
 * CD 0.53 at 40 frames and 1.31 at 120), and windows of 24 work. */
enum { JOINT_MOST = 60, WINDOW_AUTO = 24 };

int64_t npg_plan_window_asked(int64_t option, int64_t frame_count)
{
    if (option >= 0) return option;
    return frame_count > JOINT_MOST ? WINDOW_AUTO : 0;
}

npg_plan npg_plan_append(const npg_plan *plan, int64_t frame_count)
{
    npg_plan longer = *plan;
    longer.appended_at = plan->frame_count;
    longer.first_count = plan->first_count ? plan->first_count : plan->frame_count;
    longer.frame_count = frame_count;
    return longer;
}

/* Frames as far as they are known; NPG_FRAMES_OPEN where they are not. */
static int64_t count_of(const npg_plan *plan, int64_t total)
{
    return npg_plan_is_open(plan) && total >= 0 ? total : plan->frame_count;
}

npg_window npg_plan_key_window(const npg_plan *plan, int64_t total)
{
    int64_t count = plan->first_count ? plan->first_count : count_of(plan, total);
    int64_t last = min_of(max_of(plan->key - plan->window / 2, 0) + plan->window, count) - 1;
    int64_t first = max_of(last - plan->window + 1, 0);
    return (npg_window){first, last, first, last, 0};
}

static int64_t step_of(const npg_plan *plan)
{
    return max_of(plan->window - plan->overlap, 1);
}

static int64_t windows_for(const npg_plan *plan, int64_t frames)
{
    return frames / step_of(plan) + (frames % step_of(plan) != 0);
}

int64_t npg_plan_window_count(const npg_plan *plan, int64_t total)
{
    if (plan->appended_at) return windows_for(plan, plan->frame_count - plan->appended_at);
    if (npg_plan_is_open(plan) && total < 0) return INT64_MAX;
    npg_window key = npg_plan_key_window(plan, total);
    return 1 + windows_for(plan, key.first) + windows_for(plan, count_of(plan, total) - 1 - key.last);
}

/* The windows of one direction are counted from 0. */
static npg_window backward_window(const npg_plan *plan, const npg_window *key, int64_t place, int64_t count)
{
    int64_t new_last = key->first - 1 - place * step_of(plan);
    int64_t new_first = max_of(new_last - step_of(plan) + 1, 0);
    return (npg_window){.first = new_first,
                        .last = min_of(new_first + plan->window, count) - 1,
                        .new_first = new_first,
                        .new_last = new_last,
                        .direction = -1};
}

static npg_window forward_window(const npg_plan *plan, int64_t begin, int64_t place, int64_t count)
{
    int64_t new_first = begin + place * step_of(plan),
            new_last = min_of(new_first + step_of(plan), count) - 1;
    int64_t first = new_last - plan->window + 1;
    if (plan->appended_at) first = new_first - plan->overlap;
    /* never earlier, even where it ends */
    if (npg_plan_is_open(plan)) first = new_first - min_of(plan->overlap, plan->window - 1);
    return (npg_window){max_of(first, 0), new_last, new_first, new_last, 1};
}

npg_window npg_plan_window(const npg_plan *plan, int64_t i, int64_t total)
{
    const int64_t count = count_of(plan, total);
    const npg_window key = npg_plan_key_window(plan, total);
    assert(i >= 0 && i < npg_plan_window_count(plan, total));
    if (plan->appended_at) return forward_window(plan, plan->appended_at, i, count);
    if (i == 0) return key;
    /* The direction that comes first: of an open plan nobody knows how many the forward ones are. */
    bool is_open = npg_plan_is_open(plan);
    int64_t firsts = windows_for(plan, is_open ? key.first : count - 1 - key.last);
    int64_t place = i <= firsts ? i - 1 : i - 1 - firsts;
    return (i <= firsts) == is_open ? backward_window(plan, &key, place, count)
                                    : forward_window(plan, key.last + 1, place, count);
}

int64_t npg_plan_read_count(const npg_plan *plan)
{
    return plan->frame_count - plan->appended_at;
}

int64_t npg_plan_read_before(const npg_plan *plan, int64_t i, int64_t total)
{
    npg_window window = npg_plan_window(plan, i, total), key = npg_plan_key_window(plan, total);
    bool is_open = npg_plan_is_open(plan), is_backward = window.direction < 0;
    if (plan->appended_at) return window.new_last + 1 - plan->appended_at;
    if (is_backward) return (is_open ? key.last + 1 : plan->frame_count) - window.new_first;
    return window.new_last + 1 - (is_open && window.direction ? 0 : key.first);
}

bool npg_plan_is_last_forward(const npg_plan *plan, int64_t i)
{
    npg_window window = npg_plan_window(plan, i, -1);
    return window.direction >= 0 && window.new_last == plan->frame_count - 1;
}

int64_t npg_plan_frame(const npg_plan *plan, int64_t i)
{
    npg_window key = npg_plan_key_window(plan, -1);
    assert(i >= 0 && i < npg_plan_read_count(plan));
    if (plan->appended_at) return plan->appended_at + i;
    int64_t in_key = key.last - key.first + 1;
    if (i == 0) return plan->key;
    if (plan->key + i <= key.last) return plan->key + i;
    if (i < in_key) return key.last - i;
    i -= in_key;
    if (npg_plan_is_open(plan)) return i < key.first ? key.first - 1 - i : key.last + 1 + (i - key.first);
    int64_t forward_frames = plan->frame_count - 1 - key.last;
    return i < forward_frames ? key.last + 1 + i : key.first - 1 - (i - forward_frames);
}

int64_t npg_plan_place(const npg_plan *plan, int64_t index)
{
    npg_window key = npg_plan_key_window(plan, -1);
    bool is_open = npg_plan_is_open(plan);
    if (plan->appended_at) return index - plan->appended_at;
    if (index > key.last) return is_open ? index : index - key.first;
    if (index >= plan->key) return index - plan->key;
    return index >= key.first || is_open ? key.last - index : plan->frame_count - 1 - index;
}

int64_t npg_plan_next_place(const npg_plan *plan, int64_t read, int64_t total)
{
    bool may_miss = npg_plan_is_open(plan) && total >= 0 && read > total - plan->key;
    /* frames of window 0 that the source ends before */
    return may_miss ? read + max_of(npg_plan_key_window(plan, -1).last - (total - 1), 0) : read;
}

bool npg_plan_is_read(const npg_plan *plan, int64_t index, int64_t read, int64_t total)
{
    return npg_plan_place(plan, index) < npg_plan_next_place(plan, read, total);
}

/* Windows of an open plan before those that go forward, without window 0; else all of them. */
static int64_t backward_count(const npg_plan *plan, int64_t total)
{
    return npg_plan_is_open(plan) ? windows_for(plan, npg_plan_key_window(plan, total).first)
                                  : npg_plan_window_count(plan, total) - 1;
}

bool npg_plan_is_needed_after(const npg_plan *plan, int64_t index, int64_t i, int64_t total)
{
    /* Behind the backward windows of an open plan the first of those left begins earliest. */
    int64_t count = npg_plan_window_count(plan, total), backward = backward_count(plan, total);
    for (int64_t w = i + 1; w <= backward; w++) {
        npg_window window = npg_plan_window(plan, w, total);
        if (index >= window.first && index <= window.last) return true;
    }
    int64_t next = max_of(i, backward) + 1;
    return next < count && index >= npg_plan_window(plan, next, total).first;
}
