/* Block system: the normal equations of a graph's nodes, 6 unknowns each, and their solution by conjugate
 * gradients.
 *
 * Symmetric and positive; stored as 6 x 6 blocks for a fixed set of pairs of nodes. */
#ifndef NPG_BLOCK_SYSTEM_H
#define NPG_BLOCK_SYSTEM_H

#include "memory.h"

typedef struct npg_block_system npg_block_system;

/* n nodes; pairs (a < b) that may be coupled, beside each node with itself. */
npg_status npg_block_open(npg_block_system **system, size_t node_count, const uint32_t (*pairs)[2],
                          size_t pair_count);
void npg_block_close(npg_block_system **system);

/* All zero. */
void npg_block_clear(npg_block_system *system);

/* Add a term |W^(1/2) (sum_i J_i d_i - r)|^2 of `count` nodes: 3 x 6 Jacobians J_i and the symmetric 3 x 3
 * matrix W; the right side is J^T W r.  Couplings of pairs that are not in the set are left out. */
void npg_block_add(npg_block_system *system, const uint32_t *nodes, const double (*jacobians)[18],
                   size_t count, const double w[9], const double r[3]);

/* Add what another system over the same nodes and pairs has gathered. */
void npg_block_merge(npg_block_system *system, const npg_block_system *other);

/* Add `damping` times the identity to every node. */
void npg_block_damp(npg_block_system *system, double damping);

/* x (n x 6) so that the residual is at most `tolerance` of the right side, or after `iterations`.  Returns
 * the iterations taken. */
int npg_block_solve(npg_block_system *system, double *x, double tolerance, int iterations);

#endif
