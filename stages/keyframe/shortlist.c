/* Shortlist: frames and candidates of the choosing pass. */
#include "keyframe/keyframe_internal.h"

#include <stdlib.h>

#include "mesh/surface.h"

#define APART  2    /* places in the choice between two candidates, at least */
#define NEARLY 0.95 /* of the most cells, that a candidate must show         */
#define STRIDE 2    /* between the frames of a long capture                  */

bool npg_shortlist_wants(int64_t index, int64_t frame_count)
{
    return llabs(index - frame_count / 2) <= NPG_SHORTLIST_REACH;
}

npg_status npg_shortlist_add(npg_shortlist *shortlist, const npg_frame *frame, size_t cell_count)
{
    npg_nearby *added = &shortlist->list[shortlist->count];
    NPG_REQUIRE(shortlist->count < sizeof shortlist->list / sizeof *shortlist->list);
    *added = (npg_nearby){.index = frame->index, .cell_count = cell_count};
    if (frame->normals && (frame->fields & NPG_FIELD_CLEAN))
        NPG_TRY(npg_cloud_contact(&added->contact, frame->pos_local, frame->normals, frame->point_count));
    shortlist->count++;
    return NPG_OK;
}

static void list_frames(npg_choice *choice, int64_t key, int64_t frame_count)
{
    int64_t stride = frame_count > NPG_CHOICE_FRAMES ? STRIDE : 1, side = NPG_CHOICE_FRAMES / 2;
    int64_t first = stride > 1 ? key - side * stride : 0;
    *choice = (npg_choice){0};
    for (int64_t i = 0; i < NPG_CHOICE_FRAMES; i++) {
        int64_t index = first + i * stride;
        if (index < 0 || index >= frame_count) continue;
        choice->is_candidate[choice->count] = index == key;
        choice->frames[choice->count++] = index;
    }
    choice->candidate_count = 1;
}

static const npg_nearby *find(const npg_shortlist *shortlist, int64_t index)
{
    for (size_t i = 0; i < shortlist->count; i++)
        if (shortlist->list[i].index == index) return &shortlist->list[i];
    return NULL;
}

/* Places to the nearest candidate so far. */
static size_t distance_to_candidates(const npg_choice *choice, size_t at)
{
    size_t least = SIZE_MAX;
    for (size_t i = 0; i < choice->count; i++) {
        size_t distance = i < at ? at - i : i - at;
        if (choice->is_candidate[i] && distance < least) least = distance;
    }
    return least;
}

/* The frame to add next; choice->count when there is none. */
static size_t next_candidate(const npg_choice *choice, const npg_shortlist *shortlist, size_t cells_least)
{
    size_t best = choice->count, best_distance = 0;
    double best_contact = 0;
    for (size_t i = 0; i < choice->count; i++) {
        const npg_nearby *frame = find(shortlist, choice->frames[i]);
        size_t distance = distance_to_candidates(choice, i);
        if (!frame || frame->cell_count < cells_least || distance < APART) continue;
        bool is_better = best == choice->count || frame->contact < best_contact ||
                         (!(frame->contact > best_contact) && distance > best_distance);
        if (!is_better) continue;
        best = i;
        best_contact = frame->contact;
        best_distance = distance;
    }
    return best;
}

void npg_shortlist_choose(npg_choice *choice, const npg_shortlist *shortlist, int64_t key,
                          int64_t frame_count, bool key_alone)
{
    size_t most = 0;
    list_frames(choice, key, frame_count);
    if (key_alone) return;
    for (size_t i = 0; i < shortlist->count; i++)
        if (shortlist->list[i].cell_count > most) most = shortlist->list[i].cell_count;
    while (choice->candidate_count < NPG_CHOICE_MAX) {
        size_t at = next_candidate(choice, shortlist, (size_t)(NEARLY * (double)most));
        if (at == choice->count) return;
        choice->is_candidate[at] = true;
        choice->candidate_count++;
    }
}
