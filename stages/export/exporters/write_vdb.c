/* VDB writer: OUT/volumes/<prefix>_0000.vdb, the level set of every frame.
 *
 * A level set needs a closed surface: openings are covered by fans over their rims, the same in every frame.
 * The voxel is a share of the longest side of the capture's box. */
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "job/vdb_file.h"

/* A surface of two sides of the box: about six voxels around every one it crosses, stored in blocks of which
 * half are active. */
static uint64_t bytes(const npg_export_facts *facts)
{
    double cells = 2 / (facts->voxel_share * facts->voxel_share);
    return (uint64_t)((double)facts->pose_count * cells * 12);
}

static npg_status check(const npg_export_facts *facts)
{
    double voxel = facts->voxel_share * facts->longest;
    if (!(voxel > 0) || voxel >= NPG_VDB_VOXEL_MIN) return NPG_OK;
    return npg_error(
        NPG_USAGE,
        "vdb can't hold the capture: OpenVDB has no voxels below %g, and here they would be %g (vdb-voxel "
        "%g of the longest side, %g); write the meshes %.1g times as large or larger (scale)",
        NPG_VDB_VOXEL_MIN, voxel, facts->voxel_share, facts->longest, 1.1 * NPG_VDB_VOXEL_MIN / voxel);
}

static npg_status open_vdb(void *state)
{
    npg_vdb_surface *s = state;
    const npg_export_facts *facts = s->writer.facts;
    uint32_t *caps;
    size_t cap_count, size = facts->face_count * 3 * sizeof *caps;
    NPG_TRY(npg_border_caps(&caps, &cap_count, facts->vert_count, facts->faces, facts->face_count));
    s->face_count = facts->face_count + cap_count;
    npg_status status = npg_alloc_array(&s->faces, NPG_FOR_FILES, s->face_count, 3 * sizeof *s->faces);
    if (!status) memcpy(s->faces, facts->faces, size);
    if (!status && cap_count) memcpy(s->faces + 3 * facts->face_count, caps, cap_count * 3 * sizeof *caps);
    npg_release(&caps);
    return status;
}

static npg_status save(void *user, const char *path)
{
    return npg_vdb_save_surface(path, user);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    npg_vdb_surface *s = state;
    s->pose = pose;
    return npg_vdb_file_write(pose->path, NULL, save, s);
}

static void close_vdb(void *state)
{
    npg_release(&((npg_vdb_surface *)state)->faces);
}

const npg_exporter npg_exporter_vdb = {.name = "vdb",
                                       .is_surface = true,
                                       .folder = "volumes",
                                       .ending = "vdb",
                                       .state_size = sizeof(npg_vdb_surface),
                                       .check = check,
                                       .bytes = bytes,
                                       .open = open_vdb,
                                       .pose = write_pose,
                                       .close = close_vdb};
