/* False bridge: the votes of the frames, gathering patches, cutting and closing. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"

#define LONGER          2.0 /* times its length: an edge that speaks against its face              */
#define FAR_SPACINGS    1.0 /* of a face's corners from the points; of a voting frame's from it, at most */
#define NEARLY_LONGER   1.4 /* the same, for faces that go with those beside them        */
#define NEARLY_SPACINGS 0.6
#define FRAMES_LEAST    3    /* that speak against a face                                             */
#define SEEDS_LEAST     2    /* faces of a patch that are spoken against                              */
#define LOOPS_LEAST     2    /* of its border: a tube between two parts; a cap or a crease is left    */
#define ISLAND_MOST     0.02 /* of the faces: a piece of the rest that belongs to the patch around it */
#define PATCH_MOST      0.2  /* of the faces: more is no false bridge but a surface that fits nowhere */

static const npg_tracker_settings bridge_tracking = {
    .nodes = 250, .samples = 2000, .steps = 12, .stiffness = 0.0005, .along = 0.1};

typedef struct ballot {
    const npg_bridge_settings *settings;
    const npg_mesh *mesh;
    uint8_t *against; /* F: frames that speak against a face          */
    uint8_t *nearly;  /* F: frames that do so or nearly               */
    float *poses;     /* frames x V x 3: the mesh in the voting frames */
    size_t frames, room;
    float *dist_sq; /* V */
    uint32_t *near; /* V */
    npg_arena arena;
} ballot;

/* ---- what a frame says ---- */

static double edge_growth(const float *rest, const float *now, size_t a, size_t b)
{
    double before = npg_vec3_distance(rest + 3 * a, rest + 3 * b);
    return before > 0 ? npg_vec3_distance(now + 3 * a, now + 3 * b) / before : 0;
}

/* Count what a frame says of a face: `against`, and with half the distance and less growth, `nearly`. */
static void count_face(ballot *b, size_t f, const float *now)
{
    const uint32_t *face = b->mesh->faces + 3 * f;
    double growth = 0, dist = 0;
    for (int k = 0; k < 3; k++) {
        growth = fmax(growth, edge_growth(b->mesh->vert_pos, now, face[k], face[(k + 1) % 3]));
        dist += sqrt((double)b->dist_sq[face[k]]) / 3;
    }
    dist /= b->settings->spacing_unit;
    b->against[f] += growth >= LONGER && dist > FAR_SPACINGS;
    b->nearly[f] += growth >= NEARLY_LONGER && dist > NEARLY_SPACINGS;
}

static npg_status vote(void *user, const npg_candidate_cloud *cloud, const float *vert_unit,
                       const npg_tracked *tracked)
{
    ballot *b = user;
    size_t v = b->mesh->vert_count;
    if (b->settings->should_stop && b->settings->should_stop(b->settings->user))
        return npg_error(NPG_STOPPED, "stopped while false bridges were looked for");
    if (tracked->point_dist_mean > FAR_SPACINGS * b->settings->spacing_unit || b->frames == b->room)
        return NPG_OK;
    NPG_TRY(npg_points_nearest(b->near, b->dist_sq, cloud->points, cloud->point_count, vert_unit, v, 1));
    for (size_t f = 0; f < b->mesh->face_count; f++) count_face(b, f, vert_unit);
    memcpy(b->poses + b->frames++ * v * 3, vert_unit, v * 3 * sizeof(float));
    return NPG_OK;
}

static npg_status open_ballot(ballot *b, size_t room)
{
    size_t v = b->mesh->vert_count;
    b->room = room;
    b->against = npg_arena_take(&b->arena, b->mesh->face_count, 1);
    b->nearly = npg_arena_take(&b->arena, b->mesh->face_count, 1);
    b->dist_sq = npg_arena_take(&b->arena, v, sizeof *b->dist_sq);
    b->near = npg_arena_take(&b->arena, v, sizeof *b->near);
    b->poses = npg_arena_take(&b->arena, room * v, 3 * sizeof *b->poses);
    return npg_arena_status(&b->arena);
}

/* ---- patches ---- */

#define NO_PATCH UINT32_MAX

typedef struct patches {
    uint8_t *is_in;    /* F: the faces spoken against and those around them */
    uint8_t *is_near;  /* V: scratch                                        */
    uint32_t *of_vert; /* V: patch of a vertex of such faces, NO_PATCH      */
    uint32_t *of_face; /* F                                                 */
    size_t count;
    npg_arena arena;
} patches;

/* Take in all faces that share a vertex with those that are in. */
static void widen(patches *p, const npg_mesh *mesh)
{
    memset(p->is_near, 0, mesh->vert_count);
    for (size_t i = 0; i < 3 * mesh->face_count; i++)
        if (p->is_in[i / 3]) p->is_near[mesh->faces[i]] = 1;
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        p->is_in[f] = p->is_near[face[0]] || p->is_near[face[1]] || p->is_near[face[2]];
    }
}

/* Copy the faces that are in (or those that are not), and number their components: F x 3 and V.  Returns how
 * many faces those are in *count. */
static npg_status join_faces(uint32_t *some, uint32_t *component, size_t *count, const patches *p,
                             const npg_mesh *mesh, bool are_in)
{
    size_t components;
    *count = 0;
    for (size_t f = 0; f < mesh->face_count; f++)
        if (p->is_in[f] == are_in) memcpy(some + 3 * (*count)++, mesh->faces + 3 * f, 3 * sizeof *some);
    return npg_mesh_components(component, &components, mesh->vert_count, some, *count);
}

static void set_patches(patches *p, const npg_mesh *mesh, const uint32_t *some, size_t count,
                        uint32_t *component)
{
    size_t v = mesh->vert_count;
    for (size_t i = 0; i < v; i++) p->of_vert[i] = NO_PATCH;
    for (size_t i = 0; i < 3 * count; i++) p->of_vert[some[i]] = component[some[i]];
    /* components count lone vertices, too: number those of faces from 0 on */
    memset(component, 0xff, v * sizeof *component);
    for (size_t i = 0; i < v; i++) {
        uint32_t *patch = &p->of_vert[i];
        if (*patch == NO_PATCH) continue;
        if (component[*patch] == NO_PATCH) component[*patch] = (uint32_t)p->count++;
        *patch = component[*patch];
    }
    for (size_t f = 0; f < mesh->face_count; f++)
        p->of_face[f] = p->is_in[f] ? p->of_vert[mesh->faces[3 * f]] : NO_PATCH;
}

/* Number the patches: faces that are in and connected by vertices. */
static npg_status number_patches(patches *p, const npg_mesh *mesh)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    uint32_t *some = npg_arena_take(&scratch, mesh->face_count, 3 * sizeof *some);
    uint32_t *component = npg_arena_take(&scratch, mesh->vert_count, sizeof *component);
    size_t count;
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = join_faces(some, component, &count, p, mesh, true);
    if (!status) set_patches(p, mesh, some, count, component);
    npg_arena_release(&scratch);
    return status;
}

/* Take in what is left inside a patch: pieces of the rest that are small. */
static npg_status take_islands(patches *p, const npg_mesh *mesh)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    uint32_t *rest = npg_arena_take(&scratch, mesh->face_count, 3 * sizeof *rest);
    uint32_t *component = npg_arena_take(&scratch, mesh->vert_count, sizeof *component);
    size_t *size = npg_arena_take(&scratch, mesh->vert_count, sizeof *size), count = 0;
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = join_faces(rest, component, &count, p, mesh, false);
    for (size_t f = 0; f < count && !status; f++) size[component[rest[3 * f]]]++;
    for (size_t f = 0; f < mesh->face_count && !status; f++)
        if (!p->is_in[f] &&
            (double)size[component[mesh->faces[3 * f]]] < ISLAND_MOST * (double)mesh->face_count)
            p->is_in[f] = 1;
    npg_arena_release(&scratch);
    return status;
}

/* Where a border passes a vertex twice, take in all faces around it.  Returns how many such
 * vertices there were. */
static size_t take_pinches(patches *p, const npg_mesh *mesh, const uint32_t *twin)
{
    size_t pinches = 0;
    memset(p->is_near, 0, mesh->vert_count);
    for (size_t i = 0; i < 3 * mesh->face_count; i++) {
        if (!p->is_in[i / 3] || twin[i] == UINT32_MAX || p->is_in[twin[i] / 3]) continue;
        pinches += p->is_near[mesh->faces[i]] == 1;
        if (p->is_near[mesh->faces[i]] < 2) p->is_near[mesh->faces[i]]++;
    }
    for (size_t i = 0; i < 3 * mesh->face_count; i++)
        if (p->is_near[mesh->faces[i]] == 2) p->is_in[i / 3] = 1;
    return pinches;
}

/* Make the borders simple loops. */
static npg_status tidy(patches *p, const npg_mesh *mesh)
{
    uint32_t *twin;
    NPG_TRY(npg_alloc_array(&twin, NPG_FOR_MESH, mesh->face_count, 3 * sizeof *twin));
    npg_status status = npg_mesh_twins(twin, mesh->faces, mesh->face_count);
    do { /* ends: each pinch takes faces in */
        if (!status) status = take_islands(p, mesh);
    } while (!status && take_pinches(p, mesh, twin));
    npg_release(&twin);
    return status;
}

static npg_status gather(patches *p, const ballot *b)
{
    const npg_mesh *mesh = b->mesh;
    size_t seeds = 0;
    p->is_in = npg_arena_take(&p->arena, mesh->face_count, 1);
    p->is_near = npg_arena_take(&p->arena, mesh->vert_count, 1);
    p->of_vert = npg_arena_take(&p->arena, mesh->vert_count, sizeof *p->of_vert);
    p->of_face = npg_arena_take(&p->arena, mesh->face_count, sizeof *p->of_face);
    NPG_TRY(npg_arena_status(&p->arena));
    for (size_t f = 0; f < mesh->face_count; f++) {
        seeds += b->against[f] >= FRAMES_LEAST;
        p->is_in[f] = b->nearly[f] >= FRAMES_LEAST;
    }
    if (!seeds) return NPG_OK;
    widen(p, mesh);
    NPG_TRY(tidy(p, mesh));
    return number_patches(p, mesh);
}

/* ---- one patch ---- */

/* The pose in which the patch is largest, and its area there. */
static double worst_pose(const float **pose, const ballot *b, const patches *p, uint32_t patch)
{
    double worst = -1;
    for (size_t i = 0; i < b->frames; i++) {
        const float *at = b->poses + i * b->mesh->vert_count * 3;
        double area = 0;
        for (size_t f = 0; f < b->mesh->face_count; f++)
            if (p->of_face[f] == patch) area += npg_face_area(at, b->mesh->faces + 3 * f);
        if (!(area > worst)) continue;
        worst = area;
        *pose = at;
    }
    return worst;
}

/* next[v] = the vertex after v on the patch's border, in the direction of the patch's own faces; all of them
 * once.  False where the border is no set of simple loops. */
static bool link_border(uint32_t *next, const npg_mesh *mesh, const patches *p, uint32_t patch,
                        const uint32_t *twin)
{
    bool found = false;
    for (size_t i = 0; i < 3 * mesh->face_count; i++) {
        if (p->of_face[i / 3] != patch) continue;
        if (twin[i] == UINT32_MAX) return false; /* a border of the mesh */
        if (p->of_face[twin[i] / 3] == patch) continue;
        uint32_t from = mesh->faces[i], to = mesh->faces[i - i % 3 + (i + 1) % 3];
        if (next[from] != UINT32_MAX) return false;
        next[from] = to;
        found = true;
    }
    return found;
}

typedef struct cutting {
    const ballot *ballot;
    const patches *patches;
    npg_arena arena;
    uint32_t *twin, *next, *loop; /* 3 F, V, V */
    uint8_t *is_cut;              /* F         */
    uint32_t (*edges)[2];         /* owned     */
    size_t edge_count;
    uint32_t *new_faces; /* owned */
    size_t new_count, new_capacity;
} cutting;

/* Fill every loop of the border; *area of all. */
static npg_status fill_loops(cutting *c, double *area, size_t *loop_count, bool *is_filled, const float *pose)
{
    const npg_mesh *mesh = c->ballot->mesh;
    *area = 0;
    *loop_count = 0;
    *is_filled = true;
    for (size_t v = 0; v < mesh->vert_count && *is_filled; v++) {
        size_t count = 0;
        double this_area;
        for (uint32_t at = (uint32_t)v; c->next[at] != UINT32_MAX;) {
            uint32_t to = c->next[at];
            c->loop[count++] = at;
            c->next[at] = UINT32_MAX;
            at = to;
        }
        if (!count) continue;
        NPG_TRY(npg_grow(&c->new_faces, &c->new_capacity, c->new_count + count, 3 * sizeof(uint32_t),
                         NPG_FOR_MESH));
        NPG_TRY(npg_loop_fill(c->new_faces + 3 * c->new_count, &this_area, is_filled,
                              (npg_loop){c->loop, count}, pose, (const uint32_t(*)[2])c->edges,
                              c->edge_count));
        c->new_count += count - 2;
        *area += this_area;
        ++*loop_count;
    }
    return NPG_OK;
}

static size_t count_seeds(const cutting *c, uint32_t patch)
{
    size_t seeds = 0;
    for (size_t f = 0; f < c->ballot->mesh->face_count; f++)
        seeds += c->patches->of_face[f] == patch && c->ballot->against[f] >= FRAMES_LEAST;
    return seeds;
}

/* ---- all of them ---- */

static npg_status open_cutting(cutting *c)
{
    const npg_mesh *mesh = c->ballot->mesh;
    c->twin = npg_arena_take(&c->arena, mesh->face_count, 3 * sizeof *c->twin);
    c->next = npg_arena_take(&c->arena, mesh->vert_count, sizeof *c->next);
    c->loop = npg_arena_take(&c->arena, mesh->vert_count, sizeof *c->loop);
    c->is_cut = npg_arena_take(&c->arena, mesh->face_count, 1);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(npg_mesh_edges(&c->edges, &c->edge_count, mesh->faces, mesh->face_count));
    return npg_mesh_twins(c->twin, mesh->faces, mesh->face_count);
}

/* The mesh without the cut faces and with the new ones. */
static npg_status rebuild(npg_mesh **out, const cutting *c, size_t cut_count)
{
    const npg_mesh *mesh = c->ballot->mesh;
    size_t at = 0, face_count = mesh->face_count - cut_count + c->new_count;
    NPG_TRY(npg_mesh_open(out, mesh->vert_count, face_count));
    memcpy((*out)->vert_pos, mesh->vert_pos, mesh->vert_count * 3 * sizeof(float));
    for (size_t f = 0; f < mesh->face_count; f++)
        if (!c->is_cut[f]) memcpy((*out)->faces + 3 * at++, mesh->faces + 3 * f, 3 * sizeof(uint32_t));
    memcpy((*out)->faces + 3 * at, c->new_faces, c->new_count * 3 * sizeof(uint32_t));
    uint8_t *keep;
    npg_status status = npg_alloc(&keep, NPG_FOR_MESH, face_count);
    if (!status) {
        memset(keep, 1, face_count);
        status = npg_mesh_keep_faces(out, keep); /* drops the vertices inside the patches */
        npg_release(&keep);
    }
    if (status) npg_mesh_unref(out);
    return status;
}

/* Whether the mesh is no worse than before: no edge that is wrong, no new border, in as many pieces. */
static npg_status is_as_good(bool *yes, const npg_mesh *before, const npg_mesh *after)
{
    npg_manifold was, now;
    size_t pieces_before, pieces_after;
    NPG_TRY(npg_mesh_manifold(&was, before));
    NPG_TRY(npg_mesh_manifold(&now, after));
    NPG_TRY(npg_mesh_count_components(&pieces_before, before));
    NPG_TRY(npg_mesh_count_components(&pieces_after, after));
    *yes = now.crowded_edges <= was.crowded_edges && now.misoriented_edges <= was.misoriented_edges &&
           now.border_edges <= was.border_edges && now.degenerate_faces <= was.degenerate_faces &&
           pieces_after <= pieces_before;
    return NPG_OK;
}

/* Mark the patch's faces as cut or not; returns how many there are. */
static size_t mark_cut(cutting *c, uint32_t patch, uint8_t value)
{
    size_t count = 0;
    for (size_t f = 0; f < c->ballot->mesh->face_count; f++) {
        if (c->patches->of_face[f] != patch) continue;
        c->is_cut[f] = value;
        count++;
    }
    return count;
}

static npg_status try_patch(bool *is_cut, cutting *c, const npg_bridge_cut *done, uint32_t patch)
{
    const npg_mesh *mesh = c->ballot->mesh;
    const float *pose = NULL;
    size_t loop_count;
    double area;
    *is_cut = false;
    memset(c->next, 0xff, mesh->vert_count * sizeof *c->next);
    if (!link_border(c->next, mesh, c->patches, patch, c->twin)) return NPG_OK;
    double worst = worst_pose(&pose, c->ballot, c->patches, patch);
    NPG_TRY(fill_loops(c, &area, &loop_count, is_cut, pose));
    *is_cut = *is_cut && loop_count >= LOOPS_LEAST && area < worst;
    if (!*is_cut) return NPG_OK;
    npg_mesh *after;
    size_t count = done->faces + mark_cut(c, patch, 1);
    *is_cut = (double)count <= PATCH_MOST * (double)mesh->face_count;
    if (!*is_cut) return NPG_OK;
    NPG_TRY(rebuild(&after, c, count));
    npg_status status = is_as_good(is_cut, mesh, after);
    npg_mesh_unref(&after);
    return status;
}

static npg_status cut_patch(cutting *c, npg_bridge_cut *done, uint32_t patch)
{
    size_t before = c->new_count;
    bool is_cut;
    if (count_seeds(c, patch) < SEEDS_LEAST) return NPG_OK;
    NPG_TRY(try_patch(&is_cut, c, done, patch));
    size_t count = mark_cut(c, patch, is_cut);
    if (is_cut) {
        done->patches++;
        done->faces += count;
    } else {
        c->new_count = before;
        done->refused++;
    }
    return NPG_OK;
}

static double cut_area(const cutting *c)
{
    const npg_mesh *mesh = c->ballot->mesh;
    double all = 0, cut = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        double area = npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
        all += area;
        cut += c->is_cut[f] ? area : 0;
    }
    return all > 0 ? cut / all : 0;
}

static npg_status replace(npg_mesh **mesh, npg_bridge_cut *done, const cutting *c)
{
    npg_mesh *after;
    if (!done->patches) return NPG_OK;
    done->area_share = cut_area(c);
    NPG_TRY(rebuild(&after, c, done->faces));
    npg_mesh_unref(mesh);
    *mesh = after;
    return NPG_OK;
}

static npg_status cut(npg_mesh **mesh, npg_bridge_cut *done, const ballot *b)
{
    patches p = {.arena.purpose = NPG_FOR_MESH};
    cutting c = {.ballot = b, .patches = &p, .arena.purpose = NPG_FOR_MESH};
    npg_status status = gather(&p, b);
    if (!status && p.count) status = open_cutting(&c);
    for (size_t i = 0; i < p.count && !status; i++) status = cut_patch(&c, done, (uint32_t)i);
    if (!status) status = replace(mesh, done, &c);
    npg_release(&c.edges);
    npg_release(&c.new_faces);
    npg_arena_release(&c.arena);
    npg_arena_release(&p.arena);
    return status;
}

npg_status npg_bridge_cut_all(npg_mesh **mesh, npg_bridge_cut *done, const npg_candidate_clouds *clouds,
                              size_t at, const npg_bridge_settings *settings)
{
    npg_mesh *followed;
    ballot b = {.settings = settings, .arena.purpose = NPG_FOR_MESH};
    *done = (npg_bridge_cut){0};
    NPG_REQUIRE(at < clouds->count && settings->spacing_unit > 0);
    NPG_TRY(npg_mesh_handles(&done->handles, *mesh));
    if (done->handles < 1) return NPG_OK;
    NPG_TRY(npg_mesh_copy(&followed, *mesh));
    b.mesh = followed;
    npg_status status = npg_mesh_make_normals(followed);
    if (!status) status = open_ballot(&b, clouds->count);
    if (!status) status = npg_candidate_follow(clouds, at, followed, &bridge_tracking, false, vote, &b);
    done->frames = b.frames;
    if (!status && b.frames >= FRAMES_LEAST) status = cut(mesh, done, &b);
    npg_arena_release(&b.arena);
    npg_mesh_unref(&followed);
    return status;
}
