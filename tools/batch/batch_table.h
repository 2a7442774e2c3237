/* Table of a batch: on the terminal, in batch.json and in batch.html. */
#ifndef NPG_BATCH_TABLE_H
#define NPG_BATCH_TABLE_H

#include <stdio.h>

#include "tools/batch/batch.h"

/* Write OUT/batch.json and OUT/batch.html with every capture of the batch, also those that
 * other processes do, as far as they are now, and print the table to `out` unless it is NULL.
 * Processes of one batch take turns. */
npg_status npg_batch_report(npg_batch *batch, FILE *out);

#endif
