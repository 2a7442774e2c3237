/* Pictures in a page: drawn here and now, as data URIs. */
#include <stdio.h>

#include "pipeline/memory.h"
#include "tools/base64.h"
#include "tools/batch/batch_page.h"
#include "tools/render/render_image.h"

enum { HEIGHT = 260, SAMPLES = 2 };
#define ASPECT      1.2
#define BALL_RADIUS 0.0035 /* of a cloud's points, in diagonals */

static npg_status draw(npg_image *image, const char *path, const char *reach_of)
{
    npg_bounds reach = npg_bounds_empty();
    npg_origin origin = {0};
    npg_scene scene;
    npg_eye eye;
    double aspect = ASPECT;
    npg_eye_turn(&eye, 25, 12, 1);
    NPG_TRY(npg_scene_measure(&reach, path, &origin, eye.axes));
    if (reach_of) NPG_TRY(npg_scene_measure(&reach, reach_of, &origin, eye.axes));
    if (!(reach.lo[0] <= reach.hi[0])) return npg_error(NPG_BAD_INPUT, "%s: nothing to draw", path);
    npg_eye_fit(&eye, &aspect, &reach);
    NPG_TRY(npg_scene_open(&scene, path, &origin, BALL_RADIUS * npg_bounds_diagonal(&reach), NPG_COLOUR_PLAIN,
                           NULL));
    npg_status status = npg_image_open(image, (int64_t)(ASPECT * HEIGHT), HEIGHT);
    if (!status) status = npg_image_draw(image, &scene, &eye, 0, 0, image->width, image->height, SAMPLES);
    npg_scene_close(&scene);
    return status;
}

npg_status npg_page_picture(npg_file *page, const char *path, const char *reach_of, const char *caption)
{
    npg_image image = {0};
    void *bytes = NULL;
    size_t size = 0;
    npg_status status = draw(&image, path, reach_of);
    if (!status) status = npg_image_encode(&image, &bytes, &size);
    npg_file_print(page, "<figure>");
    if (status) {
        npg_file_print(page, "<p class=\"none\">no picture: ");
        npg_page_text(page, npg_error_text());
        npg_file_print(page, "</p>");
    } else {
        npg_file_print(page, "<img width=\"%d\" height=\"%d\" alt=\"", (int)image.width, (int)image.height);
        npg_page_text(page, caption);
        npg_file_print(page, "\" src=\"data:image/png;base64,");
        npg_base64_write(page, bytes, size);
        npg_file_print(page, "\"/>");
    }
    npg_file_print(page, "<figcaption>");
    npg_page_text(page, caption);
    npg_file_print(page, "</figcaption></figure>\n");
    npg_release(&bytes);
    npg_image_close(&image);
    return status == NPG_MEMORY ? status : NPG_OK;
}
