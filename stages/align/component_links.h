/* Component links: edges between the separate pieces of a surface.
 *
 * A piece that no sensor sees in a frame, an eye or what is known of a hand, has neither points nor an edge
 * to anything that has; and one that is seen but lost, a foot whose shin is too thin to be in the reference,
 * has nothing that brings it back.  So each piece hangs on the nearest other one, by few edges that count
 * where both ends are hidden, and little where they are seen (occlusion_prior.h).  Based on Prim's minimal spanning
 * tree, of pieces. */
#ifndef NPG_COMPONENT_LINKS_H
#define NPG_COMPONENT_LINKS_H

#include <stdint.h>

#include "pipeline/status.h"

/* *links: pairs (a < b) of nodes, sorted, owned by the caller; none where the edges join all nodes.  node_pos
 * (K x 3); edges (E) join the nodes of a piece.  Equal input gives equal bits.  O(K^2).  NPG_MEMORY: *links is
 * then NULL. */
npg_status npg_component_links_find(uint32_t (**links)[2], size_t *link_count, const float *node_pos,
                                    size_t node_count, const uint32_t (*edges)[2], size_t edge_count);

#endif
