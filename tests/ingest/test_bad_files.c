/* Bad files: each is refused with the file's name, the place and the cause, within the bounds of memory. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/ingest/read_helpers.h"

#define PLY(body) "ply\nformat ascii 1.0\n" body
#define XYZ       "property float x\nproperty float y\nproperty float z\n"
#define LE        "ply\nformat binary_little_endian 1.0\n"
#define PCD(size, type, width, points, data)                                                                 \
    "VERSION 0.7\nFIELDS x y z\nSIZE " size "\nTYPE " type "\nCOUNT 1 1 1\nWIDTH " width "\nHEIGHT 1\n"      \
    "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS " points "\nDATA " data "\n"
#define PCD3(width, points, data) PCD("4 4 4", "F F F", width, points, data)
#define NPY(length, dict)         "\x93NUMPY\x01\x00" length "\x00" dict

/* The bytes of a literal, zeros inside it included. */
#define BYTES(text) text, sizeof text - 1

static const struct bad_file {
    const char *name, *data;
    size_t size;
    const char *message; /* a part of what must be said, besides the path */
} bad_files[] = {
    /* PLY: the header */
    {"a.ply", BYTES(""), "empty"},
    {"a.ply", BYTES("pl"), "byte 0: not a PLY file"},
    {"a.ply", BYTES("plyx\nformat ascii 1.0\n"), "byte 0: not a PLY file"},
    {"a.ply", BYTES("ply\n"), "the file ends inside the header"},
    {"a.ply", BYTES("ply\nformat ascii 1.0\nelement vertex 1\n" XYZ),
     "line 6: the file ends inside the header"},
    {"a.ply", BYTES("ply\nelement vertex 1\n" XYZ "end_header\n1 2 3\n"),
     "line 6: the header names no format"},
    {"a.ply", BYTES("ply\nformat text 1.0\nend_header\n"), "line 2: unknown format \"text\""},
    {"a.ply", BYTES("ply\nformat ascii 2.0\nend_header\n"), "line 2: PLY version \"2.0\""},
    {"a.ply", BYTES("ply\nformat ascii\nend_header\n"), "line 2: \"format\" needs"},
    {"a.ply", BYTES(PLY("end_header\n")), "no element \"vertex\""},
    {"a.ply", BYTES(PLY("element face 0\nend_header\n")), "no element \"vertex\""},
    {"a.ply", BYTES(PLY("element vertex -5\n" XYZ "end_header\n")), "line 3: \"-5\" is not a count"},
    {"a.ply", BYTES(PLY("element vertex 4e9\n" XYZ "end_header\n")), "line 3: \"4e9\" is not a count"},
    {"a.ply", BYTES(PLY("element vertex 99999999999999999999\n" XYZ "end_header\n")),
     "line 3: impossible count"},
    {"a.ply", BYTES(PLY("element vertex 4000000000\n" XYZ "end_header\n1 2 3\n")),
     "claims 4000000000 of element \"vertex\", but only 6 bytes follow"},
    {"a.ply", BYTES(LE "element vertex 1000000000000\n" XYZ "end_header\nabcdefghijkl"),
     "claims 1000000000000 of element \"vertex\", but only 12 bytes"},
    {"a.ply",
     BYTES(PLY("element vertex 1\n" XYZ "element junk 900000000\nproperty int a\nend_header\n1 2 3\n")),
     "claims 900000000 of element \"junk\""},
    {"a.ply", BYTES(PLY("element vertex\n" XYZ "end_header\n")), "line 3: \"element\" needs"},
    {"a.ply", BYTES(PLY("element vertex 1\nelement vertex 1\n")), "line 4: second element \"vertex\""},
    {"a.ply", BYTES(PLY("property float x\n")), "line 3: a property before the first element"},
    {"a.ply", BYTES(PLY("element vertex 1\nproperty float128 x\n")), "line 4: unknown type \"float128\""},
    {"a.ply", BYTES(PLY("element vertex 1\nproperty float\n")),
     "line 4: \"property\" needs a type and a name"},
    {"a.ply", BYTES(PLY("element vertex 1\nproperty list uchar x\n")),
     "line 4: \"property\" needs two types"},
    {"a.ply", BYTES(PLY("element vertex 1\nproperty list float int x\n")),
     "line 4: the length of list \"x\""},
    {"a.ply", BYTES(PLY("element vertex 1\nproperty list quick int x\n")), "line 4: unknown type \"quick\""},
    {"a.ply", BYTES(PLY("element vertex 1\n" XYZ "property float x\n")), "line 7: second property \"x\""},
    {"a.ply", BYTES(PLY("element vertex 1\n" XYZ "property list uchar int n\nend_header\n1 2 3 0\n")),
     "list property \"n\" in element vertex"},
    {"a.ply", BYTES(PLY("element vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n")),
     "has no property z"},
    {"a.ply", BYTES(PLY("element vertex 1\n" XYZ "colour blue\nend_header\n")),
     "line 7: unknown word \"colour\""},
    {"a.ply", BYTES(PLY("element ver\0tex 1\n" XYZ "end_header\n")), "line 3: zero byte"},
    /* PLY: the body */
    {"a.ply", BYTES(PLY("element vertex 3\n" XYZ "end_header\n1 2 3\n1e30 0 0\n0 -1e300 0\n")),
     "2 of 3 points lie farther than 1e+12 away"},
    {"a.ply",
     BYTES(PLY("element vertex 1\n" XYZ "element face 1\nproperty list uchar int vertex_indices\n"
               "end_header\n1 2 3\n3 0 0 2147483647\n")),
     "face 0 uses vertex 2147483647, but there are only 1"},
    {"a.ply",
     BYTES(LE "element vertex 1\n" XYZ "element face 1\nproperty list uchar int vertex_indices\n"
              "end_header\n000011112222\x01\xff\xff\xff\x7f"),
     "face 0 uses vertex 2147483647, but there are only 1"},
    {"a.ply", BYTES(PLY("element vertex 2\n" XYZ "end_header\n1.2345 2.3456 3\n")),
     "the file ends in 1 of the 2 rows"},
    {"a.ply", BYTES(PLY("element vertex 2\n" XYZ "end_header\n1 2\n3 4 5.000\n")),
     "line 8: the row of element \"vertex\" ends early"},
    {"a.ply", BYTES(PLY("element vertex 2\n" XYZ "end_header\n1 2 3 4\n3 4 5\n")),
     "line 8: more values than element \"vertex\""},
    {"a.ply", BYTES(PLY("element vertex 2\n" XYZ "end_header\n1 2 zwei\n3 4 5\n")),
     "line 8: \"zwei\" is not a number"},
    {"a.ply", BYTES(PLY("element vertex 1\n" XYZ "end_header\n1 2 3\n4 5 6\n")),
     "byte 106: more data than the header declares"},
    {"a.ply", BYTES(LE "element vertex 2\n" XYZ "end_header\n000011112222"), "but only 12 bytes follow"},
    {"a.ply", BYTES(LE "element vertex 1\n" XYZ "end_header\n0000111122223"), "more data than the header"},
    {"a.ply",
     BYTES(LE "element vertex 1\n" XYZ "element face 1\nproperty list uchar int i\nend_header\n"
              "000011112222\xff"
              "abc"),
     "the file ends in 0 of the 1 rows of element \"face\""},
    {"a.ply",
     BYTES(LE "element face 1\nproperty list char int i\nelement vertex 1\n" XYZ "end_header\n"
              "\xff"
              "000011112222"),
     "list \"i\" of row 0 of element \"face\" has length -1"},
    /* XYZ */
    {"a.xyz", BYTES("1 2\n"), "line 1: 2 values where a point has at least 3"},
    {"a.xyz", BYTES("1 2 3\n4 5\n"), "line 2: 2 values where the first row has 3"},
    {"a.xyz", BYTES("1 2 3\n4 5 6 7\n"), "line 2: 4 values where the first row has 3"},
    {"a.xyz", BYTES("1 2 3\n4 fuenf 6\n"), "line 2: \"fuenf 6\" is not a number"},
    {"a.xyz", BYTES("one two three\n"), "line 1: \"one two three\" is not a number"},
    {"a.xyz", BYTES("1 2 3\n1,,3\n"), "line 2: \",3\" is not a number"},
    {"a.xyz", BYTES("1 2 3\n1 0x5 3\n"), "line 2: \"0x5 3\" is not a number"},
    {"a.xyz", BYTES("\0\0\0\0\0\0"), "line 1: "},
    {"a.xyzn", BYTES("1 2 3\n"), "line 1: 3 values where a point with a normal has 6"},
    {"a.pts", BYTES("3\n1 2 3\n4 5 6\n"), "line 1: claims 3 points, but 2 follow"},
    {"a.pts", BYTES("-3\n1 2 3\n"), "line 1: 1 value where"},
    /* NPY */
    {"a.npy", BYTES("\x93NUMPX\x01\x00"), "byte 0: not an NPY file"},
    {"a.npy", BYTES("\x93NUMPY\x01"), "byte 0: not an NPY file"},
    {"a.npy", BYTES("\x93NUMPY\x09\x00\x10\x00____"), "NPY version 9"},
    {"a.npy", BYTES("\x93NUMPY\x01\x00\xff\x00{'descr'"), "the file ends inside the header"},
    {"a.npy", BYTES("\x93NUMPY\x02\x00\xff\xff\xff\xff{'descr'"), "NPY header of 4294967295 bytes"},
    {"a.npy", BYTES(NPY("\x0c", "{'nothing': }")), "NPY header: type (descr) is neither"},
    {"a.npy", BYTES(NPY("\x36", "{'descr': '<i4', 'fortran_order': False, 'shape': (1,3)}")),
     "neither f4 nor f8"},
    {"a.npy", BYTES(NPY("\x36", "{'descr': [('x','<f4')], 'fortran_order': False, 'shape': (1,3)}")),
     "type (descr) is neither"},
    /* the header ends within the type, its last byte is that of the memory */
    {"a.npy",
     BYTES(
         NPY("\x3f",
             "                                                   'descr': '>f") "4', 'fortran_order': True"),
     "type (descr) is neither f4 nor f8"},
    {"a.npy", BYTES(NPY("\x36", "{'descr': '<f4', 'fortran_order': Maybe, 'shape': (1,3)}")),
     "fortran_order is not True or False"},
    {"a.npy", BYTES(NPY("\x36", "{'descr': '<f4', 'fortran_order': False, 'shape': (3,) }")), "not (N, 3)"},
    {"a.npy", BYTES(NPY("\x36", "{'descr': '<f4', 'fortran_order': False, 'shape': (1,4)}")), "not (N, 3)"},
    {"a.npy", BYTES(NPY("\x38", "{'descr': '<f4', 'fortran_order': False, 'shape': (1,3,1)}")), "not (N, 3)"},
    {"a.npy", BYTES(NPY("\x37", "{'descr': '<f4', 'fortran_order': False, 'shape': (-1,3)}")),
     "negative size"},
    {"a.npy", BYTES(NPY("\x3e", "{'descr': '<f8', 'fortran_order': True, 'shape': (99999999,3)}")),
     "claims 99999999 x 3 values"},
    {"a.npy", BYTES(NPY("\x38", "{'descr': '<f4', 'fortran_order': False, 'shape': (1,3)}") "0000111122"),
     "claims 1 x 3 values"},
    {"a.npy", BYTES(NPY("\x38", "{'descr': '<f4', 'fortran_order': False, 'shape': (1,3)}") "000011112222x"),
     "more data than the header"},
    /* OBJ */
    {"a.obj", BYTES("v 1 2\n"), "line 1: 2 values where there must be 3"},
    {"a.obj", BYTES("v 1 2 drei\n"), "line 1: \"drei\" is not a number"},
    {"a.obj", BYTES("v 1 2 3\nvn 1 0\n"), "line 2: 2 values where there must be 3"},
    {"a.obj", BYTES("v 1 2 3\nwhat is this\n"), "line 2: unknown word \"what\""},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"), "line 4: vertex 4 is not there (3 are)"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n"), "line 4: vertex 0 is not there"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n"), "line 4: vertex -4 is not there"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//2\n"),
     "line 5: normal 2 is not there"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n"), "line 4: a face of 2 corners"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 three\n"), "line 4: \"three\" is not an index"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3x\n"), "line 4: a corner that is not"},
    {"a.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n"), "is not there (3 are)"},
    /* PCD */
    {"a.pcd", BYTES("VERSION 0.7\n"), "the file ends inside the header"},
    {"a.pcd",
     BYTES("VERSION 0.7\n \nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3\n"),
     "line 2: an empty line in the header"},
    {"a.pcd", BYTES("VERSION 0.7\nFIELDS x y z\nSIZE 4 4\n"), "line 3: SIZE has 2 entries for 3 fields"},
    {"a.pcd", BYTES(PCD("9 -4 4", "F F F", "1", "1", "ascii") "1 2 3\n"), "line 3: field \"x\" has size 9"},
    {"a.pcd", BYTES(PCD("2 4 4", "F F F", "1", "1", "ascii") "1 2 3\n"), "field \"x\" is a float of 2 bytes"},
    {"a.pcd", BYTES(PCD("4 4 8", "F F I", "1", "1", "ascii") "1 2 3\n"),
     "field \"z\" is a whole number of 8 bytes"},
    {"a.pcd", BYTES(PCD("4 4 4", "F F Q", "1", "1", "ascii") "1 2 3\n"), "unknown type Q"},
    {"a.pcd", BYTES(PCD3("-1", "1", "ascii") "1 2 3\n"), "\"-1\" is not a count"},
    {"a.pcd", BYTES(PCD3("4", "1", "ascii") "1 2 3\n"), "4 x 1 is not 1 points"},
    {"a.pcd", BYTES(PCD3("99999999999", "99999999999", "ascii") "1 2 3\n"), "impossible size"},
    {"a.pcd", BYTES(PCD3("2", "2", "ascii") "1 2 3\n"), "claims 2 points, but 1 rows follow"},
    {"a.pcd", BYTES(PCD3("1", "1", "ascii") "1 2 3\n4 5 6\n"), "claims 1 points, but 2 rows follow"},
    {"a.pcd", BYTES(PCD3("1", "1", "ascii") "1 2 what\n"), "line 11: \"what\" is not a number"},
    {"a.pcd", BYTES(PCD3("1", "1", "ascii") "1 2\n"), "line 11: 2 values where a point has 3"},
    {"a.pcd", BYTES(PCD3("4000000000", "4000000000", "binary") "000011112222"), "claims 4000000000 points"},
    {"a.pcd", BYTES(PCD3("1", "1", "binary") "00001111222"),
     "claims 1 points (12 bytes), but 11 bytes follow"},
    {"a.pcd", BYTES(PCD3("1", "1", "binary_compressed") "00"), "the file ends before the data"},
    {"a.pcd", BYTES(PCD3("1", "1", "binary_compressed") "\xff\0\0\0\x0c\0\0\0abc"), "255 compressed bytes"},
    {"a.pcd", BYTES(PCD3("1", "1", "binary_compressed") "\x03\0\0\0\xff\0\0\0abc"),
     "claims 1 points (12 bytes)"},
    {"a.pcd", BYTES(PCD3("1", "1", "binary_compressed") "\x03\0\0\0\x0c\0\0\0\xff\xff\xff"),
     "the compressed data is damaged"},
    {"a.pcd", BYTES(PCD3("1", "1", "secret") "abc"), "unknown DATA \"secret\""},
    {"a.pcd", BYTES("VERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2\n"),
     "no single field z"},
    /* no format at all */
    {"a.jpg", BYTES("\xff\xd8\xff\xe0 JFIF"), "not a format that can be read"},
    {"a", BYTES("hello\n"), "not a format that can be read"},
};

static void every_bad_file_is_refused(void **state)
{
    (void)state;
    int failures = 0;
    for (size_t i = 0; i < sizeof bad_files / sizeof *bad_files; i++) {
        const struct bad_file *bad = &bad_files[i];
        npg_frame frame;
        npg_origin origin = {0};
        const char *path = save(bad->name, bad->data, bad->size);
        npg_status status = read_within_bounds(&frame, path, &origin);
        const char *text = npg_error_text();
        if (status == NPG_BAD_INPUT && !strncmp(text, path, strlen(path)) && strstr(text, bad->message))
            continue;
        print_error("case %zu: status %d, \"%s\" is not in: %s\n", i, status, bad->message, text);
        failures++;
        npg_frame_clear(&frame);
    }
    assert_int_equal(failures, 0);
    assert_true(sizeof bad_files / sizeof *bad_files >= 60);
}

static void files_that_can_not_be_opened(void **state)
{
    (void)state;
    npg_frame frame;
    npg_origin origin = {0};
    assert_int_equal(read_within_bounds(&frame, in_folder(&folder, "not-there.ply"), &origin), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "not-there.ply: can't be read: No such file"));
    assert_int_equal(read_within_bounds(&frame, folder.path, &origin), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "Is a directory"));
}

/* ---- meshes ---- */

#define TRIANGLE(face)                                                                                       \
    PLY("element vertex 3\n" XYZ "element face 1\nproperty list uchar int vertex_indices\n"                  \
        "end_header\n0 0 0\n1 0 0\n0 1 0\n" face "\n")

static const struct bad_file bad_meshes[] = {
    {"m.ply", BYTES(PLY("element vertex 1\n" XYZ "end_header\n1 2 3\n")), "no faces, so it is not a mesh"},
    {"m.ply",
     BYTES(PLY("element vertex 1\n" XYZ "element face 0\nproperty list uchar int vertex_indices\n"
               "end_header\n1 2 3\n")),
     "no faces, so it is not a mesh"},
    {"m.ply", BYTES(PLY("element vertex 1\n" XYZ "element face 1\nproperty int n\nend_header\n1 2 3\n3\n")),
     "has no list vertex_indices"},
    {"m.ply", BYTES(TRIANGLE("3 0 1 3")), "face 0 uses vertex 3, but there are only 3"},
    {"m.ply", BYTES(TRIANGLE("3 0 1 -1")), "face 0 uses vertex -1"},
    {"m.ply", BYTES(TRIANGLE("2 0 1")), "face 0 has 2 corners"},
    {"m.ply", BYTES(TRIANGLE("3 0 1")), "line 13: the row of element \"face\" ends early"},
    {"m.ply", BYTES(TRIANGLE("3 0 1 2 9")), "line 13: more values"},
    {"m.ply",
     BYTES(LE "element vertex 1\n" XYZ "element face 1\nproperty list uint int vertex_indices\n"
              "end_header\n000011112222\xff\xff\xff\xff"),
     "face 0 has 4294967295 corners"},
    {"m.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "no faces, so it is not a mesh"},
    {"m.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"), "line 4: vertex 9 is not there"},
    {"m.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/7\n"), "line 5: texture coordinate 7"},
    {"m.xyz", BYTES("0 0 0\n1 0 0\n"), "a mesh must be PLY or OBJ"},
    {"m.ply", BYTES(""), "m.ply"},
};

static void every_bad_mesh_is_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof bad_meshes / sizeof *bad_meshes; i++) {
        const struct bad_file *bad = &bad_meshes[i];
        npg_mesh *mesh;
        npg_origin origin = {0};
        size_t before = npg_memory_used();
        npg_status status = npg_read_mesh(&mesh, save(bad->name, bad->data, bad->size), &origin);
        if (status != NPG_BAD_INPUT) fail_msg("case %zu (%s): read as %d", i, bad->message, status);
        if (!strstr(npg_error_text(), bad->message))
            fail_msg("case %zu: \"%s\" is not in: %s", i, bad->message, npg_error_text());
        assert_null(mesh);
        assert_int_equal(npg_memory_used(), before);
    }
}

/* ---- damage at random ---- */

static uint32_t next_random(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*seed >> 33);
}

static const struct bad_file sound_files[] = {
    {"d.ply",
     BYTES(PLY("element vertex 2\n" XYZ "element face 1\nproperty list uchar int vertex_indices\n"
               "end_header\n0 0 0\n1 0 0\n3 0 1 1\n")),
     NULL},
    {"d.ply",
     BYTES(LE "element vertex 2\n" XYZ "element face 1\nproperty list uchar int vertex_indices\n"
              "end_header\n000011112222333344445555\x03\0\0\0\0\0\0\0\0\0\0\0\0"),
     NULL},
    {"d.obj", BYTES("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 -1//-1\n"), NULL},
    {"d.xyz", BYTES("1 2 3 0 0 1\n4 5 6 1e-3 0 -1\n"), NULL},
    {"d.npy", BYTES(NPY("\x38", "{'descr': '<f4', 'fortran_order': False, 'shape': (1,3)}") "000011112222"),
     NULL},
    {"d.pcd", BYTES(PCD3("2", "2", "ascii") "1 2 3\n4 5 6\n"), NULL},
};

/* Whatever a few wrong bytes make of a file: it is read or refused, never more. */
static void damaged_files_do_no_harm(void **state)
{
    (void)state;
    uint64_t seed = 3;
    char data[1024];
    for (size_t i = 0; i < sizeof sound_files / sizeof *sound_files; i++)
        for (int round = 0; round < 1500; round++) {
            size_t size = sound_files[i].size;
            memcpy(data, sound_files[i].data, size);
            for (uint32_t k = next_random(&seed) % 4 + 1; k; k--)
                data[next_random(&seed) % size] =
                    round % 2 ? (char)next_random(&seed) : "0123456789 \n-.e/"[next_random(&seed) % 16];
            if (round % 5 == 0) size = next_random(&seed) % size;
            const char *path = save(sound_files[i].name, data, size);
            npg_frame frame;
            npg_mesh *mesh = NULL;
            npg_origin origin = {0};
            npg_status status = read_within_bounds(&frame, path, &origin);
            assert_true(status == NPG_OK || status == NPG_BAD_INPUT);
            npg_frame_clear(&frame);
            status = npg_read_mesh(&mesh, path, &origin);
            assert_true(status == NPG_OK || status == NPG_BAD_INPUT);
            npg_mesh_unref(&mesh);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_bad_file_is_refused), cmocka_unit_test(files_that_can_not_be_opened),
        cmocka_unit_test(every_bad_mesh_is_refused), cmocka_unit_test(damaged_files_do_no_harm)};
    return cmocka_run_group_tests(tests, open_reader_tests, close_reader_tests);
}
