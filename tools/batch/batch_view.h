/* Pages beside the results of a batch: OUT/NAME/view.html, as neupig view makes them. */
#ifndef NPG_BATCH_VIEW_H
#define NPG_BATCH_VIEW_H

#include "pipeline/file.h"
#include "tools/batch/batch.h"

#define NPG_BATCH_VIEW_NAME "view.html"

/* Make the pages of captures that are done and have none, or one older than their done.json.  One that can't
 * be made is a warning on standard error.  Nothing where the batch wants none, or the page's script was not
 * built. */
npg_status npg_batch_views_write(const npg_batch *batch);

/* A link to a capture's page, seen from batch.html, where there is one. */
void npg_batch_view_link(npg_file *page, const npg_batch *batch, const npg_capture *capture);

#endif
