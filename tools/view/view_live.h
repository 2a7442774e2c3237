/* Live: a page that follows a run which is at work, served on this machine until the run ends. */
#ifndef NPG_VIEW_LIVE_H
#define NPG_VIEW_LIVE_H

#include "tools/view/view_page.h"

/* path: the run's output folder.  Prints the page's address, then serves
 *
 *     /                    the page
 *     /state               lists, curves, how far the run is (JSON)
 *     /part-P              what is the same in all frames of a part (view_frame.h)
 *     /frame-P-INDEX       a frame, as a group of one
 *
 * until the run has ended and the pages that are open have what they ask for, or a signal comes. */
npg_status npg_view_live(const char *path, size_t point_limit, int port);

#endif
