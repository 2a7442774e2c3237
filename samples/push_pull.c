/* Push frames and pull meshes from one's own loop: nothing is read from files and nothing is written.
 *
 *     push_pull [FRAMES]
 *
 * Pushing waits while the run is busy, and the run waits until its results are pulled, so the two belong into
 * two threads: here one stands for the camera, and main() takes the meshes.
 *
 * Build:  cc push_pull.c -o push_pull $(pkg-config --cflags --libs neupig) -lm -pthread */
#include <math.h>
#include <neupig.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

enum { POINTS = 1500 };

typedef struct camera {
    npg_run *run; /* loan */
    int frames;
    npg_status
        status; /* how it ended, with its text: npg_error_text() speaks to the thread that failed only */
    char text[512];
} camera;

/* Stand-in for a scanner: a ball of 1 m that drifts and breathes, in metres,
 * far from the origin as surveys are. */
static void scan(double *points, float *normals, int frame)
{
    double radius = 1 + 0.05 * sin(0.8 * frame), centre[3] = {431000 + 0.03 * frame, 5412000, 120};
    for (int i = 0; i < POINTS; i++) {
        double z = 1 - 2 * (i + 0.5) / POINTS, turn = 2.399963229728653 * i, flat = sqrt(1 - z * z);
        double n[3] = {flat * cos(turn), flat * sin(turn), z};
        for (int a = 0; a < 3; a++) {
            points[3 * i + a] = centre[a] + radius * n[a];
            normals[3 * i + a] = (float)n[a];
        }
    }
}

static void *film(void *argument)
{
    static double points[3 * POINTS];
    static float normals[3 * POINTS];
    camera *c = argument;
    for (int i = 0; i < c->frames && !c->status; i++) {
        npg_cloud cloud = {.struct_size = sizeof cloud,
                           .number = i, /* any numbers that grow */
                           .point_count = POINTS,
                           .points = points,
                           .normals = normals}; /* NULL: they are estimated */
        scan(points, normals, i);
        c->status = npg_run_push(c->run, &cloud); /* copies; the arrays are ours again */
    }
    if (!c->status) c->status = npg_run_finish(c->run);
    if (c->status) snprintf(c->text, sizeof c->text, "%s", npg_error_text());
    return NULL;
}

/* Take every mesh.  They come as windows of frames are solved, not in the order of time:
 * index says which it is. */
static npg_status take_meshes(npg_run *run)
{
    npg_result *mesh;
    npg_status status;
    while ((status = npg_run_pull(run, &mesh)) == NPG_OK) {
        double x = 0;
        for (size_t v = 0; v < mesh->vertex_count; v++)
            x += mesh->vertices[3 * v] / (double)mesh->vertex_count;
        printf("frame %lld: %zu vertices, %zu faces, middle at x = %.3f, coverage %.2f%s\n",
               (long long)mesh->number, mesh->vertex_count, mesh->face_count, x, mesh->coverage,
               mesh->good ? "" : ", below the bar");
        npg_result_close(&mesh);
    }
    return status == NPG_END ? NPG_OK : status;
}

int main(int argc, char **argv)
{
    static const char *const settings[][2] = {
        {"pull", "yes"}, /* input and output stay empty: frames are pushed, meshes only pulled */
        {"epochs", "20"},
        {"faces", "800"},
        {"poisson-depth", "6"}};
    npg_options *options = NULL;
    npg_run *run = NULL;
    pthread_t thread;
    npg_status status = npg_options_open(&options);
    for (size_t i = 0; i < sizeof settings / sizeof *settings && !status; i++)
        status = npg_options_set(options, settings[i][0], settings[i][1]);
    if (!status) status = npg_run_open(&run, options, NULL);
    if (!status) {
        camera c = {.run = run, .frames = argc > 1 ? atoi(argv[1]) : 5};
        if (pthread_create(&thread, NULL, film, &c)) return 1;
        status = take_meshes(run);
        pthread_join(thread, NULL);
        if (!status) status = npg_run_wait(run); /* NPG_PARTIAL where frames fell below the quality bar */
        if (c.status) fprintf(stderr, "camera: %s\n", c.text);
    }
    if (status < 0) fprintf(stderr, "push_pull: %s\n", npg_error_text());
    npg_run_close(&run);
    npg_options_close(&options);
    return npg_status_exit_code(status);
}
