/* What the tests of rigs share: small images, and a folder to put them in. */
#ifndef NPG_RIG_HELPERS_H
#define NPG_RIG_HELPERS_H

#include <png.h>
#include <stdint.h>

#include <jpeglib.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/memory.h"
#include "tests/support/temp_folder.h"

enum { WIDE = 40, HIGH = 30 };

/* The settings without any option. */
static npg_rig_settings usual_settings(void)
{
    return (npg_rig_settings){.step_share = 0.02, .margin = 1};
}

static temp_folder folder;

static inline int open_rig_tests(void **state)
{
    (void)state;
    return open_temp_folder(&folder);
}

static inline int close_rig_tests(void **state)
{
    (void)state;
    close_temp_folder(&folder);
    return npg_memory_used() ? -1 : 0;
}

static inline void make_folder(const char *name)
{
    mkdir(in_folder(&folder, name), 0777);
}

static inline void write_png(const char *name, int format, int width, int height, const void *pixels)
{
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)width,
                       .height = (png_uint_32)height,
                       .format = (png_uint_32)format};
    assert_true(png_image_write_to_file(&image, in_folder(&folder, name), 0, pixels, 0, NULL));
}

/* A plane across the picture, 1000 steps away on the left and 1000 + slope per column further right. */
static inline void write_depth(const char *name, int slope)
{
    static uint16_t depth[WIDE * HIGH];
    for (int i = 0; i < WIDE * HIGH; i++) depth[i] = (uint16_t)(1000 + slope * (i % WIDE));
    write_png(name, PNG_FORMAT_LINEAR_Y, WIDE, HIGH, depth);
}

/* Red grows to the right, green downwards. */
static inline void write_colour(const char *name)
{
    static uint8_t colour[WIDE * HIGH * 3];
    for (int i = 0; i < WIDE * HIGH; i++) {
        colour[3 * i] = (uint8_t)(5 * (i % WIDE));
        colour[3 * i + 1] = (uint8_t)(5 * (i / WIDE));
        colour[3 * i + 2] = 77;
    }
    write_png(name, PNG_FORMAT_RGB, WIDE, HIGH, colour);
}

/* 255 in the left half, 0 in the right one. */
static inline void write_mask_jpeg(const char *name)
{
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    FILE *file = fopen(in_folder(&folder, name), "wb");
    assert_non_null(file);
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_stdio_dest(&jpeg, file);
    jpeg.image_width = WIDE;
    jpeg.image_height = HIGH;
    jpeg.input_components = 1;
    jpeg.in_color_space = JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    for (int y = 0; y < HIGH; y++) {
        uint8_t row[WIDE];
        JSAMPROW rows = row;
        for (int x = 0; x < WIDE; x++) row[x] = x < WIDE / 2 ? 255 : 0;
        jpeg_write_scanlines(&jpeg, &rows, 1);
    }
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    fclose(file);
}

static inline void write_text(const char *name, const char *text)
{
    assert_int_equal(write_text_file(in_folder(&folder, name), text), 0);
}

#define CAMERA                                                                                               \
    "\"camera\": {\"width\": 40, \"height\": 30, \"fx\": 50, \"fy\": 50, \"cx\": 19.5, \"cy\": 14.5}"
#define POSE "\"pose\": [1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1]"

/* Load a rig of the folder and read one frame of it. */
static inline npg_status read_rig_frame(npg_frame *frame, const char *name, size_t at,
                                        const npg_rig_settings *settings)
{
    npg_rig_settings usual = usual_settings();
    npg_origin origin = {.known = true};
    npg_rig *rig;
    *frame = (npg_frame){0};
    npg_status status = npg_rig_open(&rig, in_folder(&folder, name), settings ? settings : &usual);
    if (!status) status = npg_rig_read(rig, frame, at, &origin);
    npg_rig_close(&rig);
    return status;
}

#endif
