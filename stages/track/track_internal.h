#ifndef NPG_TRACK_INTERNAL_H
#define NPG_TRACK_INTERNAL_H

#include <stddef.h>
#include <stdint.h>

#include "pipeline/status.h"

/* Track: what the files of the room share. */

/* Block system: the normal equations of a graph's nodes, 6 unknowns each (a turn and a move), and their
 * solution by conjugate gradients.
 *
 * Symmetric and positive; one 6 x 6 block per node and per pair of nodes of a fixed set.  Rows are gathered by
 * as many threads as there are, each node's by one, from its terms in their order. */

#define NPG_BLOCK_NODES 4 /* of a term, at most */

typedef struct npg_block_system npg_block_system;

/* |W^(1/2) (sum_k share_k (turn_k x arm_k + move_k) - right)|^2, W = across normal normal^T + along I. */
typedef struct npg_block_term {
    size_t count;
    uint32_t nodes[NPG_BLOCK_NODES]; /* none twice */
    double shares[NPG_BLOCK_NODES], arms[NPG_BLOCK_NODES][3];
    double normal[3], across, along;
    double right[3];
} npg_block_term;

/* n nodes; pairs (a < b, sorted) that may be coupled, beside each node with itself; so many terms at most. */
npg_status npg_block_open(npg_block_system **system, size_t node_count, const uint32_t (*pairs)[2],
                          size_t pair_count, size_t term_most);
void npg_block_close(npg_block_system **system);

/* The equations become the sum of these terms (N; of count 0: none).  Couplings of pairs that are not in the set
 * are left out.  Equal terms give equal bits, however many threads there are. */
npg_status npg_block_gather(npg_block_system *system, const npg_block_term *terms, size_t count);

/* x (n x 6: turn, move) so that the residual is at most `tolerance` (>= 1e-6: it works in single precision)
 * of the right side, or after `iterations`.  `damping` times the identity is added first.  Returns the
 * iterations taken. */
int npg_block_solve(npg_block_system *system, double *x, double damping, double tolerance, int iterations);

/* Component links: edges between the separate pieces of a surface.
 *
 * A piece that no sensor sees in a frame, an eye or what is known of a hand, has neither points nor an edge
 * to anything that has; and one that is seen but lost, a foot whose shin is too thin to be in the reference,
 * has nothing that brings it back.  So each piece hangs on the nearest other one, by few edges that count
 * where both ends are hidden, and little where they are seen (occlusion_prior.c).  Based on Prim's minimal spanning
 * tree, of pieces. */

/* *links: pairs (a < b) of nodes, sorted, owned by the caller; none where the edges join all nodes.  node_pos
 * (K x 3); edges (E) join the nodes of a piece.  Equal input gives equal bits.  O(K^2).  NPG_MEMORY: *links is
 * then NULL. */
npg_status npg_component_links_find(uint32_t (**links)[2], size_t *link_count, const float *node_pos,
                                    size_t node_count, const uint32_t (*edges)[2], size_t edge_count);

#endif
