/* Page of a batch: one HTML file that needs no other, with pictures. */
#ifndef NPG_BATCH_PAGE_H
#define NPG_BATCH_PAGE_H

#include "pipeline/file.h"
#include "tools/batch/batch_figures.h"

/* Write OUT/batch.html.  figures: one for each capture.  A picture that can't be drawn
 * is replaced by the reason. */
npg_status npg_batch_page_write(const npg_batch *batch, const npg_capture_figures *figures);

/* ---- its parts ---- */

/* Text with what HTML and XML would misread replaced; bytes that are no UTF-8 become "?". */
void npg_page_text(npg_file *page, const char *text);

/* An <img> of a mesh or cloud, as a data URI (batch_picture.c).  reach_of: a second file that has to fit the
 * same view, or NULL.  A failure other than NPG_MEMORY is written in the picture's place. */
npg_status npg_page_picture(npg_file *page, const char *path, const char *reach_of, const char *caption);

/* Inline SVG: the error of every frame, the bar, bad and skipped frames (batch_chart.c). */
void npg_page_chart(npg_file *page, const npg_capture_figures *figures);

#endif
