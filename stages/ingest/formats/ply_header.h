/* PLY header: what the elements of a PLY file are made of. */
#ifndef NPG_PLY_HEADER_H
#define NPG_PLY_HEADER_H

#include "pipeline/source.h"

enum { NPG_PLY_ELEMENTS = 16, NPG_PLY_PROPERTIES = 128, NPG_PLY_NAME = 64 };

typedef enum npg_ply_format { NPG_PLY_ASCII, NPG_PLY_LITTLE, NPG_PLY_BIG } npg_ply_format;

typedef enum npg_ply_type {
    NPG_PLY_INT8,
    NPG_PLY_UINT8,
    NPG_PLY_INT16,
    NPG_PLY_UINT16,
    NPG_PLY_INT32,
    NPG_PLY_UINT32,
    NPG_PLY_FLOAT,
    NPG_PLY_DOUBLE
} npg_ply_type;

typedef struct npg_ply_property {
    char name[NPG_PLY_NAME];
    npg_ply_type type; /* of the value, or of a list's items */
    bool is_list;
    npg_ply_type count_type; /* lists only                                        */
    size_t offset;           /* in the row; meaningful where no list is before it */
} npg_ply_property;

typedef struct npg_ply_element {
    char name[NPG_PLY_NAME];
    uint64_t count;
    bool has_lists;
    size_t row_size; /* bytes of a binary row, lists counted as their bare length */
    size_t property_count;
    npg_ply_property properties[NPG_PLY_PROPERTIES];
} npg_ply_element;

typedef struct npg_ply_header {
    npg_ply_format format;
    size_t element_count;
    npg_ply_element elements[NPG_PLY_ELEMENTS];
} npg_ply_header;

/* Read and check the header; the source then stands at the body.  Counts are compared with the bytes that
 * follow where these are known.  NPG_END when the source is at its end before the first byte. */
npg_status npg_ply_header_read(npg_ply_header *header, npg_source *source);

size_t npg_ply_type_size(npg_ply_type type);

/* A value of a binary row. */
double npg_ply_value(const unsigned char *bytes, npg_ply_type type, npg_ply_format format);

#endif
