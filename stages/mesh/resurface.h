/* Resurface: Poisson again and again, until points and surface agree on which side is out.
 *
 * Where a patch of normals is on the wrong side, the surface that Poisson draws through it faces the other
 * way at many of its points: those take the surface's side and the next surface is better.  Based on: F. Hou
 * et al., Iterative Poisson Surface Reconstruction (iPSR) for Unoriented Points, 2022.  We turn normals only,
 * begin from oriented ones, and keep what fits the points best. */
#ifndef NPG_RESURFACE_H
#define NPG_RESURFACE_H

#include "mesh/poisson.h"

/* As npg_poisson(), with normals (N x 3) mended in place; *turned counts the normals whose side changed,
 * *rounds the reconstructions done. */
npg_status npg_resurface(npg_mesh **mesh, size_t *turned, int *rounds, float *normals, const float *points,
                         size_t point_count, const npg_poisson_settings *settings);

/* The same, with parts that nearly touch kept from being joined (apart.h); *moved counts the points that were
 * moved for it.  spacing: npg_cloud_spacing(). */
npg_status npg_resurface_apart(npg_mesh **mesh, size_t *moved, size_t *turned, int *rounds, float *normals,
                               const float *points, size_t point_count, double spacing,
                               const npg_poisson_settings *settings);

#endif
