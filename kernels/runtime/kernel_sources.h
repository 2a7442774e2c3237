/* The text of every .cl file, embedded by the build. */
#ifndef NPG_KERNEL_SOURCES_H
#define NPG_KERNEL_SOURCES_H

typedef struct npg_kernel_source {
    const char *name, *text; /* "mlp", the whole file; the list ends with NULL */
} npg_kernel_source;

extern const npg_kernel_source npg_kernel_sources[];

#endif
