/* Chunk: a few consecutive frames on their way through the stages; counted references,
 * one owner per reference.
 *
 * A stage may change a chunk only while it holds the only reference.
 * A function that takes npg_chunk ** nulls the pointer when it has taken the reference;
 * a pointer that is not NULL afterwards is still the caller's. */
#ifndef NPG_CHUNK_H
#define NPG_CHUNK_H

#include <stdbool.h>

#include "pipeline/memory.h"
#include "pipeline/store.h"

/* What a frame carries.  Stages say which fields they need and give;
 * the chain is checked when it is built. */
enum {
    NPG_FIELD_POINTS = 1 << 0,    /* pos_local                                */
    NPG_FIELD_CLEAN = 1 << 1,     /* pos_local holds only usable points       */
    NPG_FIELD_KEY = 1 << 2,       /* run facts: box, keyframe and order known */
    NPG_FIELD_REFERENCE = 1 << 3, /* run facts: the reference mesh            */
    NPG_FIELD_VERTICES = 1 << 4,  /* vert_unit                                */
    NPG_FIELD_POSE = 1 << 6,      /* vert_unit, coarsely aligned              */
    NPG_FIELD_FIGURES = 1 << 5    /* figures                                  */
};

#define NPG_FRAME_SENSORS_MOST 64 /* far above any rig; a sensor's index is a byte */

/* What the outlier stage did to a frame, in points. */
typedef struct npg_cleaning {
    size_t read, not_finite, duplicate, isolated, thinned;
    size_t normals_given, normals_flipped, normals_estimated;
} npg_cleaning;

/* Where the surface fails in one place, and not a little everywhere (stages/evaluate/misfit.c). */
enum { NPG_MISFIT_FAR, NPG_MISFIT_UNSUPPORTED, NPG_MISFIT_STRETCHED, NPG_MISFIT_VACATED, NPG_MISFITS };
typedef struct npg_misfit {
    double share; /* of the points, or of the surface, in the largest such place; NaN: not measured */
    double at[3]; /* its middle, in world coordinates; NaN where there is none                      */
} npg_misfit;

/* What is wrong with a frame: of itself, and beside the others of its capture (stages/evaluate/verdict.c). */
enum {
    NPG_FAULT_NONE,
    NPG_FAULT_MEDIAN,
    NPG_FAULT_P95,
    NPG_FAULT_COVERAGE,
    NPG_FAULT_FLIPPED,
    NPG_FAULT_STRETCHED,
    NPG_FAULT_UNSUPPORTED,
    NPG_FAULT_NOWHERE,
    NPG_FAULT_LOST,
    NPG_FAULT_UNCOVERED,
    NPG_FAULT_DISTANCE,
    NPG_FAULT_TORN,
    NPG_FAULT_JUMP,
    NPG_FAULTS
};
enum { NPG_MARKS = 8 };

/* How well a frame's surface explains its points.  Distances are in diagonals of the figure
 * (npg_frame_box). */
typedef struct npg_figures {
    double point_dist_median, point_dist_mean, point_dist_p95; /* points -> surface */
    double vertex_dist_mean;                                   /* surface vertices -> nearest point */
    double coverage;        /* share of the surface area in sight with points near it, 0..1 */
    double flipped_share;   /* faces turned over against their neighbourhood's rotation, share by area */
    double stretched_share; /* faces whose area is > 10 x or < 0.1 x that of the reference, by area */
    double edge_change;     /* mean |length / reference length - 1| */
    double chamfer;         /* 0.5 (mean d^2 points->surface + mean d^2 vertices->points), x 1e5 */
    /* Share of the area that no points are near, of this frame or of those that the reference was made from
     * (NaN without npg_mesh.vert_unseen); the middle of its largest part, world (NaN where there is none) */
    double unsupported_share, unsupported_at[3];
    /* Of the area, before what depth images show or outside of its outline, whichever is more; NaN without any. */
    double nowhere_share;
    double lost_share; /* of the points, farther from the surface than these images are sure of; as above */
    npg_misfit misfits[NPG_MISFITS];
    float marks[3 * NPG_MARKS]; /* vertices far from each other, the same in all frames; unit coordinates
                                   in diagonals; NaN: not measured */
    int fault;                  /* NPG_FAULT_* of the frame by itself */
    bool good;                  /* the frame is above the quality bar */
} npg_figures;

/* What the depth image of one sensor says of the space before it: how far ahead nothing is, on a small grid of
 * directions (stages/geometry/free_space.c). */
#define NPG_VIEW_SIDE 160 /* cells along its longer side, at most: two or four pixels each of usual cameras */
typedef struct npg_depth_view {
    double to_sensor[12];   /* [R | t], local to the sensor's axes: x right, y down, z ahead              */
    double first[2], step;  /* x / z and y / z where the first cell begins, and the side of a cell        */
    uint32_t width, height; /* 0: there was no image                                                      */
    size_t at;              /* where its cells begin in npg_frame.view_cells, row by row: the least depth
                               that was measured in one, local units; infinite: nothing is there as far as
                               sensors see; 0: not known                                                   */
} npg_depth_view;

typedef struct npg_frame {
    int64_t index;   /* place in time: 0 is the first frame of the run, gaps count             */
    int64_t number;  /* the number in its file's name (or pushed), = index where there is none */
    char *path;      /* where it came from, for messages; owned, may be NULL                   */
    uint32_t fields; /* NPG_FIELD_* of this frame                                              */
    bool is_key, is_skipped, is_held;
    bool is_shared;        /* belongs to a neighbouring segment: measured, not judged */
    size_t point_count;    /* N                                                       */
    float *pos_local;      /* N x 3, owned; world - origin                            */
    float *normals;        /* N x 3, owned, unit length, or NULL                      */
    uint8_t *colours;      /* N x 4 RGBA, sRGB; alpha 0: not known; owned, or NULL    */
    uint8_t *sensors;      /* N: index of the sensor that saw it; owned, or NULL      */
    uint8_t *isolated;     /* N: not 0: it lies apart, and no surface is made of it; owned, or NULL */
    bool has_sure_normals; /* they face the sensor that saw them: no side is open  */
    size_t sensor_count;   /* S, 0: where sensors stood is not known                  */
    float *sensor_local;   /* S x 3, owned, world - origin; NaN: it saw nothing, or NULL */
    npg_depth_view *views; /* S, owned: of sensors whose images are known, or NULL         */
    float *view_cells;     /* owned                                                        */
    size_t view_cell_count;
    npg_cleaning cleaning;
    size_t vert_count;     /* V                                                         */
    float *vert_unit;      /* V x 3, owned; the deformed reference, in unit coordinates */
    uint8_t *vert_colours; /* V x 4, owned: as this frame saw them, or NULL */
    npg_figures figures;
} npg_frame;

typedef struct npg_chunk npg_chunk;

/* An empty chunk with room for capacity frames. */
npg_status npg_chunk_open(npg_chunk **chunk, size_t capacity);
void npg_chunk_close(npg_chunk **chunk);

size_t npg_chunk_count(const npg_chunk *chunk);
size_t npg_chunk_capacity(const npg_chunk *chunk);
npg_frame *npg_chunk_frame(npg_chunk *chunk, size_t i);

/* Move *frame (its arrays with it) to the end of the chunk; *frame is emptied.  The chunk must have room. */
void npg_chunk_add(npg_chunk *chunk, npg_frame *frame);

/* Free what a frame owns and empty it. */
void npg_frame_clear(npg_frame *frame);

/* Where its points were seen from is not known any more. */
void npg_frame_forget_sensors(npg_frame *frame);

/* The arrays that a frame owns: what it is copied, kept on disk and freed by. */
enum { NPG_FRAME_ARRAYS = 10 };
void npg_frame_arrays(npg_store_array list[NPG_FRAME_ARRAYS], const npg_frame *frame);

/* The frame without its arrays, which stay its own. */
npg_frame npg_frame_bare(const npg_frame *frame);

/* A copy with its own arrays. */
npg_status npg_frame_copy(npg_frame *out, const npg_frame *frame);

/* Keep the points whose keep[i] is not 0, in order, with all that they carry. */
void npg_frame_keep(npg_frame *frame, const uint8_t *keep);

#endif
