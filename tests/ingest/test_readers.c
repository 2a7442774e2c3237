/* Readers: every format in every variant, against values that are known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <lzf.h>
#include <math.h>
#include <sys/wait.h>

#include "pipeline/source.h"
#include "tests/ingest/read_helpers.h"

enum { N = 5 };

/* Whole numbers that every type can hold, and a unit normal along an axis. */
static double truth_pos(size_t i, size_t axis)
{
    return (double)(10 * i + 3 * axis + 1);
}

static double truth_normal(size_t i, size_t axis)
{
    return i % 3 == axis ? 1 : 0;
}

static void check_cloud(const npg_frame *frame, const npg_origin *origin, bool has_normals)
{
    assert_int_equal(frame->point_count, N);
    assert_true((frame->normals != NULL) == has_normals);
    for (size_t i = 0; i < N; i++)
        for (size_t a = 0; a < 3; a++) {
            double world = (double)frame->pos_local[3 * i + a] + origin->world[a];
            assert_true(world == truth_pos(i, a));
            if (has_normals) assert_true((double)frame->normals[3 * i + a] == truth_normal(i, a));
        }
}

static void read_and_check(const char *path, bool has_normals)
{
    npg_frame frame;
    npg_origin origin = {0};
    if (read_within_bounds(&frame, path, &origin)) fail_msg("%s", npg_error_text());
    check_cloud(&frame, &origin, has_normals);
    npg_frame_clear(&frame);
}

/* ---- PLY ---- */

static const char *const type_names[] = {"char",  "uint8", "short", "ushort",
                                         "int32", "uint",  "float", "float64"};
static const size_t type_sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};

enum { ASCII, LITTLE, BIG };

static void put_value(bytes *b, double value, int type, int format)
{
    char text[32];
    if (format == ASCII) {
        snprintf(text, sizeof text, "%g ", value);
        put_text(b, text);
    } else if (type == 6) {
        put_float(b, (float)value, format == BIG);
    } else if (type == 7) {
        put_double(b, value, format == BIG);
    } else {
        put_bits(b, (uint64_t)(int64_t)value, type_sizes[type], format == BIG);
    }
}

static void end_row(bytes *b, int format, const char *line_end)
{
    if (format == ASCII) put_text(b, line_end);
}

/* A PLY whose columns stand in the order of `columns` ("xyzabc": a b c are the normal, ? is of no interest),
 * with a list element before the vertices and faces after them. */
static void make_ply(bytes *b, int format, const char *columns, const int *types, const char *line_end)
{
    static const char *const formats[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    char text[128];
    *b = (bytes){.size = 0};
    snprintf(text, sizeof text, "ply%sformat %s 1.0%scomment made by a test%s", line_end, formats[format],
             line_end, line_end);
    put_text(b, text);
    snprintf(text, sizeof text, "element strip 2%sproperty list uchar short ids%sproperty float w%s",
             line_end, line_end, line_end);
    put_text(b, text);
    snprintf(text, sizeof text, "element vertex %d%s", N, line_end);
    put_text(b, text);
    for (size_t c = 0; columns[c]; c++) {
        static const char *const names[] = {"x", "y", "z", "nx", "ny", "nz"};
        const char *letters = "xyzabc", *at = strchr(letters, columns[c]);
        char name[32];
        snprintf(name, sizeof name, "quality%zu", c);
        snprintf(text, sizeof text, "property %s %s%s", type_names[types[c]], at ? names[at - letters] : name,
                 line_end);
        put_text(b, text);
    }
    snprintf(text, sizeof text, "element face 1%sproperty list uchar int vertex_indices%send_header%s",
             line_end, line_end, line_end);
    put_text(b, text);
    for (int row = 0; row < 2; row++) {
        put_value(b, row + 1, 1, format);
        for (int k = 0; k <= row; k++) put_value(b, -7, 2, format);
        put_value(b, 0.5, 6, format);
        end_row(b, format, line_end);
    }
    for (size_t i = 0; i < N; i++) {
        for (size_t c = 0; columns[c]; c++) {
            const char *at = strchr("xyz", columns[c]), *normal = strchr("abc", columns[c]);
            double value = at       ? truth_pos(i, (size_t)(columns[c] - 'x'))
                           : normal ? truth_normal(i, (size_t)(columns[c] - 'a'))
                                    : 99;
            put_value(b, value, types[c], format);
        }
        end_row(b, format, line_end);
    }
    put_value(b, 3, 1, format);
    for (int k = 0; k < 3; k++) put_value(b, k, 4, format);
    end_row(b, format, line_end);
}

static void ply_of_every_type_order_and_line_end(void **state)
{
    (void)state;
    static const char *const orders[] = {"xyz", "zyx", "xyzabc", "abcxyz", "?x?y?z?", "cx?byaz"};
    static const char *const line_ends[] = {"\n", "\r\n", "\r"};
    static bytes b;
    for (int format = ASCII; format <= BIG; format++)
        for (size_t order = 0; order < 6; order++)
            for (int type = 0; type < 8; type++)
                for (size_t e = 0; e < 3; e++) {
                    int types[8];
                    for (int c = 0; c < 8; c++) types[c] = type;
                    make_ply(&b, format, orders[order], types, line_ends[e]);
                    read_and_check(save("types.ply", b.data, b.size), strchr(orders[order], 'a') != NULL);
                }
}

static void ply_of_mixed_types(void **state)
{
    (void)state;
    static bytes b;
    for (int format = ASCII; format <= BIG; format++)
        for (int shift = 0; shift < 8; shift++) {
            int types[8];
            for (int c = 0; c < 8; c++) types[c] = (3 * c + shift) % 8;
            make_ply(&b, format, "a?xbyc?z", types, "\n");
            read_and_check(save("mixed.ply", b.data, b.size), true);
        }
}

static void a_name_that_lies_does_not_matter(void **state)
{
    (void)state;
    static bytes b;
    int types[8] = {6, 6, 6, 6, 6, 6, 6, 6};
    make_ply(&b, LITTLE, "xyz", types, "\n");
    read_and_check(save("cloud.xyz", b.data, b.size), false);
    read_and_check(save("cloud", b.data, b.size), false);
    assert_string_equal(npg_reader_for(in_folder(&folder, "cloud")), "ply");
    assert_string_equal(npg_reader_for("nowhere.XYZ"), "xyz");
    assert_null(npg_reader_for("nowhere.jpg"));
}

/* ---- texts: XYZ, OBJ, PCD, ascii PLY ---- */

static const struct text_case {
    const char *name, *text;
    bool has_normals;
} text_cases[] = {
    {"a.xyz", "1 4 7\n11 14 17\n21 24 27\n31 34 37\n41 44 47\n", false},
    {"b.xyz", "1 4 7\n11 14 17\n21 24 27\n31 34 37\n41 44 47", false},
    {"c.txt", "# a comment\n\n1,4,7\r\n 11 , 14 , 17 \r\n21,24,27\r\n// one more\r\n31,34,37\r\n41,44,47\r\n",
     false},
    {"d.txt", "X;Y;Z\n1;4;7;\n11;14;17;\n21;24;27;\n31;34;37;\n41;44;47;\n", false},
    {"e.txt", "x y z\n1\t4\t7\n1.1e1 14. +17\n21 24 27\n31 34 37\n41 44 47\n", false},
    {"f.pts", "5\n1 4 7 0.5\n11 14 17 0.5\n21 24 27 0.5\n31 34 37 0.5\n41 44 47 0.5\n", false},
    {"g.xyz", "1 4 7 255 0 0\n11 14 17 0 255 0\n21 24 27 9 9 9\n31 34 37 0 0 0\n41 44 47 0 1 0\n", false},
    {"h.xyz", "1 4 7 1 0 0\n11 14 17 0 1 0\n21 24 27 0 0 1\n31 34 37 1 0 0\n41 44 47 0 1 0\n", true},
    {"i.xyz",
     "1 4 7 1 0 0 9 9\n11 14 17 0 1 0 9 9\n21 24 27 0 0 1 9 9\n31 34 37 1 0 0 9 9\n41 44 47 0 1 0 9 9\n",
     true},
    {"j.xyzn", "1 4 7 9 0 0\n11 14 17 0 8 0\n21 24 27 0 0 .1\n31 34 37 1 0 0\n41 44 47 0 1 0\n", true},
    {"k.xyz",
     "\xef\xbb\xbf"
     "1 4 7\n11 14 17\n21 24 27\n31 34 37\n41 44 47\n",
     false},
    {"l.xyz", "1 4 7\r11 14 17\r21 24 27\r31 34 37\r41 44 47\r", false},
    {"m.xyz", "1 4 7 1 0 0\n11 14 17 9 9 9\n21 24 27 9 9 9\n31 34 37 9 9 9\n41 44 47 9 9 9\n", false},
    {"a.obj", "# c\nmtllib a.mtl\no body\nv 1 4 7\nv 11 14 17\nv 21 24 27\nv 31 34 37\nv 41 44 47\n", false},
    {"b.obj",
     "v 1 4 7 1\nv 11 14 17 1.0\nv 21 24 27 1\nv 31 34 37 1\nv 41 44 47 1\n"
     "vn 3 0 0\nvn 0 1 0\nvn 0 0 1\nvn 1 0 0\nvn 0 1 0\n",
     true},
    {"c.obj",
     "v 1 4 7 1 0 0\nv 11 14 17 1 0 0\nv 21 24 27 1 0 0\nv 31 34 37 1 0 0\nv 41 44 47 1 0 0\n"
     "vn 1 0 0\nvn 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/2 3/1/3\nf 4/1/1 5/1/2 -3/1/-1\n",
     true},
    {"d.obj", "v 1 4 7\r\nv 11 14 17\r\nv 21 24 27\r\nv 31 34 37\r\nv 41 44 47\r\ng a b\r\nf 1 2 3\r\n",
     false},
    {"a.pcd",
     "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n"
     "COUNT 1 1 1\nWIDTH 5\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA ascii\n"
     "1 4 7\n11 14 17\n21 24 27\n31 34 37\n41 44 47\n",
     false},
    {"b.pcd",
     "VERSION .7\nFIELDS rgb x y z normal_x normal_y normal_z\nSIZE 4 8 8 8 4 4 4\nTYPE U F F F F F F\n"
     "COUNT 1 1 1 1 1 1 1\nWIDTH 5\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA ascii\n"
     "9 1 4 7 1 0 0\n9 11 14 17 0 1 0\n9 21 24 27 0 0 1\n9 31 34 37 1 0 0\n9 41 44 47 0 1 0\n",
     true},
    {"c.pcd",
     "VERSION .7\nFIELDS x y z stamp\nSIZE 4 4 2 8\nTYPE F F I U\n"
     "COUNT 1 1 1 1\nWIDTH 5\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA ascii\n"
     "1 4 7 1763650000123456789\n11 14 17 2\n21 24 27 3\n31 34 37 4\n41 44 47 5\n",
     false},
    {"a.ply",
     "ply\nformat ascii 1.0\nobj_info x\nelement vertex 5\nproperty float z\nproperty double y\n"
     "property float x\nend_header\n\n7 4 1\n  17 14 11  \n27 24 21\n37 34 31\n47 44 41",
     false},
};

static void texts_in_every_form(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof text_cases / sizeof *text_cases; i++) {
        const struct text_case *c = &text_cases[i];
        print_message("%s\n", c->name);
        read_and_check(save(c->name, c->text, strlen(c->text)), c->has_normals);
    }
}

/* ---- binary PCD ---- */

static void put_pcd_header(bytes *b, const char *data)
{
    *b = (bytes){.size = 0};
    put_text(b, "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 5\nHEIGHT 1\n"
                "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA ");
    put_text(b, data);
    put_text(b, "\n");
}

static void pcd_in_bytes(void **state)
{
    (void)state;
    static bytes b;
    put_pcd_header(&b, "binary");
    for (size_t i = 0; i < N; i++)
        for (size_t a = 0; a < 3; a++) put_float(&b, (float)truth_pos(i, a), false);
    read_and_check(save("binary.pcd", b.data, b.size), false);

    /* Compressed: column by column, here as literal runs of up to 32 bytes behind their length - 1. */
    static bytes plain;
    plain.size = 0;
    for (size_t a = 0; a < 3; a++)
        for (size_t i = 0; i < N; i++) put_float(&plain, (float)truth_pos(i, a), false);
    put_pcd_header(&b, "binary_compressed");
    put_bits(&b, plain.size + 2, 4, false);
    put_bits(&b, plain.size, 4, false);
    for (size_t at = 0; at < plain.size; at += 32) {
        size_t run = plain.size - at < 32 ? plain.size - at : 32;
        put_bits(&b, run - 1, 1, false);
        put_bytes(&b, plain.data + at, run);
    }
    read_and_check(save("compressed.pcd", b.data, b.size), false);
}

/* A colour is the bits of a number of any type; what is packed has repeats, so that all of LZF is used. */
static void pcd_with_colours(void **state)
{
    (void)state;
    enum { POINTS = 400 };
    static const char *const forms[] = {"ascii", "binary", "binary_compressed"};
    for (size_t form = 0; form < 6; form++) {
        static bytes b, plain;
        static unsigned char packed[20 * POINTS];
        bool is_float = form >= 3, is_packed = form % 3 == 2;
        b.size = plain.size = 0;
        put_text(&b, is_float ? "FIELDS x y z w rgb\nSIZE 4 4 4 2 4\nTYPE F F F I F\n"
                              : "FIELDS x y z w rgb\nSIZE 4 4 4 2 4\nTYPE F F F I U\n");
        put_text(&b, "COUNT 1 1 1 2 1\nWIDTH 200\nHEIGHT 2\nDATA ");
        put_text(&b, forms[form % 3]);
        put_text(&b, "\n");
        for (size_t column = 0; column < (is_packed ? 5 : 1); column++)
            for (unsigned i = 0; i < POINTS; i++) {
                uint32_t colour = 0x3f0a0bu + (i % 7 << 4);
                float as_float;
                char text[100];
                memcpy(&as_float, &colour, sizeof colour);
                snprintf(text, sizeof text, "%u -1.5 0 %u 2 %.9g\n", i, i,
                         is_float ? (double)as_float : (double)colour);
                if (form % 3 == 0) put_text(&plain, text);
                if (form % 3 == 0) continue;
                if (!is_packed || column == 0) put_float(&plain, (float)i, false);
                if (!is_packed || column == 1) put_float(&plain, -1.5f, false);
                if (!is_packed || column == 2) put_float(&plain, 0, false);
                if (!is_packed || column == 3) put_bits(&plain, i | 2u << 16, 4, false);
                if (!is_packed || column == 4) put_bits(&plain, colour, 4, false);
            }
        if (is_packed) {
            unsigned size = lzf_compress(plain.data, (unsigned)plain.size, packed, sizeof packed);
            assert_in_range(size, 1, plain.size / 2);
            put_bits(&b, size, 4, false);
            put_bits(&b, plain.size, 4, false);
            put_bytes(&b, packed, size);
        } else {
            put_bytes(&b, plain.data, plain.size);
        }
        npg_frame frame;
        npg_origin origin = {.known = true};
        if (read_within_bounds(&frame, save("colours.pcd", b.data, b.size), &origin))
            fail_msg("%s", npg_error_text());
        assert_int_equal(frame.point_count, POINTS);
        for (size_t i = 0; i < POINTS; i++) {
            const uint8_t wanted[4] = {0x3f, 0x0a, (uint8_t)(0x0b + (i % 7 << 4)), 255};
            assert_memory_equal(frame.colours + 4 * i, wanted, 4);
            assert_true(frame.pos_local[3 * i] == (float)i && frame.pos_local[3 * i + 1] == -1.5f);
        }
        npg_frame_clear(&frame);
    }
}

/* ---- NPY ---- */

static void make_npy(bytes *b, int version, bool is_double, bool is_big, bool is_fortran, size_t columns)
{
    char text[256];
    *b = (bytes){.size = 0};
    put_bytes(b, "\x93NUMPY", 6);
    put_bits(b, (uint64_t)version, 1, false);
    put_bits(b, 0, 1, false);
    snprintf(text, sizeof text, "{'descr': '%c%s', 'fortran_order': %s, 'shape': (%d, %zu), }%*s\n",
             is_big ? '>' : '<', is_double ? "f8" : "f4", is_fortran ? "True" : "False", N, columns, 20, "");
    put_bits(b, strlen(text), version == 1 ? 2 : 4, false);
    put_text(b, text);
    for (size_t k = 0; k < N * columns; k++) {
        size_t i = is_fortran ? k % N : k / columns, c = is_fortran ? k / N : k % columns;
        double value = c < 3 ? truth_pos(i, c) : truth_normal(i, c - 3);
        if (is_double)
            put_double(b, value, is_big);
        else
            put_float(b, (float)value, is_big);
    }
}

static void npy_of_every_kind(void **state)
{
    (void)state;
    static bytes b;
    for (int version = 1; version <= 3; version++)
        for (int kind = 0; kind < 16; kind++) {
            size_t columns = kind & 8 ? 6 : 3;
            make_npy(&b, version, kind & 1, kind & 2, kind & 4, columns);
            read_and_check(save("a.npy", b.data, b.size), columns == 6);
        }
}

/* ---- far from 0, not finite, empty ---- */

static void check_far(const char *path)
{
    npg_frame frame;
    npg_origin origin = {0};
    if (read_within_bounds(&frame, path, &origin)) fail_msg("%s", npg_error_text());
    assert_int_equal(frame.point_count, 2);
    const double truth[] = {1000000.001, -2000000.002, 5.25, 1000000.003, -2000000.004, 6.5};
    for (size_t k = 0; k < 6; k++)
        assert_true(fabs((double)frame.pos_local[k] + origin.world[k % 3] - truth[k]) < 1e-6);
    npg_frame_clear(&frame);
}

static void millimetres_at_a_million(void **state)
{
    (void)state;
    const char *rows = "1000000.001 -2000000.002 5.25\n1000000.003 -2000000.004 6.5\n";
    static const char *const heads[][2] = {
        {"far.xyz", ""},
        {"far.ply", "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n"
                    "property double z\nend_header\n"},
        {"far.pcd", "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
                    "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n"}};
    char text[1024];
    for (size_t i = 0; i < 3; i++) {
        snprintf(text, sizeof text, "%s%s", heads[i][1], rows);
        check_far(save(heads[i][0], text, strlen(text)));
    }
    const char *obj = "v 1000000.001 -2000000.002 5.25\nv 1000000.003 -2000000.004 6.5\n";
    check_far(save("far.obj", obj, strlen(obj)));
}

static void a_first_point_at_zero_costs_no_detail(void **state)
{
    (void)state;
    char text[4096] = "0 0 0\n";
    size_t used = strlen(text);
    for (int i = 0; i < 50; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, "%.3f 2000000.5 -3000000.25\n",
                                 1e6 + i * 0.001);
    npg_frame frame;
    npg_origin origin = {0};
    assert_int_equal(read_within_bounds(&frame, save("zero.xyz", text, used), &origin), NPG_OK);
    assert_int_equal(frame.point_count, 51);
    for (size_t i = 1; i < 51; i++) {
        double x = (double)frame.pos_local[3 * i] + origin.world[0];
        assert_true(fabs(x - (1e6 + (double)(i - 1) * 0.001)) < 1e-6);
    }
    npg_frame_clear(&frame);
}

static void points_that_are_not_finite_are_kept(void **state)
{
    (void)state;
    const char *text = "nan 1 2\n1e999 -inf Infinity\n-nan(ind) 1.#QNAN 1.#INF\n7 8 9\n";
    npg_frame frame;
    npg_origin origin = {0};
    assert_int_equal(read_within_bounds(&frame, save("nan.xyz", text, strlen(text)), &origin), NPG_OK);
    assert_int_equal(frame.point_count, 4);
    assert_true(origin.known && origin.world[0] == 7 && origin.world[1] == 8 && origin.world[2] == 9);
    for (size_t i = 0; i < 3; i++) assert_false(isfinite(frame.pos_local[3 * i]));
    assert_true(frame.pos_local[9] == 0);
    npg_frame_clear(&frame);
}

static void no_points_is_no_failure(void **state)
{
    (void)state;
    static const char *const files[][2] = {
        {"0.ply", "ply\nformat ascii 1.0\nelement vertex 0\n"
                  "property float x\nproperty float y\nproperty float z\nend_header\n"},
        {"0.xyz", "# nothing\n"},
        {"0.obj", "# nothing\n"},
        {"0.pts", "0\n"},
        {"0.pcd", "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 0\nHEIGHT 1\n"
                  "POINTS 0\nDATA ascii\n"}};
    for (size_t i = 0; i < 5; i++) {
        npg_frame frame;
        npg_origin origin = {0};
        const char *path = save(files[i][0], files[i][1], strlen(files[i][1]));
        if (read_within_bounds(&frame, path, &origin)) fail_msg("%s", npg_error_text());
        assert_int_equal(frame.point_count, 0);
        npg_frame_clear(&frame);
    }
}

/* ---- streams ---- */

/* A child writes the bytes a few at a time, as a pipe may deliver them. */
static int pipe_from(const unsigned char *data, size_t size, size_t step)
{
    int ends[2];
    if (pipe(ends)) abort();
    pid_t child = fork();
    if (child == 0) {
        close(ends[0]);
        for (size_t at = 0; at < size;) {
            ssize_t sent = write(ends[1], data + at, size - at < step ? size - at : step);
            if (sent <= 0) _exit(1);
            at += (size_t)sent;
        }
        _exit(0);
    }
    close(ends[1]);
    return ends[0];
}

static size_t make_stream(bytes *all)
{
    static bytes one;
    int types[8] = {6, 7, 6, 7, 6, 7, 6, 7};
    all->size = 0;
    for (int format = ASCII; format <= BIG; format++) {
        make_ply(&one, format, "xyzabc", types, format == LITTLE ? "\r\n" : "\n");
        put_bytes(all, one.data, one.size);
        if (format == ASCII) put_text(all, "\n\r\n");
        make_npy(&one, format + 1, format != ASCII, format == BIG, format == LITTLE, 6);
        put_bytes(all, one.data, one.size);
    }
    return 6;
}

static void frames_from_a_pipe(void **state)
{
    (void)state;
    static bytes all;
    size_t frames = make_stream(&all);
    for (size_t step = 1; step < 4000; step = step * 3 + 1) {
        npg_stream *stream;
        npg_frame frame = {0};
        npg_origin origin = {0};
        int fd = pipe_from(all.data, all.size, step);
        assert_int_equal(npg_stream_open(&stream, fd, "pipe", NULL, NULL), NPG_OK);
        for (size_t i = 0; i < frames; i++) {
            if (npg_stream_next(stream, &frame, &origin)) fail_msg("%s", npg_error_text());
            assert_int_equal(frame.number, i);
            check_cloud(&frame, &origin, true);
            npg_frame_clear(&frame);
        }
        assert_int_equal(npg_stream_next(stream, &frame, &origin), NPG_END);
        npg_stream_close(&stream);
        close(fd);
        assert_true(wait(NULL) > 0);
    }
}

static void a_stream_cut_anywhere(void **state)
{
    (void)state;
    static bytes all;
    make_stream(&all);
    for (size_t cut = 1; cut < all.size; cut += 7) {
        FILE *file = fopen(save("cut", all.data, cut), "rb");
        npg_stream *stream;
        npg_frame frame = {0};
        npg_origin origin = {0};
        npg_status status = npg_stream_open(&stream, fileno(file), "cut", NULL, NULL);
        size_t frames = 0;
        while (!status) {
            status = npg_stream_next(stream, &frame, &origin);
            frames += !status;
            npg_frame_clear(&frame);
        }
        assert_true(frames < 6);
        assert_true(status == NPG_END || (status == NPG_BAD_INPUT && strstr(npg_error_text(), "cut: ")));
        npg_stream_close(&stream);
        fclose(file);
    }
}

static bool stop_at_once(void *user)
{
    ++*(int *)user;
    return true;
}

static void a_silent_stream_can_be_stopped(void **state)
{
    (void)state;
    int ends[2], asked = 0;
    npg_stream *stream;
    npg_frame frame = {0};
    npg_origin origin = {0};
    assert_int_equal(pipe(ends), 0);
    assert_int_equal(npg_stream_open(&stream, ends[0], "silence", stop_at_once, &asked), NPG_OK);
    assert_int_equal(npg_stream_next(stream, &frame, &origin), NPG_STOPPED);
    assert_true(asked > 0);
    npg_stream_close(&stream);
    close(ends[0]);
    close(ends[1]);
}

/* ---- memory ---- */

static void no_memory_at_any_point(void **state)
{
    (void)state;
    static bytes b;
    int types[8] = {6, 6, 6, 6, 6, 6, 6, 6};
    make_ply(&b, ASCII, "xyzabc", types, "\n");
    save("memory.ply", b.data, b.size);
    make_npy(&b, 1, true, false, true, 6);
    save("memory.npy", b.data, b.size);
    save("memory.xyz", text_cases[7].text, strlen(text_cases[7].text));
    save("memory.obj", text_cases[15].text, strlen(text_cases[15].text));
    save("memory.pcd", text_cases[17].text, strlen(text_cases[17].text));
    static const char *const names[] = {"memory.ply", "memory.npy", "memory.xyz", "memory.obj", "memory.pcd"};
    for (size_t i = 0; i < 5; i++) {
        npg_status status = NPG_MEMORY;
        uint64_t n = 0;
        for (; status; n++) {
            npg_frame frame;
            npg_origin origin = {0};
            npg_memory_fail_at(n + 1, false);
            status = read_within_bounds(&frame, in_folder(&folder, names[i]), &origin);
            npg_memory_fail_at(0, false);
            if (status) assert_int_equal(status, NPG_MEMORY);
            npg_frame_clear(&frame);
        }
        assert_true(n > 3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(ply_of_every_type_order_and_line_end),
                                       cmocka_unit_test(ply_of_mixed_types),
                                       cmocka_unit_test(a_name_that_lies_does_not_matter),
                                       cmocka_unit_test(texts_in_every_form),
                                       cmocka_unit_test(pcd_in_bytes),
                                       cmocka_unit_test(pcd_with_colours),
                                       cmocka_unit_test(npy_of_every_kind),
                                       cmocka_unit_test(millimetres_at_a_million),
                                       cmocka_unit_test(a_first_point_at_zero_costs_no_detail),
                                       cmocka_unit_test(points_that_are_not_finite_are_kept),
                                       cmocka_unit_test(no_points_is_no_failure),
                                       cmocka_unit_test(frames_from_a_pipe),
                                       cmocka_unit_test(a_stream_cut_anywhere),
                                       cmocka_unit_test(a_silent_stream_can_be_stopped),
                                       cmocka_unit_test(no_memory_at_any_point)};
    return cmocka_run_group_tests(tests, open_reader_tests, close_reader_tests);
}
