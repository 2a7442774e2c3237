/* Random: a small generator whose numbers are the same on every machine.
 *
 * Based on: Guy Steele, Doug Lea, Christine Flood, Fast splittable pseudorandom number generators
 * (SplitMix64).  A stream is one 64-bit counter; streams of different keys are
 * independent for our purposes. */
#ifndef NPG_RANDOM_H
#define NPG_RANDOM_H

#include <math.h>
#include <stdint.h>

typedef struct npg_random {
    uint64_t state;
} npg_random;

/* The output function of SplitMix64 (David Stafford's mix 13). */
static inline uint64_t npg_random_mix(uint64_t x)
{
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* The stream of a seed and two keys (a frame, a purpose).  Its odd factors are 2^64 / g and 2^64 / g^3, g
 * = 1.2207 (x^4 = x + 1); they keep key_a = 1 apart from key_b = 1. */
static inline npg_random npg_random_stream(uint64_t seed, uint64_t key_a, uint64_t key_b)
{
    uint64_t state = npg_random_mix(seed + 0x9e3779b97f4a7c15u);
    state = npg_random_mix(state ^ (key_a * 0xd1b54a32d192ed03u + 1));
    return (npg_random){npg_random_mix(state ^ (key_b * 0x8cb92ba72f3d8dd7u + 2))};
}

/* The counter's step is 2^64 / golden ratio, as in SplitMix64. */
static inline uint64_t npg_random_bits(npg_random *random)
{
    random->state += 0x9e3779b97f4a7c15u;
    return npg_random_mix(random->state);
}

/* Uniform in [0, 1). */
static inline double npg_random_real(npg_random *random)
{
    return (double)(npg_random_bits(random) >> 11) * 0x1p-53;
}

/* Uniform in 0 .. count - 1; count >= 1.  The high half of a product (Lemire 2019, without its second
 * draw): the bias of 2^-64 x count can't be seen in any sample drawn here. */
static inline uint64_t npg_random_below(npg_random *random, uint64_t count)
{
    return (uint64_t)(((unsigned __int128)npg_random_bits(random) * count) >> 64);
}

/* Gaussian with mean 0 and deviation 1 (Box and Muller 1958; one of the pair).  u is in (0, 1], as its
 * logarithm needs; v turns by 2 pi. */
static inline double npg_random_gauss(npg_random *random)
{
    double u = 1 - npg_random_real(random), v = npg_random_real(random);
    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}

#endif
