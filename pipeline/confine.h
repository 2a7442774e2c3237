/* Confine: what a helper process gives up before it looks at bytes of strangers.  Plain C and C++. */
#ifndef NPG_CONFINE_H
#define NPG_CONFINE_H

#include <errno.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>

#if defined __x86_64__
#define NPG_AUDIT_ARCH AUDIT_ARCH_X86_64
/* of calls that are denied; on its 32-bit ABI nothing is allowed */
#define NPG_OLDER_NAMES                                                                                      \
    , SYS_open, SYS_creat, SYS_fork, SYS_vfork, SYS_unlink, SYS_rename, SYS_mkdir, SYS_link, SYS_symlink
#elif defined __aarch64__
#define NPG_AUDIT_ARCH AUDIT_ARCH_AARCH64
#define NPG_OLDER_NAMES
#endif

/* From now on this process and its threads can't open files, start programs, reach the network, or touch other
 * processes: such calls fail with EPERM.  What is open stays so, and memory, threads and clocks are not asked.
 * Lasts until it ends.  False where the kernel (or this machine's kind) has no seccomp: nothing has changed. */
static inline bool npg_confine_calls(void)
{
#ifdef NPG_AUDIT_ARCH
    /* clang-format off */
    static const uint32_t denied[] = {
        SYS_openat, SYS_openat2, SYS_open_by_handle_at, SYS_unlinkat, SYS_renameat2, SYS_mkdirat, SYS_linkat, SYS_symlinkat,
        SYS_mount, SYS_execve, SYS_execveat, SYS_socket, SYS_connect, SYS_bind, SYS_ptrace, SYS_process_vm_readv,
        SYS_process_vm_writev, SYS_kill, SYS_io_uring_setup, SYS_bpf NPG_OLDER_NAMES};
    /* clang-format on */
    enum { COUNT = sizeof denied / sizeof *denied };
    struct sock_filter code[COUNT + 7];
    unsigned n = 0;
    const struct sock_filter head[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, arch)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, NPG_AUDIT_ARCH, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, 0x40000000, COUNT + 1, 0),
    };
    const struct sock_filter tail[] = {
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM),
    };
    for (unsigned i = 0; i < 5; i++) code[n++] = head[i];
    for (unsigned i = 0; i < COUNT; i++) {
        const struct sock_filter one =
            BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, denied[i], (uint8_t)(COUNT - i), 0);
        code[n++] = one;
    }
    for (unsigned i = 0; i < 2; i++) code[n++] = tail[i];
    const struct sock_fprog program = {(unsigned short)n, code};
    return !prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) && !prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program);
#else
    return false;
#endif
}

/* At most so many seconds of processor, then SIGKILL; 0: no limit. */
static inline void npg_confine_time(uint64_t seconds)
{
    const struct rlimit limit = {(rlim_t)seconds, (rlim_t)seconds};
    if (seconds) setrlimit(RLIMIT_CPU, &limit);
}

#endif
