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

npg_window npg_plan_key_window(const npg_plan *plan)
{
    int64_t count = plan->first_count ? plan->first_count : plan->frame_count;
    int64_t size = min_of(plan->window, count);
    int64_t first = min_of(max_of(plan->key - size / 2, 0), count - size);
    return (npg_window){first, first + size - 1, -1, first, first + size - 1, 0};
}

static int64_t step_of(const npg_plan *plan)
{
    return max_of(plan->window - plan->overlap, 1);
}

static int64_t forward_count(const npg_plan *plan)
{
    int64_t rest = plan->frame_count - 1 - npg_plan_key_window(plan).last;
    return (rest + step_of(plan) - 1) / step_of(plan);
}

static int64_t backward_count(const npg_plan *plan)
{
    return (npg_plan_key_window(plan).first + step_of(plan) - 1) / step_of(plan);
}

int64_t npg_plan_window_count(const npg_plan *plan)
{
    if (plan->appended_at) return (plan->frame_count - plan->appended_at + step_of(plan) - 1) / step_of(plan);
    return 1 + forward_count(plan) + backward_count(plan);
}

static npg_window appended_window(const npg_plan *plan, int64_t i)
{
    int64_t new_first = plan->appended_at + i * step_of(plan);
    int64_t new_last = min_of(new_first + step_of(plan), plan->frame_count) - 1;
    return (npg_window){max_of(new_first - plan->overlap, 0), new_last, i - 1, new_first, new_last, 1};
}

npg_window npg_plan_window(const npg_plan *plan, int64_t i)
{
    npg_window key = npg_plan_key_window(plan);
    int64_t forward = forward_count(plan), step = step_of(plan);
    if (plan->appended_at) return appended_window(plan, i);
    if (i == 0) return key;
    if (i <= forward) {
        int64_t new_first = key.last + 1 + (i - 1) * step;
        int64_t new_last = min_of(new_first + step - 1, plan->frame_count - 1);
        int64_t first = max_of(new_last - plan->window + 1, 0);
        return (npg_window){first, new_last, i - 1, new_first, new_last, 1};
    }
    int64_t new_last = key.first - 1 - (i - forward - 1) * step;
    int64_t new_first = max_of(new_last - step + 1, 0);
    int64_t last = min_of(new_first + plan->window - 1, plan->frame_count - 1);
    return (npg_window){new_first, last, i == forward + 1 ? 0 : i - 1, new_first, new_last, -1};
}

int64_t npg_plan_read_count(const npg_plan *plan)
{
    return plan->frame_count - plan->appended_at;
}

int64_t npg_plan_read_before(const npg_plan *plan, int64_t i)
{
    npg_window window = npg_plan_window(plan, i), key = npg_plan_key_window(plan);
    if (plan->appended_at) return window.new_last + 1 - plan->appended_at;
    if (window.direction < 0) return plan->frame_count - window.new_first;
    return window.new_last + 1 - key.first;
}

bool npg_plan_is_last_forward(const npg_plan *plan, int64_t i)
{
    npg_window window = npg_plan_window(plan, i);
    return window.direction >= 0 && window.new_last == plan->frame_count - 1;
}

int64_t npg_plan_frame(const npg_plan *plan, int64_t i)
{
    npg_window key = npg_plan_key_window(plan);
    assert(i >= 0 && i < npg_plan_read_count(plan));
    if (plan->appended_at) return plan->appended_at + i;
    int64_t in_key = key.last - key.first + 1;
    if (i == 0) return plan->key;
    if (plan->key + i <= key.last) return plan->key + i;
    if (i < in_key) return key.last - i;
    i -= in_key;
    int64_t forward_frames = plan->frame_count - 1 - key.last;
    return i < forward_frames ? key.last + 1 + i : key.first - 1 - (i - forward_frames);
}
