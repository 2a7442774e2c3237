/* Weld: surface of the reference that joins what other frames hold apart, found and cut.
 *
 * The reference is followed through the other frames (candidate_clouds.c).  A frame contradicts a face when
 * it stretches the face's longest edge to twice its length and has the corners far from every point, though
 * the surface explains the frame on the whole; faces beside it that are nearly contradicted go with it.
 * Patches of faces that three frames or more contradict are cut where the surface around them lies on
 * the points, and the holes are closed in the pose that stretched the patch most, where its sides are apart.
 * Only tubes are cut, patches with two border loops or more, which takes a handle from the mesh:
 * a crease that was closed too far can't be told from a part that was followed badly, so it stays
 * (apart.h and choose.c see to those).  The result is closed and oriented where the mesh was; a cut that
 * can't be closed so, that would save little area or that would leave the mesh in pieces, is not made. */
#ifndef NPG_WELD_H
#define NPG_WELD_H

#include "align/tracker.h"

typedef struct npg_weld_cut {
    size_t patches, faces; /* cut                                                  */
    double area_share;     /* of the reference's area                              */
    size_t refused;        /* patches that other frames contradict, but left alone */
    size_t frames;         /* that the surface explains well enough to count       */
    int64_t handles; /* of the mesh before; without any there is nothing to cut, and no frame is asked */
} npg_weld_cut;

typedef struct npg_weld_settings {
    double spacing_unit; /* of the points, npg_cloud_spacing() */
    bool (*should_stop)(void *user);
    void *user;
} npg_weld_settings;

/* mesh: unit coordinates, made from clouds->list[at]; replaced when something was cut (without normals then),
 * left alone otherwise.  NPG_MEMORY, NPG_STOPPED, NPG_DIVERGED. */
npg_status npg_weld_cut_all(npg_mesh **mesh, npg_weld_cut *done, const npg_candidate_clouds *clouds,
                            size_t at, const npg_weld_settings *settings);

#endif
