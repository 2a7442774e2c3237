/* Poisson wire: what the library and its helper process neupig-poisson say to each other.  Plain C and C++.
 *
 * The helper reads one npg_poisson_request and N x 6 floats (position, unit normal) on standard input, then
 * writes one npg_poisson_reply, V x 3 floats, F x 3 uint32 and the 8 bytes of NPG_POISSON_END on standard
 * output.  Native byte order: both ends are one machine.  Words on standard error are for the error text.
 * Exit code 0 done, 3 the request makes no sense, 6 no memory, anything else failed. */
#ifndef NPG_POISSON_WIRE_H
#define NPG_POISSON_WIRE_H

#include <stdint.h>

#define NPG_POISSON_ASK    "NPGPOIS2"
#define NPG_POISSON_ANSWER "NPGMESH1"
#define NPG_POISSON_END    "NPGDONE1"

#define NPG_POISSON_THREADS 2

typedef struct npg_poisson_request {
    char magic[8]; /* NPG_POISSON_ASK */
    uint64_t point_count;
    uint64_t memory_limit; /* bytes of address space; 0: none */
    uint64_t cpu_limit_s;  /* of all its threads; 0: none     */
    uint32_t depth;
    float point_weight;
} npg_poisson_request;

typedef struct npg_poisson_reply {
    char magic[8]; /* NPG_POISSON_ANSWER */
    uint64_t vert_count, face_count;
} npg_poisson_reply;

#endif
