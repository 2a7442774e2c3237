/* Door of the export room: one mesh into a file, names and folder of results, and the coordinates of written files. */
#ifndef NPG_EXPORT_H
#define NPG_EXPORT_H

#include "export/files.h"

#endif
