/* A frame to make a capture of. */
#ifndef NPG_TEST_WRITE_BALL_H
#define NPG_TEST_WRITE_BALL_H

#include <math.h>
#include <stdio.h>

/* A ball whose middle is at x = away, and its normals; other points of it in every frame. */
static inline int write_ball(const char *path, int points, int frame, double away)
{
    FILE *file = fopen(path, "w");
    if (!file) return -1;
    fprintf(file, "ply\nformat ascii 1.0\nelement vertex %d\n", points);
    fputs("property float x\nproperty float y\nproperty float z\n", file);
    fputs("property float nx\nproperty float ny\nproperty float nz\nend_header\n", file);
    for (int i = 0; i < points; i++) {
        double z = 1 - 2 * (i + 0.5) / points, turn = 2.399963229728653 * i + frame, flat = sqrt(1 - z * z);
        double x = flat * cos(turn), y = flat * sin(turn);
        fprintf(file, "%.6f %.6f %.6f %.6f %.6f %.6f\n", x + away, y, z, x, y, z);
    }
    return fclose(file);
}

#endif
