// SPDX-License-Identifier: MIT
// Descriptors, time, waiting and processes of the virtual kernel.
#include "kernel.h"

#include "daemon_judge.h"
#include "daemon_world.h"
#include "wrapped.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/time_types.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define DESCRIPTORS  96
#define SETS         4
#define WATCHED      48
#define BLOCKS       8
#define CALL_US      8U
#define WALL_US      INT64_C(1700000000000000)
#define US_PER_S     1000000
#define WAIT_CALL    441
#define FIRST_PID    1000
#define PREEMPTED_OF 4000U
#define PREEMPTED_US 1500U

typedef struct {
    int fd;
    struct epoll_event event;
} watched_t;

typedef struct {
    bool used;
    unsigned count;
    watched_t watched[WATCHED];
} set_t;

vk_t vk;
static vk_fd_t table[DESCRIPTORS];
static set_t sets[SETS];
static void *blocks[BLOCKS]; // Allocations of this life.
static void *ring;           // Its mapping for the black box,
static size_t ring_size;     // and its size.
static pid_t last_pid;
static bool stealing; // Passing time does not belong to the process.

void vk_begin(uint64_t seed, iw_time_us_t now_us, const char *config) {
    vk = (vk_t){.now_us = now_us, .end_us = IW_NEVER};
    sim_random_init(&vk.random, seed);
    vk.link.exists = vk.link.up = vk.link.may_restart = true;
    vk.link.index = 3;
    vk.link.down_at_us = vk.link.up_at_us = IW_NEVER;
    vk.button.there = true;
    last_pid = FIRST_PID;
    vk_files_begin(config);
}

// ---- a call ------------------------------------------------------------------------------------------------------

static void die(void) {
    longjmp(vk.leave, 1);
}

/// The process of the purge, and other activity next to the gateway in this machine.
static void poll_link(void) {
    if (vk.now_us >= vk.link.down_at_us) {
        vk.link.down_at_us = IW_NEVER;
        vk_link_up(false);
    }
    if (vk.now_us >= vk.link.up_at_us) {
        vk.link.up_at_us = IW_NEVER;
        vk_link_up(true);
    }
}

static void advance(iw_time_us_t to_us) {
    const iw_time_us_t span_us = (to_us > vk.now_us) ? to_us - vk.now_us : 0U;
    vk.stolen_us += stealing ? span_us : 0U;
    vk.now_us += span_us;
}

void vk_pass(iw_time_us_t to_us) {
    while (true) {
        iw_time_us_t next_us = world_next_us();
        next_us = (vk.link.down_at_us < next_us) ? vk.link.down_at_us : next_us;
        next_us = (vk.link.up_at_us < next_us) ? vk.link.up_at_us : next_us;
        if (next_us > to_us) {
            break;
        }
        advance(next_us);
        poll_link();
        world_run();
    }
    advance(to_us);
    if (vk.alive && (vk.doomed || vk.now_us >= vk.end_us)) {
        die();
    }
}

void vk_idle(iw_time_us_t for_us) {
    vk_pass(vk.now_us + for_us);
    vk.doomed = false;
}

/// The process is ready but does not run.
static void steal(iw_time_us_t until_us) {
    const iw_time_us_t from_us = vk.now_us;
    stealing = true;
    vk_pass(until_us);
    stealing = false;
    judge_stopped(vk.now_us - from_us);
}

void vk_note_failure(void) {
    vk.failed_us = vk.now_us;
    vk.failed_stolen_us = vk.stolen_us;
}

bool vk_call(const char *name, const int *errors) {
    vk.calls++;
    vk_pass(vk.now_us + 1U + sim_random_below(&vk.random, CALL_US));
    if (sim_random_below(&vk.random, PREEMPTED_OF) == 0U) {
        steal(vk.now_us + sim_random_below(&vk.random, PREEMPTED_US));
    }
    while (vk.stop_us > vk.now_us) {
        steal(vk.stop_us);
    }
    if (vk.kill_at == vk.calls) {
        vk.kill_at = 0;
        vk.doomed = true;
        if (!vk.kill_after) {
            die();
        }
    }
    if (errors == NULL || vk.fail_permille == 0U || sim_random_below(&vk.random, 1000U) >= vk.fail_permille) {
        return true;
    }
    unsigned count = 0;
    while (errors[count] != 0) {
        count++;
    }
    errno = errors[sim_random_below(&vk.random, count)];
    vk.failed++;
    vk_note_failure();
    if (vk.trace) {
        printf("  %11.6f s    %s fails: %s\n", (double)vk.now_us / 1e6, name, strerror(errno));
    }
    return false;
}

long vk_done(long result) {
    if (vk.doomed) {
        die();
    }
    return result;
}

// ---- descriptors -------------------------------------------------------------------------------------------------

vk_fd_t *vk_fd(int fd) {
    if (fd == -1) {
        return &table[0]; // An entry without a kind: every call on it fails.
    }
    const bool known = fd >= 3 && fd < DESCRIPTORS && table[fd].kind != VK_FREE;
    if (!known) {
        printf("the gateway uses descriptor %d, which is not open\n", fd);
        (void)fflush(stdout);
        abort();
    }
    return &table[fd];
}

int vk_open_fd(const char *name, vk_kind_t kind, int number) {
    static const int errors[] = {EMFILE, ENFILE, ENOMEM, 0};
    if (!vk_call(name, errors)) {
        return -1;
    }
    for (int fd = 3; fd < DESCRIPTORS && !vk.no_descriptors; fd++) {
        if (table[fd].kind == VK_FREE) {
            table[fd] = (vk_fd_t){.kind = kind, .number = number};
            return fd;
        }
    }
    errno = EMFILE;
    vk_note_failure();
    return -1;
}

static void forget(int fd) {
    vk_fd_t *entry = &table[fd];
    for (unsigned i = 0; i < SETS; i++) {
        for (unsigned k = 0; k < sets[i].count; k++) {
            if (sets[i].watched[k].fd == fd) {
                sets[i].watched[k--] = sets[i].watched[--sets[i].count];
            }
        }
    }
    if (entry->kind == VK_EPOLL) {
        sets[entry->number].used = false;
    }
    vk_close_socket(entry);
    *entry = (vk_fd_t){.kind = VK_FREE};
}

int __wrap_close(int fd) {
    (void)vk_call("close", NULL);
    if (fd > 2) {
        (void)vk_fd(fd);
        forget(fd);
    }
    return (int)vk_done(0);
}

int __wrap_fcntl(int fd, int command, ...) {
    (void)vk_call("fcntl", NULL);
    (void)command;
    (void)fd;
    return (int)vk_done(0);
}

// ---- waiting -----------------------------------------------------------------------------------------------------

static uint32_t ready_set(const set_t *set, struct epoll_event *events, int max) {
    const unsigned first = (set->count > 1U) ? sim_random_below(&vk.random, set->count) : 0U;
    int count = 0;
    for (unsigned i = 0; i < set->count && count < max; i++) {
        const watched_t *watched = &set->watched[(first + i) % set->count];
        const uint32_t found = vk_ready(watched->fd) & (watched->event.events | EPOLLERR | EPOLLHUP);
        if (found != 0U) {
            events[count++] = (struct epoll_event){.events = found, .data = watched->event.data};
        }
    }
    return (uint32_t)count;
}

uint32_t vk_ready(int fd) {
    const vk_fd_t *entry = vk_fd(fd);
    switch (entry->kind) {
    case VK_EPOLL: // A set inside another set: true if an event waits.
        for (unsigned i = 0; i < sets[entry->number].count; i++) {
            const watched_t *watched = &sets[entry->number].watched[i];
            if ((vk_ready(watched->fd) & (watched->event.events | EPOLLERR | EPOLLHUP)) != 0U) {
                return EPOLLIN;
            }
        }
        return 0;
    case VK_SIGNAL:
        return (vk.signal != 0) ? EPOLLIN : 0U;
    case VK_GPIO:
        return (vk.button.edges > 0 && entry->number == vk.button.number) ? EPOLLIN : 0U;
    default:
        return vk_ready_socket(entry);
    }
}

int __wrap_epoll_create1(int flags) {
    (void)flags;
    unsigned set = 0;
    while (set < SETS && sets[set].used) {
        set++;
    }
    const int fd = vk_open_fd("epoll_create1", VK_EPOLL, (int)set);
    if (fd >= 0) {
        sets[set] = (set_t){.used = true};
    }
    return (int)vk_done(fd);
}

static watched_t *find_watched(set_t *set, int fd) {
    for (unsigned i = 0; i < set->count; i++) {
        if (set->watched[i].fd == fd) {
            return &set->watched[i];
        }
    }
    return NULL;
}

int __wrap_epoll_ctl(int epoll, int operation, int fd, struct epoll_event *event) {
    static const int errors[] = {ENOMEM, ENOSPC, 0};
    if (!vk_call("epoll_ctl", (operation == EPOLL_CTL_ADD) ? errors : NULL)) {
        return -1;
    }
    set_t *set = &sets[vk_fd(epoll)->number];
    watched_t *watched = find_watched(set, fd);
    (void)vk_fd(fd);
    if (operation == EPOLL_CTL_ADD && watched == NULL && set->count < WATCHED) {
        watched = &set->watched[set->count++];
        watched->fd = fd;
    }
    if (watched == NULL) {
        errno = ENOENT;
        return -1;
    }
    watched->event = *event;
    return (int)vk_done(0);
}

static int wait_until(int epoll, struct epoll_event *events, int max, iw_time_us_t until_us) {
    static const int errors[] = {EINTR, 0};
    vk.waits++;
    if (!vk_call("epoll_wait", errors)) {
        return -1;
    }
    const set_t *set = &sets[vk_fd(epoll)->number];
    uint32_t count = ready_set(set, events, max);
    const bool waited = count == 0U;
    while (count == 0U && vk.now_us < until_us) {
        iw_time_us_t next_us = world_next_us();
        next_us = (vk.link.up_at_us < next_us) ? vk.link.up_at_us : next_us;
        next_us = (vk.link.down_at_us < next_us) ? vk.link.down_at_us : next_us;
        vk_pass((next_us < until_us) ? next_us : until_us);
        count = ready_set(set, events, max);
    }
    if (waited && vk.late_us > 0U) {
        steal(vk.now_us + sim_random_below(&vk.random, vk.late_us));
        count = ready_set(set, events, max);
    }
    return (int)vk_done((long)count);
}

int __wrap_epoll_wait(int epoll, struct epoll_event *events, int max, int timeout_ms) {
    return wait_until(epoll, events, max, vk.now_us + (iw_time_us_t)((timeout_ms > 0) ? timeout_ms : 0) * 1000U);
}

long __wrap_syscall(long number, ...) {
    va_list arguments;
    va_start(arguments, number);
    const int epoll = va_arg(arguments, int);
    struct epoll_event *events = va_arg(arguments, struct epoll_event *);
    const int max = va_arg(arguments, int);
    const struct __kernel_timespec *span = va_arg(arguments, const struct __kernel_timespec *);
    va_end(arguments);
    if (number != WAIT_CALL) {
        errno = ENOSYS;
        return -1;
    }
    const iw_time_us_t span_us =
        (span == NULL) ? 0U : (iw_time_us_t)span->tv_sec * US_PER_S + (iw_time_us_t)span->tv_nsec / 1000U;
    return wait_until(epoll, events, max, (span == NULL) ? IW_NEVER : vk.now_us + span_us);
}

int __wrap_poll(struct pollfd *entries, nfds_t count, int timeout_ms) {
    (void)vk_call("poll", NULL);
    (void)timeout_ms; // Only the log calls it, and never waits.
    for (nfds_t i = 0; i < count; i++) {
        entries[i].revents = entries[i].events;
    }
    return (int)vk_done((long)count);
}

// ---- clocks ------------------------------------------------------------------------------------------------------

int __wrap_clock_gettime(clockid_t clock, struct timespec *out_time) {
    int64_t at_us = (int64_t)vk.now_us;
    (void)vk_call("clock_gettime", NULL);
    at_us = (int64_t)vk.now_us;
    at_us += (clock == CLOCK_REALTIME) ? WALL_US + vk.wall_off_us : 0;
    at_us += (clock == CLOCK_BOOTTIME) ? (int64_t)vk.suspended_us : 0;
    *out_time = (struct timespec){.tv_sec = (time_t)(at_us / US_PER_S), .tv_nsec = (long)(at_us % US_PER_S) * 1000};
    return (int)vk_done(0);
}

int __wrap_nanosleep(const struct timespec *span, struct timespec *left) {
    (void)vk_call("nanosleep", NULL);
    (void)left;
    vk_pass(vk.now_us + (iw_time_us_t)span->tv_sec * US_PER_S + (iw_time_us_t)span->tv_nsec / 1000U);
    return (int)vk_done(0);
}

// ---- signals and processes -----------------------------------------------------------------------------------------

int __wrap_signalfd(int fd, const sigset_t *mask, int flags) {
    (void)fd;
    (void)mask;
    (void)flags;
    return (int)vk_done(vk_open_fd("signalfd", VK_SIGNAL, 0));
}

ssize_t vk_read_signal(void *out, size_t size) {
    const struct signalfd_siginfo info = {.ssi_signo = (uint32_t)vk.signal};
    (void)vk_call("read", NULL);
    memcpy(out, &info, size);
    vk.signal = 0;
    return vk_done((long)size);
}

int __wrap_sigprocmask(int how, const sigset_t *set, sigset_t *old) {
    (void)vk_call("sigprocmask", NULL);
    (void)how;
    (void)set;
    (void)old;
    return (int)vk_done(0);
}

vk_handler_t __wrap_signal(int number, vk_handler_t handler) {
    (void)vk_call("signal", NULL);
    (void)number;
    (void)handler;
    (void)vk_done(0);
    return NULL;
}

int __wrap_prctl(int option, ...) {
    (void)vk_call("prctl", NULL);
    (void)option;
    return (int)vk_done(0);
}

pid_t __wrap_getpid(void) {
    return FIRST_PID;
}

/// The result is the same in every run and consumes no fault and no time: so seeds that once found a fault still do.
ssize_t __wrap_getrandom(void *out, size_t size, unsigned flags) {
    (void)flags;
    memset(out, 7, size);
    return (ssize_t)size;
}

uid_t __wrap_geteuid(void) {
    return VK_USER;
}

static bool is_child_of_pair(void) {
    for (int fd = 3; fd < DESCRIPTORS; fd++) {
        if (table[fd].kind == VK_CHILD && table[fd].number == 0) {
            return true; // A pair whose process does not exist yet.
        }
    }
    return false;
}

/// The process that purges: it sets the link down and up, if it may.
static void begin_purge(pid_t pid) {
    vk.link.child = pid;
    vk.link.child_status = vk.link.may_restart ? 0 : EPERM;
    if (vk.link.may_restart && vk.link.exists) {
        vk.link.down_at_us = vk.now_us + 1U + sim_random_below(&vk.random, 5000U);
        vk.link.up_at_us = vk.link.down_at_us + 1U + sim_random_below(&vk.random, 30000U);
    }
}

pid_t __wrap_fork(void) {
    static const int errors[] = {EAGAIN, ENOMEM, 0};
    if (!vk_call("fork", errors)) {
        return -1;
    }
    last_pid++;
    if (is_child_of_pair()) {
        for (int fd = 3; fd < DESCRIPTORS; fd++) {
            table[fd].number = (table[fd].kind == VK_CHILD && table[fd].number == 0) ? last_pid : table[fd].number;
        }
    } else {
        begin_purge(last_pid);
    }
    return (pid_t)vk_done(last_pid);
}

pid_t __wrap_waitpid(pid_t pid, int *status, int options) {
    (void)vk_call("waitpid", NULL);
    (void)options;
    const bool runs = pid == vk.link.child && (vk.link.down_at_us != IW_NEVER || vk.link.up_at_us != IW_NEVER);
    if (status != NULL) {
        *status = vk.link.child_status << 8;
    }
    return (pid_t)vk_done(runs ? 0 : pid);
}

// ---- memory --------------------------------------------------------------------------------------------------------

void *__real_calloc(size_t count, size_t size);
void __real_free(void *block);

void *__wrap_calloc(size_t count, size_t size) {
    void *block = __real_calloc(count, size);
    for (unsigned i = 0; i < BLOCKS; i++) {
        if (blocks[i] == NULL) {
            blocks[i] = block;
            return block;
        }
    }
    abort(); // More blocks than the gateway ever allocates.
}

void __wrap_free(void *block) {
    for (unsigned i = 0; i < BLOCKS; i++) {
        blocks[i] = (blocks[i] == block) ? NULL : blocks[i];
    }
    __real_free(block);
}

void *__real_mmap(void *at, size_t size, int rights, int kind, int fd, off_t offset);
int __real_munmap(void *at, size_t size);

void *__wrap_mmap(void *at, size_t size, int rights, int kind, int fd, off_t offset) {
    void *mapped = __real_mmap(at, size, rights, kind, fd, offset);
    ring = (mapped != MAP_FAILED) ? mapped : NULL;
    ring_size = size;
    return mapped;
}

int __wrap_munmap(void *at, size_t size) {
    ring = NULL;
    return __real_munmap(at, size);
}

FILE *__wrap_open_memstream(char **out_text, size_t *out_size) {
    const size_t size = 65536U;
    *out_text = (char *)__wrap_calloc(1, size);
    *out_size = 0;
    return fmemopen(*out_text, size, "w");
}

// ---- a life ----------------------------------------------------------------------------------------------------------

static void close_all(void) {
    for (int fd = 3; fd < DESCRIPTORS; fd++) {
        if (table[fd].kind != VK_FREE) {
            forget(fd);
        }
    }
    for (unsigned i = 0; i < BLOCKS; i++) {
        __real_free(blocks[i]);
        blocks[i] = NULL;
    }
    if (ring != NULL) { // Unmap it after a kill: this process may have 65,000 mappings.
        (void)__wrap_munmap(ring, ring_size);
    }
    vk_forget_sockets();
}

vk_end_t vk_live(void) {
    static char program[] = "iwheel-gateway";
    static char option[] = "-c";
    static char file[] = "/etc/iwheel/gateway.conf";
    char *arguments[] = {program, option, file, NULL};
    vk.doomed = stealing = false;
    vk.alive = true;
    vk.signal = 0;
    vk.exit_code = -1;
    vk.link.child = 0;
    if (setjmp(vk.leave) == 0) {
        optind = 0; // As in a new process.
        vk.exit_code = gateway_main(3, arguments);
    }
    const bool killed = vk.doomed;
    vk.doomed = vk.alive = stealing = false;
    close_all();
    return (vk.exit_code >= 0) ? VK_EXITED : killed ? VK_KILLED : VK_OVER;
}
