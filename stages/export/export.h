/* Door of the export room: one mesh into a file, names and folder of results, and the coordinates of written files. */
#ifndef NPG_EXPORT_H
#define NPG_EXPORT_H

#include "export/files.h"

/* Names of the exporters, as help has them. */
#define NPG_EXPORT_FORMS "ply,obj,pc2,mdd,glb,glb-meshopt,vat,usda,npz,vdb"

#endif
