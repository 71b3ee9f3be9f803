// SPDX-License-Identifier: MIT
#include "owners.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#define OTHERS_WRITE (S_IWGRP | S_IWOTH)

gw_owners_t gw_owners_of(const char *runtime_directory) {
    struct stat status;
    gw_owners_t self = {.own = geteuid(), .service = 0};
    if (lstat(runtime_directory, &status) == 0 && S_ISDIR(status.st_mode) && (status.st_mode & OTHERS_WRITE) == 0U) {
        self.service = status.st_uid;
    }
    return self;
}

bool gw_owners_have(const gw_owners_t *self, uid_t uid) {
    return uid == 0U || uid == self->own || uid == self->service;
}

bool gw_owners_wrote(const gw_owners_t *self, const struct stat *status) {
    return S_ISREG(status->st_mode) && status->st_nlink == 1U && gw_owners_have(self, status->st_uid);
}

/// Opened with a slash behind its name, a symbolic link would be followed.
static int open_unlinked(const char *path) {
    char bare[4096];
    size_t length = strlen(path);
    if (length == 0U || length >= sizeof bare) {
        errno = length == 0U ? ENOENT : ENAMETOOLONG;
        return -1;
    }
    while (length > 1U && path[length - 1U] == '/') {
        --length;
    }
    (void)memcpy(bare, path, length);
    bare[length] = '\0';
    return open(bare, O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
}

static int judge(const struct stat *status, const gw_owners_t *owners, bool *out_shared) {
    const bool sticky = (status->st_mode & S_ISVTX) != 0U;
    *out_shared = (status->st_mode & OTHERS_WRITE) != 0U;
    if (!gw_owners_have(owners, status->st_uid)) {
        return GW_FOLDER_FOREIGN;
    }
    return *out_shared && !sticky ? GW_FOLDER_SHARED : 0;
}

int gw_folder_open(gw_folder_t *self, const char *path, const gw_owners_t *owners) {
    struct stat status;
    *self = (gw_folder_t){.fd = open_unlinked(path)};
    if (self->fd < 0) {
        // What says "no directory" of a symbolic link to one would mislead.
        return errno == ENOTDIR && lstat(path, &status) == 0 && S_ISLNK(status.st_mode) ? ELOOP : errno;
    }
    const int error = fstat(self->fd, &status) != 0 ? errno : judge(&status, owners, &self->shared);
    if (error != 0) {
        gw_folder_close(self);
    }
    return error;
}

void gw_folder_close(gw_folder_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
}

const char *gw_folder_fault(int error) {
    switch (error) {
    case GW_FOLDER_FOREIGN:
        return "its directory belongs to another user, who could put anything in its place";
    case GW_FOLDER_SHARED:
        return "others than its owner may write to its directory and put anything in its place";
    case ELOOP:
        return "its directory is a symbolic link, which is not followed";
    default:
        return strerror(error);
    }
}

const char *gw_folder_cure(int error) {
    switch (error) {
    case GW_FOLDER_FOREIGN:
        return "give the directory to the gateway's user (chown)";
    case GW_FOLDER_SHARED:
        return "take that right away (chmod go-w)";
    case ELOOP:
        return "name the real directory";
    case ENOENT:
        return "make the directory";
    case ENOSPC:
    case EDQUOT:
        return "make room there";
    case EROFS:
        return "it is mounted read-only";
    case EACCES:
    case EPERM:
        return "give the directory to the gateway's user";
    default:
        return "mend it";
    }
}
