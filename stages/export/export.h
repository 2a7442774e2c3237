/* Door of the export room: what tools use of it.
 *
 * apply.h: a mesh carried through a run (neupig apply).  picture.h: files drawn to a PNG (neupig render).
 * writer.h: one mesh into a file (neupig synth).  placement.h: the capture's coordinates to those of the
 * written files (neupig view). */
#ifndef NPG_EXPORT_H
#define NPG_EXPORT_H

#include "export/apply.h"
#include "export/forms/placement.h"
#include "export/forms/writer.h"
#include "export/picture.h"

typedef struct npg_mesh_names { /* how the mesh files of a run are called */
    const char *prefix, *ending;
    int width; /* digits of the number at least */
} npg_mesh_names;

enum { NPG_MESH_NAME_SIZE = 256 };

/* "<prefix>_<number>.<ending>". */
void npg_mesh_name(char name[NPG_MESH_NAME_SIZE], const npg_mesh_names *names, int64_t number);

/* Digits that the largest number needs, 4 at least. */
int npg_number_width(int64_t number_max);

/* Make OUT and see that bytes can be written into it, by writing and removing some.  NPG_DISK. */
npg_status npg_folder_probe(const char *output);

/* Remove what an earlier run left: done.json first, so that what remains can't pass for a whole result, then
 * its other files and the mesh files (<word>_<digits>.ply or .obj).  Files that no run makes stay. */
npg_status npg_folder_clear(const char *output);

#endif
