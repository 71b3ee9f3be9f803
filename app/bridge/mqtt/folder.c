// SPDX-License-Identifier: MIT
#include "folder.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_ours(uid_t owner) {
    return owner == 0U || owner == geteuid();
}

int mqtt_folder_open(const char *directory) {
    struct stat status;
    const int folder = open(directory, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (folder >= 0 &&
        (fstat(folder, &status) != 0 || !is_ours(status.st_uid) || (status.st_mode & (S_IWGRP | S_IWOTH)) != 0U)) {
        (void)close(folder);
        errno = EPERM;
        return -1;
    }
    return folder;
}

int mqtt_folder_open_file(int folder, const char *name) {
    struct stat status;
    const int file = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (file >= 0 &&
        (fstat(file, &status) != 0 || !S_ISREG(status.st_mode) || status.st_nlink != 1U || !is_ours(status.st_uid))) {
        (void)close(file);
        errno = EPERM;
        return -1;
    }
    return file;
}

int mqtt_folder_judge(const char *directory, const char *name, int *out_unwritten) {
    const int folder = mqtt_folder_open(directory);
    const int file = (folder >= 0) ? mqtt_folder_open_file(folder, name) : -1;
    const int error = (folder < 0 || (file < 0 && errno != ENOENT)) ? errno : 0;
    *out_unwritten = (error == 0 && faccessat(folder, ".", W_OK | X_OK, AT_EACCESS) != 0) ? errno : 0;
    if (file >= 0) {
        (void)close(file);
    }
    if (folder >= 0) {
        (void)close(folder);
    }
    return error;
}
