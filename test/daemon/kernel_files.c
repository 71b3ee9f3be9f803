// SPDX-License-Identifier: MIT
// Files of the virtual kernel, in memory; they outlive the gateway. And the GPIO line with the interface of libgpiod 1.5.
#include "kernel.h"

#include "wrapped.h"

#include <errno.h>
#include <fcntl.h>
#include <gpiod.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define FILES     24
#define PATH_SIZE 96U

typedef struct {
    char path[PATH_SIZE]; ///< Empty: no file.
    mode_t mode;          ///< Mode and kind.
    ino_t inode;
    bool locked;
    size_t length;
    char bytes[2048];
} file_t;

static file_t files[FILES];
static ino_t last_inode;
static int current = -1; ///< Current folder of the process; -1: the root.

static int find(const char *path) {
    for (int i = 0; i < FILES; i++) {
        if (files[i].path[0] != '\0' && strcmp(files[i].path, path) == 0) {
            return i;
        }
    }
    errno = ENOENT;
    return -1;
}

static int make(const char *path, mode_t mode, const char *text) {
    for (int i = 0; i < FILES; i++) {
        if (files[i].path[0] == '\0') {
            files[i] = (file_t){.mode = mode, .inode = ++last_inode, .length = strlen(text)};
            (void)snprintf(files[i].path, sizeof files[i].path, "%s", path);
            memcpy(files[i].bytes, text, files[i].length);
            return i;
        }
    }
    errno = ENOSPC;
    return -1;
}

void vk_files_begin(const char *config) {
    memset(files, 0, sizeof files);
    last_inode = 100;
    current = -1;
    (void)make("/", S_IFDIR | 0755, "");
    (void)make("/run/iwheel", S_IFDIR | 0755, "");
    (void)make("/etc/iwheel/gateway.conf", S_IFREG | 0644, config);
    (void)make("/dev/null", S_IFCHR | 0666, "");
    (void)make("/proc/self/fd/2", S_IFREG | 0600, "");
    (void)make("/proc/self/ns/net", S_IFREG | 0444, "");
    (void)make("/sys/class/net/" VK_INTERFACE "/carrier", S_IFREG | 0444, "1\n");
}

bool vk_file_exists(const char *path) {
    return find(path) >= 0;
}

/// Resolves a path as the kernel does from `folder`, AT_FDCWD or a descriptor.
static void resolve(int folder, const char *name, char out_path[PATH_SIZE]) {
    const int base = (folder == AT_FDCWD) ? current : vk_fd(folder)->number;
    const char *from = (base < 0) ? "" : files[base].path;
    if (name[0] == '/') {
        (void)snprintf(out_path, PATH_SIZE, "%.95s", name);
    } else if (strcmp(name, ".") == 0) {
        (void)snprintf(out_path, PATH_SIZE, "%.95s", (base < 0) ? "/" : from);
    } else {
        (void)snprintf(out_path, PATH_SIZE, "%.60s/%.30s", from, name);
    }
}

static void note_marker(const char *path, bool failed) {
    vk.marker_failed = (strcmp(path, VK_MARKER) == 0) ? failed : vk.marker_failed;
}

static int open_path(int folder, const char *name, int flags) {
    static const int errors[] = {EMFILE, ENFILE, ENOMEM, 0};
    static const int making[] = {EMFILE, ENFILE, ENOMEM, ENOSPC, 0};
    char path[PATH_SIZE];
    resolve(folder, name, path);
    if (!vk_call("open", ((flags & O_CREAT) != 0) ? making : errors)) {
        note_marker(path, true);
        return -1;
    }
    int file = find(path);
    if (file >= 0 && (flags & O_EXCL) != 0) {
        errno = EEXIST;
        return -1;
    }
    if (file < 0 && (flags & O_CREAT) != 0) {
        file = make(path, S_IFREG | 0600, "");
    }
    const int fd = (file < 0) ? -1 : vk_open_fd("open", VK_FILE, file);
    if (file >= 0) {
        note_marker(path, fd < 0);
    }
    return (int)vk_done(fd);
}

int __wrap_open(const char *path, int flags, ...) {
    return open_path(AT_FDCWD, path, flags);
}

int __wrap_openat(int folder, const char *name, int flags, ...) {
    return open_path(folder, name, flags);
}

ssize_t __wrap_read(int fd, void *out, size_t size) {
    vk_fd_t *entry = vk_fd(fd);
    if (entry->kind == VK_SIGNAL) {
        return vk_read_signal(out, size);
    }
    (void)vk_call("read", NULL);
    const file_t *file = &files[entry->number];
    const size_t left = (file->length > entry->offset) ? file->length - entry->offset : 0U;
    const size_t count = (size < left) ? size : left;
    memcpy(out, &file->bytes[entry->offset], count);
    entry->offset += count;
    return vk_done((long)count);
}

/// A write to the log only, which has no reader; a full pipe accepts a part.
ssize_t __wrap_write(int fd, const void *bytes, size_t size) {
    static const int errors[] = {EAGAIN, EINTR, 0};
    (void)((fd > STDERR_FILENO) ? vk_fd(fd) : NULL);
    if (vk.trace) {
        printf("  %11.6f s    prints: %.*s", (double)vk.now_us / 1e6, (int)size, (const char *)bytes);
    }
    return vk_call("write", errors) ? vk_done((long)size) : -1;
}

ssize_t __wrap_pread(int fd, void *out, size_t size, off_t offset) {
    (void)vk_call("pread", NULL);
    const file_t *file = &files[vk_fd(fd)->number];
    const size_t count = (size < file->length) ? size : file->length;
    memcpy(out, &file->bytes[offset], count);
    return vk_done((long)count);
}

/// When the process is killed, only a part may be written.
ssize_t __wrap_pwrite(int fd, const void *bytes, size_t size, off_t offset) {
    (void)vk_call("pwrite", NULL);
    file_t *file = &files[vk_fd(fd)->number];
    file->length = (size_t)offset + (vk.doomed ? sim_random_below(&vk.random, (uint32_t)size) : size);
    memcpy(&file->bytes[offset], bytes, size);
    return vk_done((long)size);
}

int __wrap_ftruncate(int fd, off_t size) {
    (void)vk_call("ftruncate", NULL);
    files[vk_fd(fd)->number].length = (size_t)size;
    return (int)vk_done(0);
}

int __wrap_flock(int fd, int operation) {
    (void)vk_call("flock", NULL);
    (void)operation; // There is one gateway, and its lock ends with the process.
    (void)vk_fd(fd);
    return (int)vk_done(0);
}

int __wrap_fchown(int fd, uid_t user, gid_t group) {
    (void)vk_call("fchown", NULL);
    (void)fd;
    (void)user;
    (void)group;
    return (int)vk_done(0);
}

int __wrap_fchmodat(int folder, const char *name, mode_t mode, int flags) {
    (void)vk_call("fchmodat", NULL);
    (void)folder;
    (void)name;
    (void)mode;
    (void)flags;
    return (int)vk_done(0);
}

static int print_status(int file, struct stat *out_status) {
    if (file < 0) {
        return -1;
    }
    *out_status = (struct stat){.st_dev = 1,
                                .st_ino = files[file].inode,
                                .st_mode = files[file].mode,
                                .st_nlink = 1,
                                .st_uid = VK_USER,
                                .st_size = (off_t)files[file].length};
    return (int)vk_done(0);
}

int __wrap_fstat(int fd, struct stat *out_status) {
    (void)vk_call("fstat", NULL);
    if (fd <= 2) {
        *out_status = (struct stat){.st_mode = S_IFIFO | 0600};
        return (int)vk_done(0);
    }
    return print_status(vk_fd(fd)->number, out_status);
}

int __wrap_fstatat(int folder, const char *name, struct stat *out_status, int flags) {
    char path[PATH_SIZE];
    (void)flags;
    (void)vk_call("fstatat", NULL);
    resolve(folder, name, path);
    return print_status(find(path), out_status);
}

int __wrap_lstat(const char *path, struct stat *out_status) {
    (void)vk_call("lstat", NULL);
    return print_status(find(path), out_status);
}

int __wrap_stat(const char *path, struct stat *out_status) {
    return __wrap_lstat(path, out_status);
}

static int unlink_path(int folder, const char *name) {
    static const int errors[] = {ENOMEM, 0};
    char path[PATH_SIZE];
    resolve(folder, name, path);
    if (!vk_call("unlink", errors)) {
        note_marker(path, true);
        return -1;
    }
    const int file = find(path);
    if (file < 0) {
        return -1;
    }
    note_marker(path, false);
    files[file].path[0] = '\0';
    return (int)vk_done(0);
}

int __wrap_unlink(const char *path) {
    return unlink_path(AT_FDCWD, path);
}

int __wrap_unlinkat(int folder, const char *name, int flags) {
    (void)flags;
    return unlink_path(folder, name);
}

int __wrap_mkdir(const char *path, mode_t mode) {
    (void)vk_call("mkdir", NULL);
    (void)mode;
    errno = EEXIST;
    return (find(path) >= 0) ? -1 : (int)vk_done(-1);
}

int __wrap_fchdir(int fd) {
    (void)vk_call("fchdir", NULL);
    current = vk_fd(fd)->number;
    return (int)vk_done(0);
}

mode_t __wrap_umask(mode_t mask) {
    (void)vk_call("umask", NULL);
    (void)mask;
    return (mode_t)vk_done(022);
}

int vk_make_socket_file(const char *name) {
    char path[PATH_SIZE];
    resolve(AT_FDCWD, name, path);
    if (find(path) >= 0) {
        errno = EADDRINUSE;
        return -1;
    }
    return make(path, S_IFSOCK | 0660, "");
}

const char *vk_path_of(int file) {
    return files[file].path;
}

void vk_set_carrier(void) {
    const int file = find("/sys/class/net/" VK_INTERFACE "/carrier");
    files[file].bytes[0] = vk.link.off ? '0' : '1';
    files[file].length = vk.link.up ? 2U : 0U;
}

// ---- the GPIO line -------------------------------------------------------------------------------------------------

static char chip; ///< The only one; and its line.
static int line_fd = -1;
static bool iterated; ///< The search over all chips has returned it.

/// True if the chip of the requested line still exists.
static bool is_line_alive(void) {
    return vk.button.there && line_fd >= 0 && vk_fd(line_fd)->number == vk.button.number;
}

struct gpiod_chip *gpiod_chip_open_by_name(const char *name) {
    (void)name;
    errno = ENOENT;
    return NULL;
}

void gpiod_chip_close(struct gpiod_chip *unused) {
    (void)unused;
}

struct gpiod_line *gpiod_chip_get_line(struct gpiod_chip *unused, unsigned offset) {
    (void)unused;
    return (offset == 0U) ? (struct gpiod_line *)(void *)&chip : NULL;
}

/// Opens all chips.
struct gpiod_chip_iter *gpiod_chip_iter_new(void) {
    static const int errors[] = {EMFILE, ENOMEM, EINTR, 0};
    line_fd = -1;
    if (!vk_call("gpiod_chip_iter_new", errors)) {
        return NULL;
    }
    iterated = false;
    (void)vk_done(0);
    return (struct gpiod_chip_iter *)(void *)&chip;
}

struct gpiod_chip *gpiod_chip_iter_next_noclose(struct gpiod_chip_iter *iter) {
    const bool next = vk.button.there && !iterated;
    (void)iter;
    iterated = true;
    return next ? (struct gpiod_chip *)(void *)&chip : NULL;
}

void gpiod_chip_iter_free_noclose(struct gpiod_chip_iter *iter) {
    (void)iter;
}

unsigned gpiod_chip_num_lines(struct gpiod_chip *unused) {
    (void)unused;
    return 1U;
}

const char *gpiod_line_name(struct gpiod_line *line) {
    (void)line;
    return VK_LINE;
}

struct gpiod_chip *gpiod_line_get_chip(struct gpiod_line *line) {
    (void)line;
    return (struct gpiod_chip *)(void *)&chip;
}

const char *gpiod_chip_label(struct gpiod_chip *unused) {
    (void)unused;
    return "virtual-gpio";
}

const char *gpiod_chip_name(struct gpiod_chip *unused) {
    (void)unused;
    return "gpiochip0";
}

unsigned gpiod_line_offset(struct gpiod_line *line) {
    (void)line;
    return 0;
}

int gpiod_line_request_both_edges_events_flags(struct gpiod_line *line, const char *consumer, int flags) {
    (void)line;
    (void)consumer;
    (void)flags;
    vk.button.edges = 0;
    line_fd = vk_open_fd("gpiod_line_request", VK_GPIO, vk.button.number);
    return (int)vk_done((line_fd < 0) ? -1 : 0);
}

int gpiod_line_event_get_fd(struct gpiod_line *line) {
    (void)line;
    return line_fd;
}

void gpiod_line_close_chip(struct gpiod_line *line) {
    (void)line;
    if (line_fd >= 0) {
        (void)__wrap_close(line_fd);
    }
    line_fd = -1;
}

int gpiod_line_get_value(struct gpiod_line *line) {
    (void)line;
    (void)vk_call("gpiod_line_get_value", NULL);
    errno = ENODEV;
    return (int)vk_done(is_line_alive() ? (int)vk.button.pressed : -1);
}

int gpiod_line_event_read_fd_multiple(int fd, struct gpiod_line_event *events, unsigned count) {
    static const int errors[] = {EINTR, 0};
    (void)vk_fd(fd);
    memset(events, 0, count * sizeof *events);
    if (!vk_call("gpiod_line_event_read", errors)) {
        return -1;
    }
    if (!is_line_alive() || vk.button.edges == 0) {
        errno = is_line_alive() ? EAGAIN : ENODEV;
        return -1;
    }
    const int read_count = (vk.button.edges < (int)count) ? vk.button.edges : (int)count;
    vk.button.edges -= read_count;
    return (int)vk_done(read_count);
}

void vk_press(bool pressed) {
    if (pressed != vk.button.pressed) {
        vk.button.edges += (vk.button.edges < 16) ? 1 : 0; // The kernel buffers no more.
    }
    vk.button.pressed = pressed;
}
