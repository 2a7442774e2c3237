/* The page without data: where the bundle lies, and where data go into it. */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/file.h"
#include "tools/view/view_internal.h"

#define NAME      "view/page.html"
#define MARK      "<!--neupig-data-->"
#define SIZE_MOST ((size_t)64 << 20)

/* Beside this program (a build folder), in the share/ of its installation, or where it was meant to be
 * installed. */
static bool find_template(char path[PATH_MAX])
{
    static const char *const ways[] = {"", "../share/neupig/"};
    char self[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    self[length > 0 ? length : 0] = 0;
    const char *slash = strrchr(self, '/');
    for (size_t i = 0; slash && i < sizeof ways / sizeof *ways; i++) {
        int size = snprintf(path, PATH_MAX, "%.*s%s" NAME, (int)(slash - self + 1), self, ways[i]);
        if (size < PATH_MAX && access(path, R_OK) == 0) return true;
    }
    snprintf(path, PATH_MAX, "%s/%s", NPG_DATA_DIR, NAME);
    return access(path, R_OK) == 0;
}

npg_status npg_view_template_open(npg_view_template *page)
{
    char path[PATH_MAX];
    *page = (npg_view_template){.arena = {.purpose = NPG_FOR_FILES}};
    if (!find_template(path))
        return npg_error(NPG_FAILED,
                         "the page's script was not built: it needs Node and npm. Install them "
                         "(Debian: nodejs and npm), configure with -DNPG_VIEW=ON and build again");
    NPG_TRY(npg_file_whole(&page->arena, &page->text, &page->size, path, SIZE_MOST, "page"));
    const char *mark = strstr(page->text, MARK);
    if (!mark) {
        npg_view_template_close(page);
        return npg_error(NPG_FAILED, "%s is not the page that belongs to this program", path);
    }
    page->data = (size_t)(mark - page->text);
    return NPG_OK;
}

void npg_view_template_close(npg_view_template *page)
{
    npg_arena_release(&page->arena);
}
