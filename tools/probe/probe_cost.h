/* Cost: what a run of a capture would take in time, memory and disk. */
#ifndef NPG_PROBE_COST_H
#define NPG_PROBE_COST_H

#include "tools/probe/probe_facts.h"

typedef struct npg_cost_basis {
    size_t vertices, epochs, window;
    double decoder_flops; /* of the network: npg_cost_decoder_flops() */
    bool aligned; /* frames are aligned and fitted on the host, as they are by default; else by the network */
    bool fused;   /* the reference is made from all frames, in a pass of its own                            */
} npg_cost_basis;

typedef struct npg_estimate {
    npg_cost_basis basis;
    double memory_bytes, disk_bytes, time_s; /* memory: of the process and of Poisson's together */
    double flops;                            /* measured multiply-adds x 2 per second, all cores */
} npg_estimate;

/* Takes about 30 ms of every core, to see how fast the machine is. */
void npg_probe_estimate(npg_estimate *estimate, const npg_probe *probe, const npg_cost_basis *basis);

#endif
