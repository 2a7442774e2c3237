/* Door of the export room: what tools use of it.
 *
 * apply.h: a mesh carried through a run (neupig apply).  picture.h: files drawn to a PNG (neupig render).
 * files.h: one mesh into a file (neupig synth), and the capture's coordinates to those of the written files
 * (neupig view). */
#ifndef NPG_EXPORT_H
#define NPG_EXPORT_H

#include "export/apply.h"
#include "export/files.h"
#include "export/picture.h"

#endif
