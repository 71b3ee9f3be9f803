// SPDX-License-Identifier: MIT
/// The calls that the linker leads into the virtual kernel, with the linker's names. Each behaves as in its manual page, as far as the
/// gateway uses it.
#ifndef DAEMON_WRAPPED_H
#define DAEMON_WRAPPED_H

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <time.h>

struct mnl_socket;
typedef void (*vk_handler_t)(int);

/// The user that runs the gateway and owns its folders.
#define VK_USER 999U

/// The gateway's `main` under another name.
int gateway_main(int argc, char **argv);

int __wrap_close(int fd);
int __wrap_fcntl(int fd, int command, ...);
int __wrap_epoll_create1(int flags);
int __wrap_epoll_ctl(int epoll, int operation, int fd, struct epoll_event *event);
int __wrap_epoll_wait(int epoll, struct epoll_event *events, int max, int timeout_ms);
long __wrap_syscall(long number, ...);
int __wrap_poll(struct pollfd *entries, nfds_t count, int timeout_ms);
int __wrap_clock_gettime(clockid_t clock, struct timespec *out_time);
int __wrap_nanosleep(const struct timespec *span, struct timespec *left);
int __wrap_signalfd(int fd, const sigset_t *mask, int flags);
int __wrap_sigprocmask(int how, const sigset_t *set, sigset_t *old);
vk_handler_t __wrap_signal(int number, vk_handler_t handler);
int __wrap_prctl(int option, ...);
pid_t __wrap_getpid(void);
ssize_t __wrap_getrandom(void *out, size_t size, unsigned flags);
uid_t __wrap_geteuid(void);
pid_t __wrap_fork(void);
pid_t __wrap_waitpid(pid_t pid, int *status, int options);
void *__wrap_calloc(size_t count, size_t size);
void __wrap_free(void *block);
void *__wrap_mmap(void *at, size_t size, int rights, int kind, int fd, off_t offset);
int __wrap_munmap(void *at, size_t size);
FILE *__wrap_open_memstream(char **out_text, size_t *out_size);

int __wrap_open(const char *path, int flags, ...);
int __wrap_openat(int folder, const char *name, int flags, ...);
ssize_t __wrap_read(int fd, void *out, size_t size);
ssize_t __wrap_write(int fd, const void *bytes, size_t size);
ssize_t __wrap_pread(int fd, void *out, size_t size, off_t offset);
ssize_t __wrap_pwrite(int fd, const void *bytes, size_t size, off_t offset);
int __wrap_ftruncate(int fd, off_t size);
int __wrap_flock(int fd, int operation);
int __wrap_fchown(int fd, uid_t user, gid_t group);
int __wrap_fchmodat(int folder, const char *name, mode_t mode, int flags);
int __wrap_fstat(int fd, struct stat *out_status);
int __wrap_fstatat(int folder, const char *name, struct stat *out_status, int flags);
int __wrap_lstat(const char *path, struct stat *out_status);
int __wrap_stat(const char *path, struct stat *out_status);
int __wrap_unlink(const char *path);
int __wrap_unlinkat(int folder, const char *name, int flags);
int __wrap_mkdir(const char *path, mode_t mode);
int __wrap_fchdir(int fd);
mode_t __wrap_umask(mode_t mask);

int __wrap_socket(int domain, int type, int protocol);
int __wrap_socketpair(int domain, int type, int protocol, int ends[2]);
int __wrap_bind(int fd, const struct sockaddr *address, socklen_t length);
int __wrap_listen(int fd, int backlog);
int __wrap_accept4(int fd, struct sockaddr *address, socklen_t *length, int flags);
int __wrap_connect(int fd, const struct sockaddr *address, socklen_t length);
int __wrap_getsockopt(int fd, int level, int name, void *out_value, socklen_t *length);
int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t length);
ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags);
int __wrap_sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags);
ssize_t __wrap_sendto(int fd, const void *bytes, size_t size, int flags, const struct sockaddr *to, socklen_t length);
ssize_t __wrap_recv(int fd, void *out, size_t size, int flags);
int __wrap_recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout);
int __wrap_ioctl(int fd, unsigned long request, ...);
struct mnl_socket *__wrap_mnl_socket_open2(int bus, int flags);
int __wrap_mnl_socket_bind(struct mnl_socket *socket, unsigned groups, pid_t pid);
int __wrap_mnl_socket_get_fd(const struct mnl_socket *socket);
int __wrap_mnl_socket_close(struct mnl_socket *socket);
ssize_t __wrap_mnl_socket_sendto(const struct mnl_socket *socket, const void *request, size_t size);
ssize_t __wrap_mnl_socket_recvfrom(const struct mnl_socket *socket, void *out, size_t size);

#endif
