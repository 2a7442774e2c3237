/* File facts: size and checksum of a file of the results, as the lists of a run give them. */
#ifndef NPG_FILE_FACTS_H
#define NPG_FILE_FACTS_H

#include <jansson.h>

#include "pipeline/status.h"

/* {"bytes": n, "xxh3": "16 hex digits"} added to entry for the file OUT/<file>.  NPG_DISK. */
npg_status npg_file_facts(json_t *entry, const char *output, const char *file);

/* NPG_BAD_INPUT when OUT/<file> is not the file that entry ({"bytes", "xxh3"}) describes. */
npg_status npg_file_check(const json_t *entry, const char *output, const char *file);

#endif
