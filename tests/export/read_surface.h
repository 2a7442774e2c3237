/* A level set, read as another program reads it. */
#ifndef NPG_TEST_READ_SURFACE_H
#define NPG_TEST_READ_SURFACE_H

/* Area and volume of the surface that the grid "surface" of a file stands for, and its voxel. */
#ifdef __cplusplus
extern "C"
#endif
    void
    read_surface(const char *path, double *area, double *volume, double *voxel);

#endif
