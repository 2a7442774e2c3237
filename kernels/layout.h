/* Layout: how data lies in device buffers, for kernels (.cl) and host code (.c) alike.
 *
 * Read by both: the C files include it, and the build puts its text before the text of every kernel
 * (CMakeLists.txt), so it holds nothing but numbers and formulas.  Changing a number alone is not enough
 * where the kernels' code has it in its types, as float16 for NPG_LANES. */
#ifndef NPG_LAYOUT_H
#define NPG_LAYOUT_H

/* ---- points and boxes ---- */

/* Points and vertices lie in blocks of 16, coordinate by coordinate: [block][3][16].  16 floats are the
 * widest vector of OpenCL and of AVX-512, so one instruction does the same for 16 neighbours, and a block
 * is three whole cache lines.  The last block is padded with repeats of the last point; a search that
 * finds one of them has found that point. */
#define NPG_LANES       16
#define NPG_POINT_BLOCK (3 * NPG_LANES) /* floats of a block of points: 48 */

/* Boxes lie in blocks of 16, too: [block][6][16], low x, y, z, high x, y, z. */
#define NPG_BOX_BLOCK (6 * NPG_LANES) /* floats of a block of boxes: 96 */

/* Blocks that so many points or boxes take; and the points with the padding. */
#define NPG_BLOCKS(count) (((count) + NPG_LANES - 1) / NPG_LANES)
#define NPG_PADDED(count) (NPG_BLOCKS(count) * NPG_LANES)

/* Where the x of point i lies; its y and z are NPG_LANES and 2 NPG_LANES further on. */
#define NPG_POINT_AT(i) ((size_t)((i) / NPG_LANES) * NPG_POINT_BLOCK + (size_t)((i) % NPG_LANES))

/* ---- searches (nearest, chamfer) ---- */

/* The ints that describe one search of one frame, a slot: */
#define NPG_SLOT             8
#define NPG_SLOT_QUERIES     0 /* how many points are looked for ...         */
#define NPG_SLOT_QUERY_BLOCK 1 /* ... and their first block                  */
#define NPG_SLOT_POINTS      2 /* how many points there are to be found ...  */
#define NPG_SLOT_POINT_BLOCK 3 /* ... and their first block: the leaves      */
#define NPG_SLOT_BOX_BLOCK   4 /* the first block of their boxes             */
#define NPG_SLOT_RESULT      5 /* where the first answer goes; 6 and 7 are 0 */

/* ---- grid features (latent, sobolev) ---- */

/* Features of a grid node, and of a vertex: two vectors of 16. */
#define NPG_LATENT_CHANNELS 32

/* The channels [first, end) that a node has, in one int. */
#define NPG_CHANNEL_RANGE(first, end) ((first) | (end) << 8)
#define NPG_CHANNEL_FIRST(range)      ((range)&255)
#define NPG_CHANNEL_END(range)        ((range) >> 8)

/* The ints that describe one grid to the solve: */
#define NPG_GRID        4
#define NPG_GRID_NODES  0 /* n, nodes per axis; 0: the level is copied                 */
#define NPG_GRID_ROW    1 /* its first node in the table of features                   */
#define NPG_GRID_LINE   2 /* its first line: a row of nodes along the axis of the pass */
#define NPG_GRID_MATRIX 3 /* where its n x n matrix begins                             */

/* ---- the decoder (mlp) ---- */

/* Matrices lie in panels of 32 columns, [panel][row][32], so that the operands of the inner products are
 * contiguous: two vectors of 16 are what the widest register tile takes from a row. */
#define NPG_PANEL 32

/* Floats of the decoder's output for a vertex: 8, so one vector, of which four of rotation and three of
 * translation are used.  The rows of its last weights have 16 columns, zero from the eighth on. */
#define NPG_MLP_OUT      8
#define NPG_MLP_USED     7
#define NPG_MLP_HEAD_ROW 16

#endif
