/* Bytes: numbers in the byte order that a file format asks for, on any machine. */
#ifndef NPG_BYTES_H
#define NPG_BYTES_H

#include <stdint.h>
#include <string.h>

/* The low `size` bytes of a number, least significant first; returns size. */
static inline size_t npg_put_little(unsigned char *out, uint64_t bits, size_t size)
{
    for (size_t i = 0; i < size; i++) out[i] = (unsigned char)(bits >> (8 * i));
    return size;
}

/* The same, most significant first. */
static inline size_t npg_put_big(unsigned char *out, uint64_t bits, size_t size)
{
    for (size_t i = 0; i < size; i++) out[i] = (unsigned char)(bits >> (8 * (size - 1 - i)));
    return size;
}

static inline uint32_t npg_float_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline uint64_t npg_double_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

#endif
