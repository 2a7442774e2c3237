/* Confine: what a helper can't do any more, and that it still computes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pipeline/confine.h"

/* The exit code of a child that does it; 128 + the signal that ended it. */
static int in_child(int (*act)(void))
{
    pid_t pid = fork();
    if (!pid) _exit(act());
    int state;
    assert_int_equal(waitpid(pid, &state, 0), pid);
    return WIFSIGNALED(state) ? 128 + WTERMSIG(state) : WEXITSTATUS(state);
}

static void *add_one(void *number)
{
    ++*(int *)number;
    return NULL;
}

enum { NO_SECCOMP = 77 };

static int try_all(void)
{
    pthread_t thread;
    int number = 1, out = dup(1);
    char *const arguments[] = {(char *)(uintptr_t) "true", NULL};
    if (!npg_confine_calls()) return NO_SECCOMP;
    if (open("/etc/passwd", O_RDONLY) >= 0 || errno != EPERM) return 1;
    if (fopen("/tmp/npg-confine", "w") || errno != EPERM) return 2;
    if (socket(AF_INET, SOCK_STREAM, 0) >= 0 || errno != EPERM) return 3;
    if (execv("/bin/true", arguments) != -1 || errno != EPERM) return 4;
    if (kill(getppid(), 0) != -1 || errno != EPERM) return 5;
    if (unlink("/tmp/npg-confine") != -1 || errno != EPERM) return 6;
    /* what a computation needs */
    if (pthread_create(&thread, NULL, add_one, &number) || pthread_join(thread, NULL) || number != 2)
        return 7;
    void *block = malloc((size_t)64 << 20);
    if (!block) return 8;
    free(block);
    return write(out, "", 0) == 0 ? 0 : 9;
}

static void test_calls(void **state)
{
    (void)state;
    int code = in_child(try_all);
    if (code == NO_SECCOMP) skip();
    assert_int_equal(code, 0);
}

static int spin(void)
{
    volatile bool goes_on = true;
    npg_confine_time(1);
    while (goes_on) continue;
    return 0;
}

static void test_time(void **state)
{
    (void)state;
    assert_int_equal(in_child(spin), 128 + SIGKILL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_calls), cmocka_unit_test(test_time)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
