/* Store: one file that records are appended to, each with its checksum. */
#include "pipeline/store.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

static const char magic[8] = "NPGREC01";

typedef struct record_head {
    char magic[8];
    npg_record_id id;
    uint64_t size, hash;
} record_head;

typedef struct block_head {
    char name[NPG_BLOCK_NAME];
    uint64_t size;
} block_head;

typedef struct place {
    npg_record_id id;
    int64_t at;
    uint64_t size; /* of the content */
} place;

struct npg_store {
    int fd;
    char *path; /* owned; NULL: without a name */
    char damage[256];
    pthread_mutex_t writing; /* held from a record's begin to its end; guards what follows */
    record_head head;        /* of the record that is begun */
    XXH3_state_t *hash;
    npg_status failure;   /* of what was put into it */
    int64_t end;          /* of the file, behind the last whole record */
    pthread_mutex_t lock; /* guards what follows, and fd against a file written anew */
    place *places;        /* of the records that count, in the order of their ids */
    size_t count, capacity;
};

/* Blocks begin at multiples of 8, so that what is found can be read as int64_t or double in place. */
static uint64_t padded(uint64_t size)
{
    return (size + 7) / 8 * 8;
}

static npg_record_id make_id(const char *kind, int64_t index, uint64_t of)
{
    npg_record_id id = {.index = index, .of = of};
    memcpy(id.kind, kind, strnlen(kind, sizeof id.kind));
    return id;
}

static const char *name_of(const npg_store *s)
{
    return s->path ? s->path : "a temporary file";
}

static int compare(const npg_record_id *a, const npg_record_id *b)
{
    int kinds = memcmp(a->kind, b->kind, sizeof a->kind);
    if (kinds) return kinds;
    if (a->of != b->of) return a->of < b->of ? -1 : 1;
    return (a->index > b->index) - (a->index < b->index);
}

/* Where the id is, or would be. */
static size_t find_place(const npg_store *s, const npg_record_id *id)
{
    size_t first = 0, end = s->count;
    while (first < end) {
        size_t middle = (first + end) / 2;
        if (compare(&s->places[middle].id, id) < 0)
            first = middle + 1;
        else
            end = middle;
    }
    return first;
}

static const place *place_of(const npg_store *s, const npg_record_id *id)
{
    size_t i = find_place(s, id);
    return i < s->count && !compare(&s->places[i].id, id) ? &s->places[i] : NULL;
}

/* The last record of an id takes the place of those before it. */
static npg_status add_place(npg_store *s, const place *added)
{
    size_t i = find_place(s, &added->id);
    if (!place_of(s, &added->id)) {
        NPG_TRY(npg_grow(&s->places, &s->capacity, s->count + 1, sizeof *s->places, NPG_FOR_FILES));
        memmove(s->places + i + 1, s->places + i, (s->count++ - i) * sizeof *s->places);
    }
    s->places[i] = *added;
    return NPG_OK;
}

/* ---- opening ---- */

/* Of what the head says of its record, and the content. */
static uint64_t hash_of(const record_head *head, uint64_t content_hash)
{
    return XXH3_64bits(&head->id, sizeof head->id + sizeof head->size) ^ content_hash;
}

static npg_status fail(const npg_store *s, const char *does)
{
    return npg_error_errno(NPG_DISK, "can't %s %s", does, name_of(s));
}

struct npg_record {
    unsigned char *bytes; /* owned */
    size_t size;
};

/* What is there of a record; *is_whole: whether that is all of one. */
static npg_status read_record(const npg_store *s, record_head *head, npg_record *record, int64_t at,
                              int64_t file_size, bool *is_whole)
{
    size_t size = sizeof *head;
    int64_t left = file_size - at - (int64_t)sizeof *head;
    *head = (record_head){0};
    *is_whole = false;
    if (!npg_read_at(s->fd, head, &size, at)) return fail(s, "read");
    if (memcmp(head->magic, magic, sizeof magic) != 0 || left < 0 || head->size > (uint64_t)left)
        return NPG_OK;
    record->size = size = (size_t)head->size;
    NPG_TRY(npg_alloc(&record->bytes, NPG_FOR_FILES, size + !size));
    if (!npg_read_at(s->fd, record->bytes, &size, at + (int64_t)sizeof *head)) return fail(s, "read");
    *is_whole = size == record->size && hash_of(head, XXH3_64bits(record->bytes, size)) == head->hash;
    return NPG_OK;
}

/* The record at the end of those that were read: false where there is none. */
static npg_status read_next(npg_store *s, int64_t file_size, bool *is_there)
{
    static const char unwritten[sizeof magic];
    record_head head;
    npg_record record = {0};
    npg_status status = read_record(s, &head, &record, s->end, file_size, is_there);
    npg_release(&record.bytes);
    NPG_TRY(status);
    if (!*is_there) {
        if (memcmp(head.magic, unwritten, sizeof magic) != 0)
            snprintf(s->damage, sizeof s->damage, "%s is damaged: the record at byte %lld is not whole",
                     name_of(s), (long long)s->end);
        return NPG_OK;
    }
    const place found = {head.id, s->end, head.size};
    s->end += (int64_t)(sizeof head + head.size);
    return add_place(s, &found);
}

static npg_status read_places(npg_store *s)
{
    struct stat info;
    bool is_there = true;
    npg_status status = fstat(s->fd, &info) ? fail(s, "look at") : NPG_OK;
    while (!status && is_there) status = read_next(s, info.st_size, &is_there);
    if (!status && s->end < info.st_size && ftruncate(s->fd, s->end)) status = fail(s, "write");
    return status;
}

static npg_status open_file(npg_store *s, const char *path)
{
    struct stat info;
    NPG_TRY(npg_copy_text(&s->path, path));
    s->fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
    if (s->fd < 0 || fstat(s->fd, &info)) return fail(s, "open");
    return S_ISREG(info.st_mode) ? NPG_OK : npg_error(NPG_DISK, "%s is not a plain file", path);
}

/* Nobody sees it, and it goes with the process that has it open. */
static npg_status open_nameless(npg_store *s, const char *folder)
{
    char path[NPG_PATH_SIZE];
    if (!folder) folder = P_tmpdir;
    s->fd = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (s->fd >= 0) return NPG_OK;
    NPG_TRY(npg_path_of(path, folder, "frames.XXXXXX"));
    s->fd = mkostemp(path, O_CLOEXEC); /* file systems that can't */
    if (s->fd < 0) return npg_error_errno(NPG_DISK, "can't make a temporary file in %s", folder);
    unlink(path);
    return NPG_OK;
}

static npg_status open_store(npg_store **out, const char *where,
                             npg_status (*open_as)(npg_store *s, const char *where))
{
    npg_store *s;
    *out = NULL;
    NPG_TRY(npg_alloc(&s, NPG_FOR_FILES, sizeof *s));
    pthread_mutex_init(&s->writing, NULL);
    pthread_mutex_init(&s->lock, NULL);
    s->fd = -1;
    s->hash = XXH3_createState();
    npg_status status = s->hash ? NPG_OK : npg_error(NPG_MEMORY, "no memory for a checksum");
    if (!status) status = open_as(s, where);
    if (!status) status = read_places(s);
    if (status) npg_store_close(&s);
    *out = s;
    return status;
}

npg_status npg_store_open(npg_store **out, const char *path)
{
    return open_store(out, path, open_file);
}

npg_status npg_store_open_nameless(npg_store **out, const char *folder)
{
    return open_store(out, folder, open_nameless);
}

void npg_store_close(npg_store **slot)
{
    npg_store *s = *slot;
    if (!s) return;
    if (s->fd >= 0) close(s->fd);
    XXH3_freeState(s->hash);
    pthread_mutex_destroy(&s->writing);
    pthread_mutex_destroy(&s->lock);
    npg_release(&s->places);
    npg_release(&s->path);
    npg_release(slot);
}

const char *npg_store_damage(const npg_store *s)
{
    return s->damage;
}

npg_status npg_store_rename(npg_store *s, const char *path)
{
    char *copy;
    NPG_TRY(npg_copy_text(&copy, path));
    npg_status status = rename(s->path, path) ? fail(s, "rename") : NPG_OK;
    npg_release(status ? &copy : &s->path);
    if (!status) s->path = copy;
    return status;
}

/* ---- writing ---- */

void npg_store_begin(npg_store *s, const char *kind, int64_t index, uint64_t of)
{
    pthread_mutex_lock(&s->writing);
    s->head = (record_head){.id = make_id(kind, index, of)};
    s->failure = NPG_OK;
    XXH3_64bits_reset(s->hash);
}

static void append(npg_store *s, const void *data, size_t size)
{
    if (!size || s->failure) return;
    XXH3_64bits_update(s->hash, data, size);
    if (!npg_write_at(s->fd, data, size, s->end + (int64_t)(sizeof s->head + s->head.size)))
        s->failure = fail(s, "write");
    s->head.size += size;
}

npg_status npg_store_put(npg_store *s, const char *name, const void *data, size_t size)
{
    static const char zeros[8];
    block_head head = {.size = size};
    NPG_REQUIRE(strlen(name) < sizeof head.name);
    memcpy(head.name, name, strlen(name));
    append(s, &head, sizeof head);
    append(s, data, size);
    append(s, zeros, (size_t)(padded(size) - size));
    return s->failure;
}

npg_status npg_store_put_arrays(npg_store *s, const void *owner, const npg_store_array *arrays, size_t count)
{
    for (const npg_store_array *a = arrays; a < arrays + count; a++) {
        const void *rows;
        memcpy(&rows, (const char *)owner + a->offset, sizeof rows);
        if (rows) NPG_TRY(npg_store_put(s, a->name, rows, a->count * a->row));
    }
    return NPG_OK;
}

npg_status npg_store_end(npg_store *s, npg_status status, bool with_sync)
{
    const place written = {s->head.id, s->end, s->head.size};
    memcpy(s->head.magic, magic, sizeof magic);
    s->head.hash = hash_of(&s->head, XXH3_64bits_digest(s->hash));
    if (!status) status = s->failure;
    if (!status && !npg_write_at(s->fd, &s->head, sizeof s->head, s->end)) status = fail(s, "write");
    if (!status && with_sync && fdatasync(s->fd)) status = fail(s, "write");
    pthread_mutex_lock(&s->lock);
    if (!status) status = add_place(s, &written);
    if (!status)
        s->end += (int64_t)(sizeof s->head + s->head.size);
    else if (ftruncate(s->fd, s->end))
        status = fail(s, "write");
    pthread_mutex_unlock(&s->lock);
    pthread_mutex_unlock(&s->writing);
    return status;
}

npg_status npg_store_sync(npg_store *s)
{
    pthread_mutex_lock(&s->lock);
    npg_status status = fdatasync(s->fd) ? fail(s, "write") : NPG_OK;
    pthread_mutex_unlock(&s->lock);
    return status;
}

/* ---- written anew ---- */

static npg_status copy_record(npg_file *file, npg_store *s, place *p)
{
    unsigned char block[16 << 10];
    int64_t at = p->at, end = at + (int64_t)(sizeof(record_head) + p->size);
    p->at = (int64_t)npg_file_size(file);
    while (at < end) {
        size_t size = end - at < (int64_t)sizeof block ? (size_t)(end - at) : sizeof block;
        if (!npg_read_at(s->fd, block, &size, at)) return fail(s, "read");
        if (!size) return npg_error(NPG_DISK, "%s became shorter", name_of(s));
        NPG_TRY(npg_file_write(file, block, size));
        at += (int64_t)size;
    }
    return NPG_OK;
}

/* The records that count, into a new file in the place of this one.  What fails leaves the old one. */
static npg_status write_anew(npg_store *s)
{
    npg_file *file = NULL;
    place *places;
    NPG_TRY(npg_alloc_array(&places, NPG_FOR_FILES, s->count + 1, sizeof *places));
    if (s->count) memcpy(places, s->places, s->count * sizeof *places);
    npg_status status = npg_file_open(&file, s->path);
    for (size_t i = 0; i < s->count && !status; i++) status = copy_record(file, s, &places[i]);
    int64_t end = status ? 0 : (int64_t)npg_file_size(file);
    status = npg_file_end(&file, status);
    int fd = status ? -1 : open(s->path, O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    if (!status && fd < 0) status = fail(s, "open");
    if (!status) {
        close(s->fd);
        s->fd = fd;
        s->end = end;
        memcpy(s->places, places, s->count * sizeof *places);
    }
    npg_release(&places);
    return status;
}

npg_status npg_store_forget(npg_store *s, bool (*is_needed)(const npg_record_id *id, const void *user),
                            const void *user)
{
    npg_status status = NPG_OK;
    int64_t needed = 0;
    size_t kept = 0;
    pthread_mutex_lock(&s->writing);
    pthread_mutex_lock(&s->lock);
    for (size_t i = 0; i < s->count; i++) {
        if (!is_needed(&s->places[i].id, user)) continue;
        needed += (int64_t)(sizeof(record_head) + s->places[i].size);
        s->places[kept++] = s->places[i];
    }
    s->count = kept;
    if (s->path && s->end > 2 * needed) status = write_anew(s);
    pthread_mutex_unlock(&s->lock);
    pthread_mutex_unlock(&s->writing);
    return status;
}

/* ---- reading ---- */

size_t npg_store_count(npg_store *s, const char *kind, uint64_t of)
{
    const npg_record_id first = make_id(kind, INT64_MIN, of), last = make_id(kind, INT64_MAX, of);
    pthread_mutex_lock(&s->lock);
    size_t count = find_place(s, &last) - find_place(s, &first);
    pthread_mutex_unlock(&s->lock);
    return count;
}

int64_t npg_store_last(npg_store *s, const char *kind)
{
    const npg_record_id after = make_id(kind, INT64_MAX, UINT64_MAX);
    pthread_mutex_lock(&s->lock);
    size_t i = find_place(s, &after);
    bool is_there = i && !memcmp(s->places[i - 1].id.kind, after.kind, sizeof after.kind);
    int64_t index = is_there ? s->places[i - 1].id.index : -1;
    pthread_mutex_unlock(&s->lock);
    return index;
}

bool npg_store_has(npg_store *s, const char *kind, int64_t index, uint64_t of)
{
    const npg_record_id id = make_id(kind, index, of);
    pthread_mutex_lock(&s->lock);
    bool is_there = place_of(s, &id) != NULL;
    pthread_mutex_unlock(&s->lock);
    return is_there;
}

static npg_status read_content(npg_store *s, npg_record *record, const npg_record_id *id)
{
    record_head head;
    bool is_whole;
    const place *p = place_of(s, id);
    if (!p)
        return npg_error(NPG_BAD_INPUT, "%s has no %.8s %lld", name_of(s), id->kind, (long long)id->index);
    NPG_TRY(read_record(s, &head, record, p->at, s->end, &is_whole));
    if (is_whole && !compare(&head.id, id)) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s is damaged: %.8s %lld is not what was written", name_of(s), id->kind,
                     (long long)id->index);
}

npg_status npg_store_read(npg_store *s, npg_record **out, const char *kind, int64_t index, uint64_t of)
{
    const npg_record_id id = make_id(kind, index, of);
    npg_record *record;
    *out = NULL;
    NPG_TRY(npg_alloc(&record, NPG_FOR_FILES, sizeof *record));
    pthread_mutex_lock(&s->lock);
    npg_status status = read_content(s, record, &id);
    pthread_mutex_unlock(&s->lock);
    if (status) npg_record_close(&record);
    *out = record;
    return status;
}

void npg_record_close(npg_record **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->bytes);
    npg_release(slot);
}

const void *npg_record_find(const npg_record *record, const char *name, size_t *size)
{
    for (size_t at = 0; at + sizeof(block_head) <= record->size;) {
        const block_head *head = (const void *)(record->bytes + at);
        at += sizeof *head;
        if (head->size > record->size - at) return NULL;
        if (!strncmp(head->name, name, sizeof head->name)) {
            *size = (size_t)head->size;
            return record->bytes + at;
        }
        at += padded(head->size);
    }
    return NULL;
}

npg_status npg_record_get(const npg_record *record, const char *name, void *data, size_t size)
{
    size_t found;
    const void *bytes = npg_record_find(record, name, &found);
    if (!bytes) return npg_error(NPG_BAD_INPUT, "the block %s is missing", name);
    if (found != size)
        return npg_error(NPG_BAD_INPUT, "the block %s has %zu bytes in place of %zu", name, found, size);
    if (size) memcpy(data, bytes, size);
    return NPG_OK;
}

npg_status npg_record_get_arrays(const npg_record *record, void *owner, const npg_store_array *arrays,
                                 size_t count, npg_purpose purpose)
{
    for (const npg_store_array *a = arrays; a < arrays + count; a++) {
        void **rows = (void **)(void *)((char *)owner + a->offset);
        size_t size;
        npg_release(rows);
        if (!npg_record_find(record, a->name, &size)) continue;
        if (size / a->row != a->count)
            return npg_error(NPG_BAD_INPUT, "the block %s has not the size of %zu rows", a->name, a->count);
        NPG_TRY(npg_alloc_array(rows, purpose, a->count, a->row));
        NPG_TRY(npg_record_get(record, a->name, *rows, a->count * a->row));
    }
    return NPG_OK;
}
