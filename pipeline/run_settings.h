/* The options of the run itself, those that no single stage owns. */
#ifndef NPG_RUN_SETTINGS_H
#define NPG_RUN_SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

/* What becomes of the colours of the points. */
typedef enum npg_colour_mode { NPG_COLOUR_REFERENCE, NPG_COLOUR_FRAMES, NPG_COLOUR_NO } npg_colour_mode;

typedef struct npg_settings {
    const char *input, *follow, *output, *device;
    const char *reference; /* the user's own mesh; "": one is to be made */
    int method, colour;    /* place of its word; npg_colour_mode */
    int64_t seed;
    int64_t ring_capacity;  /* chunks per ring                       */
    int64_t chunk_frames;   /* frames per chunk                      */
    int64_t max_memory_mib; /* 0: no limit                           */
    bool keep_going;        /* skip frames that can't be used        */
    bool confine;           /* refuse what lies outside its folder   */
    bool pull;              /* finished frames are also to be pulled */
} npg_settings;

#endif
