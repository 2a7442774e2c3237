/* Door of the geometry room: what tools use of it. */
#ifndef NPG_GEOMETRY_H
#define NPG_GEOMETRY_H

#include "geometry/attach.h"     /* points tied to a surface that moves (apply)               */
#include "geometry/kdtree.h"     /* nearest points (view)                                      */
#include "geometry/mesh_tools.h" /* normals, edges, areas, components, checks (synth, render) */
#include "geometry/metrics.h"    /* measures against a ground truth, samples (eval, synth)    */
#include "geometry/query.h"      /* rays (render), closest points (bench)                      */
#include "geometry/rigid.h"      /* the rotation that fits best (eval)                        */
#include "geometry/vec3.h"       /* dot and cross products, normals of faces                  */

#endif
