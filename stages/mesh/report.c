/* Report: figures and warnings of the stage that makes the reference. */
#include "mesh/report.h"

#include <stdarg.h>
#include <stdio.h>

void npg_mesh_note(npg_worker *worker, const char *key, double value)
{
    json_object_set_new(npg_worker_report(worker), key, json_real(value));
}

void npg_mesh_note_count(npg_worker *worker, const char *key, size_t value)
{
    json_object_set_new(npg_worker_report(worker), key, json_integer((json_int_t)value));
}

void npg_mesh_warn(npg_worker *worker, bool partial, int64_t frame, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE)
        npg_worker_warn(worker, partial, frame, "%s", text);
    else
        npg_worker_log(worker, NPG_LOG_INFO, frame, "%s", text);
}
