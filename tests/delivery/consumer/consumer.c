/* A program outside the project that uses the installed package. */
#include <neupig.h>
#include <stdio.h>
#include <string.h>

int main(void)
{
    static const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const uint32_t faces[] = {0, 1, 2};
    static const float point[] = {0.25f, 0.25f, 2};
    npg_options *options = NULL;
    npg_surface *surface = NULL;
    npg_surface_hit hit;
    if (npg_options_open(&options) || npg_options_set(options, "seed", "7")) return 1;
    if (strcmp(npg_options_get(options, "seed"), "7") != 0) return 2;
    if (npg_options_set(options, "no-such-option", "1") != NPG_USAGE) return 3;
    npg_options_close(&options);
    if (npg_surface_open(&surface, corners, 3, faces, 1)) return 4;
    if (npg_surface_closest(surface, &hit, point, 1) || hit.face != 0 || hit.dist_sq != 4) return 5;
    npg_surface_close(&surface);
    printf("neupig %s\n", npg_version());
    return 0;
}
