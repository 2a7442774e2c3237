/* Tracker: correspondences and Gauss-Newton steps on the deformation graph. */
#include "track/track.h"

#include <math.h>
#include <string.h>

#include "geometry/limits.h"
#include "pipeline/frame_box.h"
#include "pipeline/parallel.h"
#include "track/track_internal.h"

#define STIFF_START 10.0 /* times the final stiffness at the first step */
/* For a reference that fills the box of all frames; one that travels through it is smaller,
 * and so are these. */
#define NOISE_UNIT  0.003 /* mean distance of points at which the stiffness has doubled       */
#define WIDTH_START 0.08  /* of the robust weight, in units: what may move between two frames */
#define WIDTH_END   0.01  /* at the last step, more where the points are noisy                */
#define REVERSE     0.5   /* weight of surface -> points against points -> surface            */
/* Set by trial, like those above. */
#define SCHEDULE 1.5 /* stiffness and width are final after 2/3 of the steps; the last third settles */
#define ONE_SIDE 20  /* times the stiffness where one sensor leaves half of the body to the edges */
#define AGAIN    2   /* times the final stiffness and width, where a fit starts near its end */
#define GRAIN    512 /* targets, samples or edges at a time: a thread's next piece of work */

/* Of a sample that was in empty space. */
typedef struct way_out {
    float place[3], direction[3]; /* the nearest place that is not empty, and the way there */
    bool is_taken;                /* in a step of the fit at work */
} way_out;

struct npg_tracker {
    npg_arena arena; /* of all arrays that are not said to be loans */
    npg_tracker_settings settings;
    npg_mesh *reference; /* counted reference; V vertices, which the whole graph carries */
    npg_graph *whole;
    npg_proxy *thin;      /* the surface that is aligned: W vertices of it, which the graph carries */
    const npg_mesh *mesh; /* the thin one's */
    npg_graph *graph;
    npg_block_system *system;
    npg_surface *surface;
    float *vert_pos, *vert_normals; /* W x 3: the pose at work */
    uint32_t *samples;              /* vertices, spread over the surface */
    uint32_t *sample_face;          /* of each a face */
    size_t sample_count;
    double *step;       /* K x 6 */
    float *rows;        /* K x 16: the pose at work, for many points */
    uint8_t *is_border; /* W */
    bool is_open;       /* the surface has a border */
    double along;       /* share of distances along the surface in the fit at work */
    double size;        /* longest side of the reference against that of the box of all frames */
    /* of the frame at work */
    float *targets, *target_normals; /* M x 3 */
    size_t target_count;
    npg_surface_hit *hits; /* M */
    uint32_t *start_face;  /* M: where the step before found each point's nearest */
    uint32_t *near;        /* samples: nearest target */
    float *near_sq, *sample_pos;
    uint8_t *is_seen;  /* samples: by a sensor, in the pose at work */
    uint8_t *is_empty; /* samples: where a sensor saw that nothing is */
    uint8_t *is_other; /* samples: the nearest target is another part's */
    way_out *outs;     /* samples */
    npg_visible visible;
    npg_occlusion_prior prior; /* edges of what no sensor sees */
    npg_block_term *terms;     /* of the targets, the samples, and the edges, both ways, of a step */
    struct sums {
        double dist, dist_sq, bounded; /* bounded: of the cost                                      */
        size_t compared, explained;    /* that can be of the surface at all; that it has a place for */
    } * sums;                          /* of each grain of targets */
};

#define RAY_BYTES   64  /* of a sample of the surface, to tell whether a sensor sees it */
#define PRIOR_BYTES 512 /* of a node: how its edges are held, and by what is seen of it */

/* Blocks of the equations, about 20 pairs a node, and how both ends hold them; per vertex weights and the graph's
 * search for them, positions, normals. */
size_t npg_tracker_memory(size_t nodes, size_t samples, size_t verts)
{
    return nodes * (22 * 36 * sizeof(double) + PRIOR_BYTES) + verts * 320 + samples * RAY_BYTES;
}

size_t npg_tracker_node_count(const npg_tracker *tracker)
{
    return tracker->graph->node_count;
}

bool npg_tracker_is_open(const npg_tracker *tracker)
{
    return tracker->is_open;
}

const npg_graph *npg_tracker_graph(const npg_tracker *tracker)
{
    return tracker->whole;
}

const npg_mesh *npg_tracker_reference(const npg_tracker *tracker)
{
    return tracker->reference;
}

void npg_tracker_vertices(const npg_tracker *tracker, float *vert_unit, const double *pose)
{
    npg_pose_rows(tracker->rows, tracker->whole, pose);
    npg_pose_vertices(vert_unit, tracker->whole, tracker->rows, tracker->reference->vert_pos);
}

void npg_tracker_close(npg_tracker **slot)
{
    if (!slot || !*slot) return;
    npg_tracker *t = *slot;
    npg_graph_close(&t->graph);
    npg_graph_close(&t->whole);
    npg_proxy_close(&t->thin);
    npg_block_close(&t->system);
    npg_surface_close(&t->surface);
    npg_mesh_unref(&t->reference);
    npg_object_close(slot);
}

/* Every n-th vertex: Poisson meshes have their vertices evenly over the surface,
 * and in no order that repeats. */
static npg_status choose_samples(npg_tracker *t)
{
    size_t step = t->mesh->vert_count / t->settings.samples + 1;
    t->sample_count = (t->mesh->vert_count + step - 1) / step;
    t->samples = npg_arena_take(&t->arena, t->sample_count, sizeof *t->samples);
    t->sample_face = npg_arena_take(&t->arena, t->sample_count, sizeof *t->sample_face);
    NPG_TRY(npg_arena_status(&t->arena));
    for (size_t s = 0; s < t->sample_count; s++) t->samples[s] = (uint32_t)(s * step);
    for (size_t i = 0; i < 3 * t->mesh->face_count; i++)
        if (t->mesh->faces[i] % step == 0) t->sample_face[t->mesh->faces[i] / step] = (uint32_t)(i / 3);
    return NPG_OK;
}

/* The graph, and the surface that it carries through the steps. */
static npg_status open_surface(npg_tracker *t)
{
    NPG_TRY(npg_graph_open(&t->whole, t->reference, t->settings.nodes));
    NPG_TRY(npg_proxy_open(&t->thin, t->reference, NPG_PROXY_SURFACE));
    t->mesh = t->thin->mesh;
    NPG_TRY(npg_graph_take(&t->graph, t->whole, t->thin->vertex, t->mesh->vert_count));
    return npg_surface_open(&t->surface, t->mesh->vert_pos, t->mesh->vert_count, t->mesh->faces,
                            t->mesh->face_count);
}

static npg_status open_arrays(npg_tracker *t)
{
    npg_arena *arena = &t->arena;
    size_t w = t->mesh->vert_count, m = t->settings.samples, nodes = t->graph->node_count;
    NPG_TRY(choose_samples(t));
    size_t s = t->sample_count;
    t->is_border = npg_arena_take(arena, w, 1);
    t->vert_pos = npg_arena_take(arena, w, 3 * sizeof(float));
    t->vert_normals = npg_arena_take(arena, w, 3 * sizeof(float));
    t->step = npg_arena_take(arena, nodes, 6 * sizeof(double));
    t->rows = npg_arena_take(arena, nodes, NPG_POSE_ROW * sizeof(float));
    t->targets = npg_arena_take(arena, m, 3 * sizeof(float));
    t->target_normals = npg_arena_take(arena, m, 3 * sizeof(float));
    t->hits = npg_arena_take(arena, m, sizeof *t->hits);
    t->start_face = npg_arena_take(arena, m, sizeof *t->start_face);
    t->near = npg_arena_take(arena, s, sizeof *t->near);
    t->near_sq = npg_arena_take(arena, s, sizeof *t->near_sq);
    t->sample_pos = npg_arena_take(arena, s, 3 * sizeof(float));
    t->is_seen = npg_arena_take(arena, s, 1);
    t->is_empty = npg_arena_take(arena, s, 1);
    t->is_other = npg_arena_take(arena, s, 1);
    t->outs = npg_arena_take(arena, s, sizeof *t->outs);
    npg_visible_open(&t->visible, arena, s);
    return npg_arena_status(arena);
}

static npg_status open_system(npg_tracker *t)
{
    NPG_TRY(npg_prior_open(&t->prior, &t->arena, t->graph));
    size_t terms = t->settings.samples + t->sample_count + 2 * t->prior.pair_count;
    t->terms = npg_arena_take(&t->arena, terms, sizeof *t->terms);
    t->sums = npg_arena_take(&t->arena, t->settings.samples / GRAIN + 1, sizeof *t->sums);
    NPG_TRY(npg_arena_status(&t->arena));
    return npg_block_open(&t->system, t->graph->node_count, (const uint32_t(*)[2])t->prior.pairs,
                          t->prior.pair_count, terms);
}

static double size_of(const npg_mesh *reference)
{
    npg_bounds bounds = npg_bounds_of(reference->vert_pos, reference->vert_count);
    double longest = npg_bounds_longest(&bounds);
    return longest > 0 ? longest / (2 * NPG_UNIT_EXTENT) : 1;
}

npg_status npg_tracker_open(npg_tracker **out, npg_mesh *reference, const npg_tracker_settings *settings)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_FIT, sizeof **out));
    npg_tracker *t = *out;
    t->settings = *settings;
    t->reference = npg_mesh_ref(reference);
    t->size = size_of(reference);
    npg_status status = open_surface(t);
    if (!status) status = open_arrays(t);
    if (!status) status = npg_mesh_border(t->is_border, &t->is_open, t->mesh);
    if (!status) status = open_system(t);
    if (status) npg_tracker_close(out);
    return status;
}

/* ---- one term ---- */

/* A point that nodes carry and where it should go. */
typedef struct pull {
    float rest[3];
    uint32_t nodes[NPG_GRAPH_BIND];
    float weights[NPG_GRAPH_BIND];
    double normal[3], target[3];
} pull;

/* The nodes of a surface point: those of its face's corners, the four that matter most. */
static void bind_face_point(pull *p, const npg_tracker *t, const npg_surface_hit *hit)
{
    uint32_t nodes[3 * NPG_GRAPH_BIND];
    float weights[3 * NPG_GRAPH_BIND], sum = 0;
    int count = 0;
    npg_hit_blend(p->rest, hit, t->mesh->faces, t->mesh->vert_pos, 3);
    for (int corner = 0; corner < 3; corner++) {
        size_t v = t->mesh->faces[3 * (size_t)hit->face + (size_t)corner];
        for (size_t b = 0; b < NPG_GRAPH_BIND; b++) {
            uint32_t node = t->graph->vert_node[v * NPG_GRAPH_BIND + b];
            float weight = hit->weights[corner] * t->graph->vert_weight[v * NPG_GRAPH_BIND + b];
            if (node == UINT32_MAX) break;
            int at = 0;
            while (at < count && nodes[at] != node) at++;
            weights[at] = at < count ? weights[at] + weight : weight;
            nodes[at] = node;
            count += at == count;
        }
    }
    for (int b = 0; b < NPG_GRAPH_BIND; b++) {
        int best = -1;
        for (int i = 0; i < count; i++)
            if (weights[i] > 0 && (best < 0 || weights[i] > weights[best])) best = i;
        p->nodes[b] = best < 0 ? UINT32_MAX : nodes[best];
        p->weights[b] = best < 0 ? 0 : weights[best];
        if (best >= 0) weights[best] = 0;
        sum += p->weights[b];
    }
    for (int b = 0; b < NPG_GRAPH_BIND; b++) p->weights[b] /= sum;
}

/* arm = rotation d. */
static void turn_arm(double arm[3], const double *rotation, const double d[3])
{
    for (int i = 0; i < 3; i++) arm[i] = npg_vec3_dot(rotation + 3 * i, d);
}

/* The term weight * rho'(|d|^2) |x - target|_W^2. */
static void set_pull(npg_block_term *out, const npg_tracker *t, const pull *p, const double *pose,
                     double weight, double width)
{
    npg_block_term term = {0};
    double x[3], from[3], dist_sq = 0;
    npg_pose_point(x, t->graph, pose, p->rest, p->nodes, p->weights);
    for (int i = 0; i < 3; i++) {
        term.right[i] = p->target[i] - x[i];
        dist_sq += term.right[i] * term.right[i];
    }
    weight *= npg_geman_mcclure(dist_sq, width);
    for (; term.count < NPG_GRAPH_BIND && p->nodes[term.count] != UINT32_MAX; term.count++) {
        uint32_t node = p->nodes[term.count];
        term.nodes[term.count] = node;
        term.shares[term.count] = (double)p->weights[term.count];
        npg_vec3_between(from, t->graph->node_pos + 3 * (size_t)node, p->rest);
        turn_arm(term.arms[term.count], pose + node * NPG_POSE_SIZE, from);
    }
    memcpy(term.normal, p->normal, sizeof term.normal);
    term.across = weight * (1 - t->along);
    term.along = weight * t->along;
    *out = term;
}

/* ---- the terms of a step ---- */

static void hit_normal(double normal[3], const npg_tracker *t, const npg_surface_hit *hit)
{
    double size = 0;
    for (size_t i = 0; i < 3; i++) {
        normal[i] = 0;
        for (size_t c = 0; c < 3; c++)
            normal[i] += (double)hit->weights[c] *
                         (double)t->vert_normals[3 * t->mesh->faces[3 * (size_t)hit->face + c] + i];
        size += normal[i] * normal[i];
    }
    for (size_t i = 0; i < 3; i++) normal[i] /= fmax(sqrt(size), 1e-9);
}

static bool is_on_border(const npg_tracker *t, const npg_surface_hit *hit)
{
    return t->is_open && npg_hit_on_border(hit, t->mesh->faces + 3 * (size_t)hit->face, t->is_border);
}

/* Whether a point that a sensor saw can be of the surface that is nearest to it: a side that faces a sensor,
 * and not the border of what is known, beyond which the body goes on. */
static bool could_be_seen(const npg_tracker *t, const npg_tracker_cloud *cloud, const npg_surface_hit *hit,
                          const float *point, const double normal[3])
{
    return !is_on_border(t, hit) &&
           npg_faces_sensor(cloud->sensors, cloud->sensor_count, point, normal, NPG_AGAINST);
}

/* The distance to a border grows along the way there, in the surface's plane: that is what holds a sheet in its own. */
static void take_way(double normal[3], const float *from, const float *to)
{
    double way[3];
    npg_vec3_between(way, from, to);
    if (npg_vec3_make_unit(way)) memcpy(normal, way, sizeof way);
}

/* What all of a step's threads read. */
typedef struct step {
    npg_tracker *t;
    const double *pose;
    const npg_kdtree *tree;
    const npg_tracker_cloud *cloud;
    const float *normals; /* of the points, or NULL where they have no say */
    double width, stiffness;
    double within; /* what is farther from all points than this has none of its own */
    double apart;  /* the same of a border, which points end at */
    bool is_first, is_settling;
} step;

/* Of a distance: its share in the cost. */
static double bounded(const npg_tracker *t, double dist_sq)
{
    double tau = NPG_BEYOND * WIDTH_END * t->size;
    return fmin(1, dist_sq / (tau * tau));
}

/* Points -> surface, targets [first, last), all of one grain. */
static void set_targets(const step *s, size_t first, size_t last)
{
    const npg_tracker *t = s->t;
    struct sums sums = {0};
    for (size_t i = first; i < last; i++) {
        const npg_surface_hit *hit = &t->hits[i];
        npg_block_term *term = &t->terms[i];
        pull p;
        term->count = 0;
        hit_normal(p.normal, t, hit);
        sums.bounded += bounded(t, (double)hit->dist_sq);
        if (s->cloud->sensor_count && !could_be_seen(t, s->cloud, hit, t->targets + 3 * i, p.normal))
            continue;
        sums.compared++;
        sums.dist += sqrt((double)hit->dist_sq);
        sums.dist_sq += (double)hit->dist_sq;
        double facing = 0;
        for (size_t c = 0; c < 3 && s->normals; c++)
            facing += p.normal[c] * (double)t->target_normals[3 * i + c];
        if (facing < NPG_AGAINST) continue;
        sums.explained += (double)hit->dist_sq <= NPG_BEYOND * NPG_BEYOND * s->width * s->width;
        bind_face_point(&p, t, hit);
        for (size_t c = 0; c < 3; c++) p.target[c] = (double)t->targets[3 * i + c];
        if (!s->cloud->sensor_count && is_on_border(t, hit)) {
            float place[3];
            npg_hit_blend(place, hit, t->mesh->faces, t->vert_pos, 3);
            take_way(p.normal, place, t->targets + 3 * i);
        }
        set_pull(term, t, &p, s->pose, 1 / (double)t->target_count, s->width);
    }
    if (first < last) t->sums[first / GRAIN] = sums;
}

/* Surface where nothing is goes the shortest way out of there, seen or not, however far that is: the nearest point
 * may be of what stands far behind it.  There it is held to the end of the fit: free again it would go back to where
 * it came from, and every other step would end in empty space. */
static void set_stray(npg_block_term *term, const step *s, size_t i, pull *p, double weight)
{
    npg_tracker *t = s->t;
    way_out *out = &t->outs[i];
    const float *place = t->sample_pos + 3 * i;
    double way[3];
    if (t->is_empty[i]) {
        if (!npg_free_space_leave(s->cloud->space, out->place, place)) return;
        npg_vec3_between(way, place, out->place);
        if (!npg_vec3_make_unit(way)) return;
        for (int c = 0; c < 3; c++) out->direction[c] = (float)way[c];
        out->is_taken = true;
    }
    for (int c = 0; c < 3; c++) {
        p->target[c] = (double)out->place[c];
        p->normal[c] = (double)out->direction[c];
    }
    npg_vec3_between(way, place, out->place);
    set_pull(term, t, p, s->pose, weight, fmax(s->width, npg_vec3_length(way)));
}

/* Whether the nearest point of sample i, which faces so, is close enough to be its. */
static bool has_point(const step *s, size_t i, double facing)
{
    const npg_tracker *t = s->t;
    return t->is_seen[i] && !t->is_empty[i] && !t->is_other[i] && !(facing < NPG_AGAINST) &&
           (double)t->near_sq[i] <= NPG_BEYOND * NPG_BEYOND * s->width * s->width;
}

/* Surface -> points, for sample i. */
static void set_sample(npg_block_term *term, const step *s, size_t i)
{
    const npg_tracker *t = s->t;
    double facing = 0, weight = REVERSE / (double)t->sample_count;
    size_t v = t->samples[i], near = t->near[i];
    pull p;
    term->count = 0;
    for (size_t c = 0; c < 3; c++) {
        p.rest[c] = t->mesh->vert_pos[3 * v + c];
        p.normal[c] = (double)t->vert_normals[3 * v + c];
        p.target[c] = (double)s->cloud->points[3 * near + c];
        if (s->normals) facing += p.normal[c] * (double)s->normals[3 * near + c];
    }
    memcpy(p.nodes, t->graph->vert_node + v * NPG_GRAPH_BIND, sizeof p.nodes);
    memcpy(p.weights, t->graph->vert_weight + v * NPG_GRAPH_BIND, sizeof p.weights);
    /* the border of a sheet that hangs over, by more than points are apart */
    if (!s->cloud->sensor_count && t->is_border[v] && (double)t->near_sq[i] > s->apart * s->apart)
        take_way(p.normal, t->sample_pos + 3 * i, s->cloud->points + 3 * near);
    if (has_point(s, i, facing))
        set_pull(term, t, &p, s->pose, weight, s->width);
    else if (t->is_empty[i] || t->outs[i].is_taken)
        set_stray(term, s, i, &p, weight);
}

/* Edge e / 2 keeps its length and direction in the frame of one end, as at rest or as it is held. */
static void set_edge(npg_block_term *term, const step *s, size_t e)
{
    const npg_tracker *t = s->t;
    const npg_graph *graph = t->graph;
    uint32_t j = t->prior.pairs[e / 2][e % 2], k = t->prior.pairs[e / 2][1 - e % 2];
    const double *pj = s->pose + j * NPG_POSE_SIZE, *pk = s->pose + k * NPG_POSE_SIZE;
    const float *gj = graph->node_pos + 3 * (size_t)j, *gk = graph->node_pos + 3 * (size_t)k;
    double edge[3];
    *term = (npg_block_term){.count = 2, .nodes = {j, k}, .shares = {1, -1}};
    term->along = s->stiffness / (double)graph->edge_count * npg_prior_edge(edge, &t->prior, graph, e);
    turn_arm(term->arms[0], pj, edge);
    for (int i = 0; i < 3; i++)
        term->right[i] = (double)gk[i] + pk[9 + i] - (double)gj[i] - pj[9 + i] - term->arms[0][i];
}

/* ---- a step: pairs of both directions, then terms, in grains of targets and samples, and of edges ---- */

/* What of [begin, begin + count) lies in a grain, counted from begin; empty where *first is *last. */
static void clip(size_t *first, size_t *last, size_t grain, size_t begin, size_t count)
{
    size_t from = grain * GRAIN, to = from + GRAIN, end = begin + count;
    *first = (from < begin ? begin : from > end ? end : from) - begin;
    *last = (to < begin ? begin : to > end ? end : to) - begin;
}

static size_t grains_of(size_t count)
{
    return (count + GRAIN - 1) / GRAIN;
}

/* Whether a target is of another part than sample i, which it is the nearest to: at rest the place of the surface that
 * is nearest to it (c) is farther from the sample (s) than it can be in a part that keeps its shape,
 * |x(s) - x(c)| <= |x(s) - p| + |p - x(c)| <= 2 |x(s) - p|, and hangs on other nodes. */
static bool is_of_other_part(const npg_tracker *t, size_t i, const npg_surface_hit *hit)
{
    double least = fmax(NPG_CLEARLY * sqrt((double)t->near_sq[i]), t->graph->radius);
    float place[3];
    npg_hit_blend(place, hit, t->mesh->faces, t->mesh->vert_pos, 3);
    return npg_vec3_distance(place, t->mesh->vert_pos + 3 * (size_t)t->samples[i]) > least;
}

/* Which target a point of the cloud is; target_count: none. */
static size_t target_of(const npg_tracker *t, size_t point, size_t point_count)
{
    size_t i = (point * t->target_count + point_count - 1) / point_count;
    bool is_one = i < t->target_count && npg_spread_index(i, t->target_count, point_count) == point;
    return is_one ? i : t->target_count;
}

/* A limb that no point was seen of must not fold onto its neighbour.  Where sensors are known, is_seen tells. */
static npg_status find_other_parts(const step *s, size_t first, size_t last)
{
    npg_tracker *t = s->t;
    for (size_t i = first; i < last; i++) {
        double away = sqrt((double)t->near_sq[i]);
        t->is_other[i] = false;
        if (s->cloud->sensor_count || away <= s->within || away > NPG_BEYOND * s->width) continue;
        size_t near = t->near[i], target = target_of(t, near, s->cloud->count);
        npg_surface_hit hit;
        if (target < t->target_count)
            hit = t->hits[target];
        else
            NPG_TRY(npg_surface_closest_near(t->surface, &hit, s->cloud->points + 3 * near, 1,
                                             &t->sample_face[i], 1));
        t->is_other[i] = is_of_other_part(t, i, &hit);
    }
    return NPG_OK;
}

/* The first part makes the vertices' normals, which no pair asks for. */
static npg_status find_targets(void *user, size_t part)
{
    const step *s = user;
    npg_tracker *t = s->t;
    size_t first, last;
    if (!part) {
        npg_mesh_vertex_normals(t->vert_normals, t->vert_pos, t->mesh->vert_count, t->mesh->faces,
                                t->mesh->face_count);
        return NPG_OK;
    }
    clip(&first, &last, part - 1, 0, t->target_count);
    return npg_surface_closest_near(t->surface, t->hits + first, t->targets + 3 * first, last - first,
                                    s->is_first ? NULL : t->start_face + first, 1);
}

static npg_status find_samples(void *user, size_t part)
{
    const step *s = user;
    npg_tracker *t = s->t;
    size_t first, last;
    clip(&first, &last, part, 0, t->sample_count);
    float *place = t->sample_pos + 3 * first;
    npg_rows_gather(place, t->vert_pos, t->samples + first, last - first);
    for (size_t i = first; i < last; i++)
        t->is_empty[i] = npg_free_space_is_empty(s->cloud->space, t->sample_pos + 3 * i);
    NPG_TRY(npg_kdtree_nearest(s->tree, t->near + first, t->near_sq + first, place, last - first, 1, 1));
    return find_other_parts(s, first, last);
}

static npg_status set_terms(void *user, size_t part)
{
    const step *s = user;
    const npg_tracker *t = s->t;
    size_t first, last, at = t->target_count;
    clip(&first, &last, part, 0, t->target_count);
    set_targets(s, first, last);
    clip(&first, &last, part, at, t->sample_count);
    for (size_t i = first; i < last; i++) set_sample(&t->terms[at + i], s, i);
    at += t->sample_count;
    clip(&first, &last, part, at, 2 * t->prior.pair_count);
    for (size_t e = first; e < last; e++) set_edge(&t->terms[at + e], s, e);
    return NPG_OK;
}

/* Surface -> points: its part of the Chamfer distance, of what could be seen, and of the cost. */
static void sum_up_samples(npg_tracked *tracked, const npg_tracker *t)
{
    double sum = 0, cost = 0, dist = 0;
    size_t seen = 0, empty = 0, both = 0;
    for (size_t i = 0; i < t->sample_count; i++) {
        double dist_sq = t->is_seen[i] ? (double)t->near_sq[i] : 0;
        sum += dist_sq;
        dist += sqrt(dist_sq);
        seen += t->is_seen[i];
        empty += t->is_empty[i];
        both += t->is_seen[i] || t->is_empty[i];
        cost += t->is_empty[i] ? 1 : bounded(t, dist_sq);
    }
    tracked->chamfer += seen ? sum / (double)seen : 0;
    tracked->sample_dist_mean = seen ? dist / (double)seen : 0;
    tracked->cost += both ? cost / (double)both : 0;
    /* twice: half of the samples may be hidden, where nothing tells of them */
    tracked->astray = 2 * (double)empty / (double)t->sample_count;
}

static npg_status gather(step *s)
{
    npg_tracker *t = s->t;
    size_t terms = t->target_count + t->sample_count + 2 * t->prior.pair_count;
    /* Near its end a fit has its parts in place: what still disagrees is a thin part's other side, which must
     * not keep the points of this one, or a given normal that is wrong.  An open surface lacks other sides,
     * whose points must not pull at what it has. */
    s->normals = s->is_settling && !t->is_open ? NULL : s->cloud->normals;
    npg_pose_rows(t->rows, t->graph, s->pose);
    npg_pose_vertices(t->vert_pos, t->graph, t->rows, t->mesh->vert_pos);
    NPG_TRY(npg_surface_move(t->surface, t->vert_pos));
    for (size_t i = 0; i < t->target_count; i++) t->start_face[i] = t->hits[i].face;
    NPG_TRY(npg_parallel(find_targets, s, 1 + grains_of(t->target_count)));
    NPG_TRY(npg_parallel(find_samples, s, grains_of(t->sample_count)));
    NPG_TRY(npg_visible_find(&t->visible, t->is_seen, t->surface, s->cloud->sensors, s->cloud->sensor_count,
                             t->sample_pos, t->samples, t->vert_normals, t->sample_count,
                             NPG_SEEN_OFFSET * t->size));
    npg_prior_see(&t->prior, t->graph, t->samples, t->is_seen, t->sample_count);
    NPG_TRY(npg_parallel(set_terms, s, grains_of(terms)));
    return npg_block_gather(t->system, t->terms, terms);
}

/* What the grains of targets come to, scaled as if all had been compared. */
static void sum_up(npg_tracked *tracked, const npg_tracker *t, bool by_images)
{
    struct sums all = {0};
    for (size_t g = 0; g < grains_of(t->target_count); g++) {
        all.dist += t->sums[g].dist;
        all.dist_sq += t->sums[g].dist_sq;
        all.compared += t->sums[g].compared;
        all.explained += t->sums[g].explained;
        all.bounded += t->sums[g].bounded;
    }
    double share = 1 / (double)(all.compared ? all.compared : t->target_count);
    tracked->point_dist_mean = share * all.dist;
    tracked->point_dist_sq = share * all.dist_sq;
    tracked->explained = (double)all.explained / (double)t->target_count;
    tracked->chamfer = tracked->point_dist_sq;
    tracked->cost = all.bounded / (double)t->target_count;
    sum_up_samples(tracked, t);
    tracked->by_images = by_images;
    if (!by_images) tracked->cost = tracked->chamfer;
}

/* How far a fit has come, 0..1 before the last steps. */
static void set_schedule(step *s, const npg_tracked *tracked, const npg_tracker_effort *effort)
{
    int last = effort->steps - 1;
    double progress = last ? fmin(1, SCHEDULE * tracked->steps / last) : 1;
    double noise = tracked->point_dist_mean / (NOISE_UNIT * s->t->size);
    s->is_first = !tracked->steps;
    s->is_settling = progress >= 1;
    s->stiffness = s->t->settings.stiffness * pow(effort->stiffness, 1 - progress) * (1 + noise * noise);
    if (s->cloud->sensor_count == 1) s->stiffness *= ONE_SIDE;
    s->width = s->t->size * effort->width_unit * pow(WIDTH_END / effort->width_unit, progress);
    s->within = NPG_WITHIN * tracked->point_dist_mean;
    s->apart = tracked->steps ? NPG_WITHIN * tracked->sample_dist_mean : HUGE_VAL;
    s->width = fmax(s->width, s->within);
}

static npg_status do_step(step *s, npg_tracked *tracked, double *pose)
{
    npg_tracker *t = s->t;
    NPG_TRY(gather(s));
    sum_up(tracked, t, s->cloud->space != NULL);
    npg_block_solve(t->system, t->step, 1e-9, 1e-3, 60);
    for (size_t i = 0; i < 6 * t->graph->node_count; i++)
        if (!isfinite(t->step[i])) return npg_error(NPG_DIVERGED, "the coarse alignment is not finite");
    tracked->change = npg_pose_step(pose, t->step, t->graph->node_count);
    tracked->steps++;
    return NPG_OK;
}

npg_tracker_effort npg_tracker_usual(const npg_tracker *t)
{
    return (npg_tracker_effort){t->settings.steps, STIFF_START, WIDTH_START, 1, 0, 0};
}

npg_tracker_effort npg_tracker_again(const npg_tracker *t)
{
    return (npg_tracker_effort){(t->settings.steps + 1) / 2, AGAIN, AGAIN * WIDTH_END, 1, 0, 0};
}

/* A fit that settles gains less with each step: one that does not better what it is to, and would not come to what it
 * is to at the pace of its last step, never will. */
static bool is_given_up(const npg_tracked *tracked, double cost_before, const npg_tracker_effort *effort)
{
    double end = tracked->cost + (tracked->cost - cost_before) * (effort->steps - tracked->steps);
    return effort->cost_most > 0 && tracked->cost > effort->cost_best && end > effort->cost_most;
}

npg_status npg_tracker_fit(npg_tracker *t, npg_tracked *tracked, double *pose, const npg_tracker_cloud *cloud,
                           const npg_prior_poses *poses, const npg_tracker_effort *effort)
{
    const npg_tracker_effort usual = npg_tracker_usual(t);
    npg_kdtree *tree;
    NPG_REQUIRE(cloud->count);
    t->target_count = npg_points_spread(t->targets, t->target_normals, t->settings.samples, cloud->points,
                                        cloud->normals, cloud->count);
    NPG_TRY(npg_kdtree_open(&tree, cloud->points, cloud->count));
    *tracked = (npg_tracked){0};
    npg_status status = NPG_OK;
    for (size_t i = 0; i < t->sample_count; i++) t->outs[i].is_taken = false;
    step s = {.t = t, .pose = pose, .tree = tree, .cloud = cloud};
    if (!effort) effort = &usual;
    const npg_prior_poses start = {.pose = pose};
    if (cloud->sensor_count) npg_prior_take(&t->prior, t->graph, poses ? poses : &start);
    t->along = fmin(1, t->settings.along * effort->along);
    while (tracked->steps < effort->steps && !status) {
        double cost_before = tracked->cost;
        set_schedule(&s, tracked, effort);
        status = do_step(&s, tracked, pose);
        bool is_over = tracked->change < NPG_SETTLED * t->graph->radius;
        if (s.is_settling && (is_over || is_given_up(tracked, cost_before, effort))) break;
    }
    if (!status && cloud->space)
        tracked->astray += npg_free_space_lost_share(cloud->space, t->targets, t->hits, t->target_count);
    npg_kdtree_close(&tree);
    return status;
}

void npg_tracker_since(const npg_tracker *t, float *since, const float *before)
{
    npg_prior_count(&t->prior, since, before, t->graph->node_count);
}
