/* Votes: what the frames' depth images say of the surface that is followed through them. */
#include "fuse/fuse_internal.h"

typedef struct count {
    uint32_t seen, empty; /* frames */
} count;

struct npg_votes {
    npg_arena arena;
    npg_mesh *mesh; /* counted reference */
    count *of_vert; /* V */
};

npg_status npg_votes_open(npg_votes **out, npg_mesh *mesh)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    npg_votes *v = *out;
    v->of_vert = npg_arena_take(&v->arena, mesh->vert_count, sizeof *v->of_vert);
    npg_status status = npg_arena_status(&v->arena);
    if (!status) v->mesh = npg_mesh_ref(mesh);
    if (status) npg_votes_close(out);
    return status;
}

void npg_votes_close(npg_votes **votes)
{
    if (*votes) npg_mesh_unref(&(*votes)->mesh);
    npg_object_close(votes);
}

void npg_votes_cast(npg_votes *votes, const npg_free_space *space, const float *vert_unit)
{
    for (size_t v = 0; v < votes->mesh->vert_count; v++) {
        npg_sight_kind kind = npg_free_space_look(space, vert_unit + 3 * v);
        votes->of_vert[v].seen += kind == NPG_SEEN_AT;
        votes->of_vert[v].empty += kind == NPG_SEEN_EMPTY || kind == NPG_SEEN_BESIDE;
    }
}

npg_status npg_votes_count(const npg_votes *votes, uint8_t *is_contradicted, double share)
{
    npg_mesh_neighbours near;
    NPG_TRY(npg_mesh_neighbours_open(&near, votes->mesh));
    for (size_t v = 0; v < votes->mesh->vert_count; v++) {
        double seen = votes->of_vert[v].seen, empty = votes->of_vert[v].empty;
        for (uint32_t i = near.start[v]; i < near.start[v + 1]; i++) {
            seen += votes->of_vert[near.of[i]].seen;
            empty += votes->of_vert[near.of[i]].empty;
        }
        is_contradicted[v] = empty > share * (seen + empty);
    }
    npg_mesh_neighbours_close(&near);
    return NPG_OK;
}

size_t npg_votes_memory(size_t vert_count)
{
    return vert_count * (sizeof(count) + 1);
}
