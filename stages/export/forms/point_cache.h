/* Point cache: what PC2 and MDD share, a header and then the vertices of every frame as float32. */
#ifndef NPG_POINT_CACHE_H
#define NPG_POINT_CACHE_H

#include "export/forms/forms.h"
#include "pipeline/bytes.h"
#include "pipeline/file.h"

typedef struct npg_cache {
    const npg_form_facts *facts;
    const char *form;
    char name[32];
    npg_file *file;
    unsigned char *row; /* one pose's bytes, owned */
} npg_cache;

/* NPG_USAGE where a count does not fit 32 bits. */
npg_status npg_cache_check(const char *form, const npg_form_facts *facts);
uint64_t npg_cache_bytes(const npg_form_facts *facts);

/* Begin OUT/motion.<form>; the header is the caller's. */
npg_status npg_cache_open(npg_cache *cache, const npg_form_facts *facts, const char *form);

/* put: the byte order. */
npg_status npg_cache_write(npg_cache *cache, const npg_pose *pose,
                           size_t (*put)(unsigned char *out, uint64_t bits, size_t size));

/* The callbacks of the form; finish also writes OUT/reference.obj, once for both forms. */
npg_status npg_cache_finish(void *state);
void npg_cache_close(void *state);

#endif
