/* Door of the export room: what tools use of it.
 *
 * apply.h: a mesh carried through a run (neupig apply).  picture.h: files drawn to a PNG (neupig render).
 * writer.h: one mesh into a file (neupig synth).  placement.h: the capture's coordinates to those of the
 * written files (neupig view). */
#ifndef NPG_EXPORT_H
#define NPG_EXPORT_H

#include "export/apply.h"
#include "export/export_folder.h"
#include "export/forms/placement.h"
#include "export/forms/writer.h"
#include "export/picture.h"

#endif
