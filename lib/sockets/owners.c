// SPDX-License-Identifier: MIT
#include "owners.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define OTHERS_WRITE (S_IWGRP | S_IWOTH)

sock_owners_t sock_owners_of(const char *runtime_directory) {
    struct stat status;
    sock_owners_t self = {.own = geteuid(), .service = 0};
    if (lstat(runtime_directory, &status) == 0 && S_ISDIR(status.st_mode) && (status.st_mode & OTHERS_WRITE) == 0U) {
        self.service = status.st_uid;
    }
    return self;
}

bool sock_owners_have(const sock_owners_t *self, uid_t uid) {
    return uid == 0U || uid == self->own || uid == self->service;
}

bool sock_owners_wrote(const sock_owners_t *self, const struct stat *status) {
    return S_ISREG(status->st_mode) && status->st_nlink == 1U && sock_owners_have(self, status->st_uid);
}

/// Opens a path without a final slash, with which a symbolic link would be followed.
static int open_unlinked(const char *path) {
    static char bare[4096]; // Too large for a stack.
    struct stat status;
    size_t length = strlen(path);
    if (length == 0U || length >= sizeof bare) {
        errno = (length == 0U) ? ENOENT : ENAMETOOLONG;
        return -1;
    }
    while (length > 1U && path[length - 1U] == '/') {
        length--;
    }
    memcpy(bare, path, length);
    bare[length] = '\0';
    const int fd = open(bare, O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (fd < 0 && errno == ENOTDIR) { // This errno would be misleading.
        errno = (lstat(bare, &status) == 0 && S_ISLNK(status.st_mode)) ? ELOOP : ENOTDIR;
    }
    return fd;
}

static int judge(const struct stat *status, const sock_owners_t *owners, bool *out_shared) {
    const bool sticky = (status->st_mode & S_ISVTX) != 0U;
    *out_shared = (status->st_mode & OTHERS_WRITE) != 0U;
    if (!sock_owners_have(owners, status->st_uid)) {
        return SOCK_FOLDER_FOREIGN;
    }
    return (*out_shared && !sticky) ? SOCK_FOLDER_SHARED : 0;
}

int sock_folder_open(sock_folder_t *self, const char *path, const sock_owners_t *owners) {
    struct stat status;
    *self = (sock_folder_t){.fd = open_unlinked(path)};
    if (self->fd < 0) {
        return errno;
    }
    const int error = (fstat(self->fd, &status) != 0) ? errno : judge(&status, owners, &self->shared);
    if (error != 0) {
        sock_folder_close(self);
    }
    return error;
}

void sock_folder_close(sock_folder_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

int sock_folder_open_own(const char *path) {
    const sock_owners_t owners = sock_owners_of(SOCK_RUNTIME_DIRECTORY);
    sock_folder_t folder;
    int error = sock_folder_open(&folder, path, &owners);
    if (error == 0 && folder.shared) {
        error = SOCK_FOLDER_SHARED;
    }
    const int fd = (error == 0) ? openat(folder.fd, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
    if (error == 0 && fd < 0) {
        error = errno;
    }
    sock_folder_close(&folder);
    errno = error;
    return fd;
}

void sock_folder_of(const char *path, char *out_folder, size_t size) {
    const char *slash = strrchr(path, '/');
    const int length = (slash == NULL || slash == path) ? 1 : (int)(slash - path);
    (void)snprintf(out_folder, size, "%.*s", length, (slash == NULL) ? "." : path);
}

const char *sock_folder_fault(int error) {
    switch (error) {
    case SOCK_FOLDER_FOREIGN:
        return "the directory belongs to another user, who could put any file there";
    case SOCK_FOLDER_SHARED:
        return "other users than the directory's owner may write to it and put any file there";
    case SOCK_FOLDER_FILE:
        return "the file belongs to another user, has a second name, or is not a regular file";
    case ELOOP:
        return "the directory is a symbolic link, which is not followed";
    default:
        return strerror(error);
    }
}

const char *sock_folder_fix(int error) {
    switch (error) {
    case SOCK_FOLDER_FOREIGN:
    case EACCES:
    case EPERM:
        return "make the gateway's user its owner (chown)";
    case SOCK_FOLDER_SHARED:
        return "remove that right (chmod go-w)";
    case SOCK_FOLDER_FILE:
        return "remove it";
    case ELOOP:
        return "name the directory itself";
    case ENOSPC:
    case EDQUOT:
        return "free space there";
    case EROFS:
        return "mount it for writing";
    default:
        return "make the directory";
    }
}
