/* Kernel cache: one folder per version behind a lock, private folders for everybody else. */
#include "kernels/runtime/device_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

#define PRIVATE_PREFIX "neupig-kernels-"
#define PRIVATE_LOCK   "owner"
#define PRIVATE_AGE_S  60 /* a younger folder may be of a process that has not locked it yet */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int users, lock_fd = -1;
static char shared_folder[4096];  /* of this version; "" when there can be none */
static char private_folder[2048]; /* "" while this process has the shared folder */

static unsigned long long hash_of_sources(void)
{
    XXH64_hash_t hash = 0;
    for (const npg_kernel_source *source = npg_kernel_sources; source->name; source++)
        hash = XXH64(source->text, strlen(source->text), hash);
    return hash;
}

static void find_base(char *out, size_t size)
{
    const char *cache = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    if (cache && cache[0] == '/')
        snprintf(out, size, "%s/neupig", cache);
    else if (home && home[0] == '/')
        snprintf(out, size, "%s/.cache/neupig", home);
    else
        snprintf(out, size, "/tmp/neupig-%ld", (long)getuid());
}

/* The folder of this version, and its lock unless another process has it.  A home that can't be written to is
 * no failure. */
static void lock_shared_folder(void)
{
    char base[2048], path[4200];
    find_base(base, sizeof base);
    snprintf(shared_folder, sizeof shared_folder, "%s/%s-%016llx", base, npg_version(), hash_of_sources());
    snprintf(path, sizeof path, "%s/lock", shared_folder);
    if (!npg_make_folder(shared_folder)) lock_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (lock_fd < 0) {
        shared_folder[0] = 0;
    } else if (flock(lock_fd, LOCK_EX | LOCK_NB)) {
        close(lock_fd);
        lock_fd = -1;
    }
}

/* ---- private folders: each with a lock file that its process holds as long as it lives ---- */

static const char *private_parent(void)
{
    const char *temp = getenv("TMPDIR");
    return temp && temp[0] == '/' ? temp : "/tmp";
}

/* Lock a folder and return the lock's descriptor; -1 if another process has it. */
static int lock_private(const char *folder, int flags)
{
    char path[4200];
    snprintf(path, sizeof path, "%s/" PRIVATE_LOCK, folder);
    int fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0600);
    if (fd < 0 || !flock(fd, LOCK_EX | LOCK_NB)) return fd;
    close(fd);
    return -1;
}

/* Whether the process that made the folder is gone without removing it (it was killed): its lock is free. */
static bool is_left_behind(const char *folder)
{
    struct stat info;
    if (lstat(folder, &info) || !S_ISDIR(info.st_mode) || info.st_uid != getuid()) return false;
    if (time(NULL) < info.st_mtime + PRIVATE_AGE_S) return false;
    int fd = lock_private(folder, 0);
    if (fd >= 0) close(fd);
    return fd >= 0;
}

static void remove_left_behind(void)
{
    const size_t length = strlen(PRIVATE_PREFIX);
    DIR *parent = opendir(private_parent());
    for (struct dirent *entry; parent && (entry = readdir(parent));) {
        char path[4096];
        if (strncmp(entry->d_name, PRIVATE_PREFIX, length) != 0) continue;
        snprintf(path, sizeof path, "%s/%s", private_parent(), entry->d_name);
        if (is_left_behind(path)) npg_folder_remove(path);
    }
    if (parent) closedir(parent);
}

static npg_status make_private_folder(void)
{
    snprintf(private_folder, sizeof private_folder, "%s/" PRIVATE_PREFIX "XXXXXX", private_parent());
    bool is_made = mkdtemp(private_folder) != NULL;
    if (is_made && lock_private(private_folder, O_CREAT) >= 0) return NPG_OK;
    int cause = errno;
    if (is_made) npg_folder_remove(private_folder);
    errno = cause;
    npg_status status = npg_error_errno(NPG_DISK, "%s", private_folder);
    private_folder[0] = 0;
    return status;
}

static npg_status choose_folder(void)
{
    lock_shared_folder();
    if (getenv("POCL_CACHE_DIR")) return NPG_OK;
    remove_left_behind();
    if (lock_fd < 0) NPG_TRY(make_private_folder());
    setenv("POCL_CACHE_DIR", lock_fd < 0 ? private_folder : shared_folder, 1);
    return NPG_OK;
}

npg_status npg_kernel_cache_enter(void)
{
    static bool chosen;
    pthread_mutex_lock(&lock);
    npg_status status = chosen ? NPG_OK : choose_folder();
    if (!status) {
        chosen = true;
        users++;
    }
    pthread_mutex_unlock(&lock);
    return status;
}

static void remove_private(void)
{
    if (private_folder[0]) npg_folder_remove(private_folder);
}

/* The driver keeps using the folder until the process ends, so that is when it goes. */
void npg_kernel_cache_leave(void)
{
    static bool registered;
    pthread_mutex_lock(&lock);
    users--;
    if (private_folder[0] && !registered) registered = !atexit(remove_private);
    pthread_mutex_unlock(&lock);
}
