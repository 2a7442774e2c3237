/* Names of OpenCL errors, and the status they become. */
#ifndef NPG_CL_ERROR_H
#define NPG_CL_ERROR_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <stdbool.h>

#include "pipeline/status.h"

/* NPG_OK for CL_SUCCESS; else NPG_MEMORY or NPG_DEVICE with "what: CL_NAME (code)". */
npg_status npg_cl_status(cl_int code, const char *what);

#endif
