/* sRGB: bytes as cameras and scanners write them, and linear light. */
#ifndef NPG_SRGB_H
#define NPG_SRGB_H

#include <math.h>
#include <stdint.h>

/* 0 .. 1 (IEC 61966-2-1). */
static inline float npg_srgb_to_linear(uint8_t byte)
{
    double value = byte / 255.0;
    return (float)(value <= 0.04045 ? value / 12.92 : pow((value + 0.055) / 1.055, 2.4));
}

#endif
