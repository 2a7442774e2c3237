/* The nearest point of a moving surface: build once, ask in batches from several threads, move, ask again.
 *
 *     nearest
 *
 * The surface is a ball of radius 1; how far a point at distance d from the middle is from it is known:
 * |d - 1|.
 *
 * Build:  cc nearest.c -o nearest $(pkg-config --cflags --libs neupig) -lm -pthread */
#include <math.h>
#include <neupig.h>
#include <pthread.h>
#include <stdio.h>

enum {
    RINGS = 60,
    SIDES = 120,
    VERTS = RINGS * SIDES,
    FACES = 2 * (RINGS - 1) * SIDES,
    POINTS = 4000,
    THREADS = 2
};

static float vertices[3 * VERTS], points[3 * POINTS];
static uint32_t faces[3 * FACES];
static npg_surface_hit hits[POINTS];

static void place_ball(float x)
{
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < SIDES; s++) {
            double polar = 3.14159265358979 * r / (RINGS - 1), turn = 2 * 3.14159265358979 * s / SIDES;
            float *p = vertices + 3 * (r * SIDES + s);
            p[0] = (float)(sin(polar) * cos(turn)) + x;
            p[1] = (float)(sin(polar) * sin(turn));
            p[2] = (float)cos(polar);
        }
}

static void connect(void)
{
    uint32_t *f = faces;
    for (uint32_t r = 0; r + 1 < RINGS; r++)
        for (uint32_t s = 0; s < SIDES; s++) {
            uint32_t a = r * SIDES + s, b = r * SIDES + (s + 1) % SIDES, c = a + SIDES, d = b + SIDES;
            const uint32_t both[6] = {a, c, b, b, c, d};
            for (int k = 0; k < 6; k++) *f++ = both[k];
        }
}

/* Asking is thread-safe: each thread has its part of the batch. */
typedef struct part {
    const npg_surface *surface;
    int first, count;
    npg_status status;
} part;

static void *ask(void *argument)
{
    part *p = argument;
    p->status = npg_surface_closest(p->surface, hits + p->first, points + 3 * p->first, (size_t)p->count);
    return NULL;
}

static npg_status ask_all(const npg_surface *surface)
{
    pthread_t threads[THREADS];
    part parts[THREADS];
    npg_status status = NPG_OK;
    for (int i = 0; i < THREADS; i++) {
        parts[i] = (part){surface, i * POINTS / THREADS, POINTS / THREADS, NPG_OK};
        if (pthread_create(&threads[i], NULL, ask, &parts[i])) return NPG_FAILED;
    }
    for (int i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        if (parts[i].status) status = parts[i].status;
    }
    return status;
}

/* The largest difference from what is known. */
static double worst_error(float x)
{
    double worst = 0;
    for (int i = 0; i < POINTS; i++) {
        const float *p = points + 3 * i;
        double dx = (double)p[0] - (double)x, y = (double)p[1], z = (double)p[2];
        double known = fabs(sqrt(dx * dx + y * y + z * z) - 1);
        worst = fmax(worst, fabs(sqrt((double)hits[i].dist_sq) - known));
    }
    return worst;
}

static void print_first(void)
{
    /* The point itself: the face's corners, weighted. */
    float q[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < 3; a++)
            q[a] += hits[0].weights[k] * vertices[3 * faces[3 * hits[0].face + (uint32_t)k] + (uint32_t)a];
    printf("nearest to (%.2f %.2f %.2f): (%.2f %.2f %.2f) in face %u\n", (double)points[0], (double)points[1],
           (double)points[2], (double)q[0], (double)q[1], (double)q[2], (unsigned)hits[0].face);
}

int main(void)
{
    npg_surface *surface = NULL;
    place_ball(0);
    connect();
    for (int i = 0; i < 3 * POINTS; i++) points[i] = (float)(2 * sin(12.9898 * i));
    npg_status status = npg_surface_open(&surface, vertices, VERTS, faces, FACES); /* copies both */
    if (!status) status = ask_all(surface);
    double still = worst_error(0);
    if (!status) print_first();
    place_ball(0.5f);
    if (!status) status = npg_surface_move(surface, vertices); /* refits the tree: cheaper than building it */
    if (!status) status = ask_all(surface);
    double moved = worst_error(0.5f);
    if (status < 0) fprintf(stderr, "nearest: %s\n", npg_error_text());
    npg_surface_close(&surface);
    if (status) return npg_status_exit_code(status);
    printf("%d points, off by %.5f at most; after the move %.5f\n", POINTS, still, moved);
    return still < 2e-3 && moved < 2e-3 ? 0 : 1; /* the ball has flat faces */
}
