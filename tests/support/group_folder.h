/* A folder that the tests of a program share: open_folder and close_folder are their group's
 * set-up and teardown. */
#ifndef NPG_TEST_GROUP_FOLDER_H
#define NPG_TEST_GROUP_FOLDER_H

#include "pipeline/memory.h"
#include "tests/support/temp_folder.h"

static temp_folder folder;

static int open_folder(void **state)
{
    (void)state;
    return open_temp_folder(&folder);
}

/* Fails when the tests have left memory behind. */
static int close_folder(void **state)
{
    (void)state;
    close_temp_folder(&folder);
    return npg_memory_used() ? -1 : 0;
}

#endif
