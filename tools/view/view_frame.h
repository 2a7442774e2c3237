/* Frame: meshes and points of a result as blocks of bytes for the page.
 *
 * A group block (frames that are packed together), little-endian:
 *
 *     f64 origin[3], step        the grid of its positions; points lie on one NPG_VIEW_POINT_STEP times as
 *     wide u32 frames, bytes of positions, of errors, of points
 *     u32 points of each frame
 *     positions                  per frame x of all vertices, then y, z: of the first frame, of later ones
 *                                the change since the one before; predicted and packed (view_codec.h)
 *     errors                     per frame 0 to 255, per vertex the distance to the nearest point:
 *                                d = (value / 255)^2 x NPG_VIEW_ERROR_MAX diagonals; predicted and packed.
 *                                255 is that or more, all of a frame is 0 without points
 *     points                     per frame x, then y, z, in the order of a space-filling curve, each as the
 *                                change since the point before; packed
 *
 * A frame without a mesh has the positions of the one before it.
 *
 * A part block, what is the same in all its frames:
 *
 *     u32 vertices, faces
 *     f64 origin[3], step        of the reference
 *     u32 bytes of faces, of the reference, of colours, of the counts
 *     faces                      corners, each as the change since the one before; packed
 *     reference                  as the positions of a first frame
 *     colours                    red of all vertices, then green, blue; predicted and packed; 0 bytes: none
 *     counts                     in how many frames a point covers the vertex; predicted and packed; 0 bytes:
 *                                not known */
#ifndef NPG_VIEW_FRAME_H
#define NPG_VIEW_FRAME_H

#include "tools/view/view_result.h"

#define NPG_VIEW_POINT_STEP 16
#define NPG_VIEW_ERROR_MAX  0.05

/* Works through the frames of a part. */
typedef struct npg_view_frames {
    const npg_view_part *part; /* loan */
    size_t point_limit;        /* points of a frame that are shown; all are measured from */
    float *vert_pos;           /* V x 3 of the frame at hand, owned                       */
    float *points, *some;      /* N x 3, and those shown; owned                           */
    size_t point_count, point_capacity, some_capacity;
    int32_t *seen;         /* V, owned                                                */
    uint8_t *colours;      /* V x 3 of the first mesh that has any, owned, or NULL    */
    size_t without_points; /* frames whose points could not be read                   */
    size_t with_points;
    char why[512]; /* ... why not, of the first                               */
} npg_view_frames;

npg_status npg_view_frames_open(npg_view_frames *frames, const npg_view_part *part, size_t point_limit);
void npg_view_frames_close(npg_view_frames *frames);

/* Append the block of the frames first .. first + count - 1 of the part.  NPG_BAD_INPUT names a mesh that is
 * damaged or not of the reference. */
npg_status npg_view_group_block(npg_bytes *out, npg_view_frames *frames, size_t first, size_t count);

/* Append the part's block; with_counts: all frames have been through npg_view_group_block(). */
npg_status npg_view_part_block(npg_bytes *out, const npg_view_frames *frames, bool with_counts);

#endif
