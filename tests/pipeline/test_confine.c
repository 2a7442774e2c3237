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

/* A step that does not end has a code, too: 100 more than if it fails. */
enum { NO_SECCOMP = 77, STUCK = 100, STUCK_S = 120 };
static volatile sig_atomic_t at_step;

static void end_stuck(int signal)
{
    (void)signal;
    _exit(STUCK + at_step);
}

#define STEP(number, fails)                                                                                  \
    do {                                                                                                     \
        at_step = (number);                                                                                  \
        if (fails) return at_step;                                                                           \
    } while (0)

static int try_all(void)
{
    pthread_t thread;
    int number = 1, out = dup(1);
    char *const arguments[] = {(char *)(uintptr_t) "true", NULL};
    signal(SIGALRM, end_stuck);
    alarm(STUCK_S);
    if (!npg_confine_calls()) return NO_SECCOMP;
    STEP(1, open("/etc/passwd", O_RDONLY) >= 0 || errno != EPERM);
    STEP(2, fopen("/tmp/npg-confine", "w") || errno != EPERM);
    STEP(3, socket(AF_INET, SOCK_STREAM, 0) >= 0 || errno != EPERM);
    STEP(4, execv("/bin/true", arguments) != -1 || errno != EPERM);
    STEP(5, kill(getppid(), 0) != -1 || errno != EPERM);
    STEP(6, unlink("/tmp/npg-confine") != -1 || errno != EPERM);
    /* what a computation needs */
    STEP(7, pthread_create(&thread, NULL, add_one, &number));
    STEP(8, pthread_join(thread, NULL) || number != 2);
    at_step = 9;
    void *block = malloc((size_t)64 << 20);
    if (!block) return 9;
    free(block);
    STEP(10, write(out, "", 0) != 0);
    return 0;
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
