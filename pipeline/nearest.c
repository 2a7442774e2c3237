/* The word that a mistyped one was meant to be. */
#include "pipeline/options.h"

#include <string.h>

enum { LENGTH_LIMIT = 64 };

/* Edits (insert, delete, replace) that lead from a to b; both shorter than the limit. */
static size_t edit_distance(const char *a, const char *b)
{
    size_t row[LENGTH_LIMIT + 1], b_length = strlen(b);
    for (size_t j = 0; j <= b_length; j++) row[j] = j;
    for (size_t i = 1; a[i - 1]; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= b_length; j++) {
            size_t above = row[j], best = diagonal + (a[i - 1] != b[j - 1]);
            if (above + 1 < best) best = above + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            row[j] = best;
            diagonal = above;
        }
    }
    return row[b_length];
}

/* More edits than a third of the word: not a slip of the hand. */
npg_nearest npg_nearest_to(const char *wanted)
{
    return (npg_nearest){wanted, NULL, strlen(wanted) / 3 + 2};
}

void npg_nearest_offer(npg_nearest *nearest, const char *word)
{
    if (strlen(nearest->wanted) >= LENGTH_LIMIT || strlen(word) >= LENGTH_LIMIT) return;
    size_t edits = edit_distance(nearest->wanted, word);
    if (edits >= nearest->edits) return;
    nearest->edits = edits;
    nearest->word = word;
}
