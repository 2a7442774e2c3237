/* Kernel cache: a folder per version for every process that is at work at the same time. */
#include "kernels/runtime/device_internal.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

#define SLOTS 256 /* processes at work at the same time, at most */

static unsigned long long hash_of_sources(void)
{
    XXH64_hash_t hash = 0;
    for (const npg_kernel_source *source = npg_kernel_sources; source->name; source++)
        hash = XXH64(source->text, strlen(source->text), hash);
    return hash;
}

/* Compiled kernels are run: where others may put some of theirs is no place for them. */
static bool is_own(const char *folder)
{
    struct stat info;
    return !npg_make_folder(folder) && !lstat(folder, &info) && S_ISDIR(info.st_mode) &&
           info.st_uid == getuid() && !(info.st_mode & S_IWOTH);
}

/* Lock the first folder below a base that no other process has, until this one ends. */
static bool enter_below(const char *base)
{
    char folder[4096];
    int fd;
    if (!is_own(base)) return false;
    for (int slot = 0; slot < SLOTS; slot++) {
        snprintf(folder, sizeof folder, "%s/%s-%016llx/%d", base, npg_version(), hash_of_sources(), slot);
        npg_status status = npg_file_lock(&fd, folder, "lock", false);
        if (!status) return !setenv("POCL_CACHE_DIR", folder, 1);
        if (fd >= 0) close(fd);
        if (status != NPG_USAGE) return false;
    }
    return false;
}

static npg_status choose_folder(void)
{
    const char *cache = getenv("XDG_CACHE_HOME"), *home = getenv("HOME"), *temp = getenv("TMPDIR");
    char base[2048] = "";
    if (getenv("POCL_CACHE_DIR")) return NPG_OK;
    if (cache && cache[0] == '/')
        snprintf(base, sizeof base, "%s/neupig", cache);
    else if (home && home[0] == '/')
        snprintf(base, sizeof base, "%s/.cache/neupig", home);
    if (base[0] && enter_below(base)) return NPG_OK;
    snprintf(base, sizeof base, "%s/neupig-%ld", temp && temp[0] == '/' ? temp : "/tmp", (long)getuid());
    return enter_below(base) ? NPG_OK : npg_error(NPG_DISK, "%s: no place for compiled kernels", base);
}

npg_status npg_kernel_cache_enter(void)
{
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    static bool is_chosen;
    pthread_mutex_lock(&lock);
    npg_status status = is_chosen ? NPG_OK : choose_folder();
    is_chosen = !status;
    pthread_mutex_unlock(&lock);
    return status;
}
