// SPDX-License-Identifier: MIT
#include "token.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool complain(const web_token_t *self, const char *what, FILE *err) {
    (void)fprintf(err, "iwheel-web: %s: %s\n", self->path, what);
    return false;
}

/// Writes a new file and renames it, so that no program reads an incomplete file.
static bool make(const web_token_t *self, FILE *err) {
    char token[WEB_TOKEN_SIZE];
    char temporary[128];
    (void)snprintf(temporary, sizeof temporary, "%s.new", self->path);
    (void)unlink(temporary);
    const int file =
        bridge_secret_draw(token) ? open(temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600) : -1;
    if (file < 0) {
        (void)complain(self, strerror(errno), err);
        return complain(self, "cannot be created; set token_file to a file in a folder to which the bridge may write",
                        err);
    }
    token[WEB_TOKEN_SIZE - 1U] = '\n';
    const bool written = write(file, token, sizeof token) == (ssize_t)sizeof token;
    (void)close(file);
    return (written && rename(temporary, self->path) == 0) ||
           complain(self, "cannot be written; is the disk full?", err);
}

static bool read_file(web_token_t *self, int file, const struct stat *status, bool *out_changed) {
    char text[WEB_TOKEN_SIZE + 1U] = "";
    const ssize_t length = read(file, text, WEB_TOKEN_SIZE);
    text[strcspn(text, "\r\n")] = '\0';
    bool good = length >= 0 && strlen(text) == WEB_TOKEN_SIZE - 1U;
    for (size_t i = 0; good && i < WEB_TOKEN_SIZE - 1U; i++) {
        good = isxdigit((unsigned char)text[i]) != 0;
    }
    if (good) {
        *out_changed = *out_changed || strcmp(self->text, text) != 0;
        memcpy(self->text, text, WEB_TOKEN_SIZE);
        self->made = status->st_mtim;
    }
    return good;
}

static bool is_over(const web_token_t *self, const struct stat *status) {
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return self->hours > 0U && now.tv_sec - status->st_mtim.tv_sec >= (time_t)self->hours * 3600;
}

static int open_file(const web_token_t *self) {
    return open(self->path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
}

/// Opens the token file, and makes a new one if necessary. Returns -1 after a complaint.
static int open_in_force(const web_token_t *self, FILE *err) {
    struct stat status = {0};
    int file = open_file(self);
    const bool none = file < 0 && errno == ENOENT;
    if (self->only_reads) {
        if (file < 0) {
            (void)complain(self,
                           none ? "does not exist; iwheel-web creates it at its start: systemctl start iwheel-web"
                                : strerror(errno),
                           err);
        }
        return file;
    }
    if (file >= 0 && fstat(file, &status) == 0 && is_over(self, &status)) {
        (void)close(file);
        file = make(self, err) ? open_file(self) : -1;
    } else if (none) {
        file = make(self, err) ? open_file(self) : -1;
    } else if (file < 0) {
        (void)complain(self, strerror(errno), err);
    }
    return file;
}

static bool is_private(const web_token_t *self, const struct stat *status) {
    const bool ours = status->st_uid == geteuid() || (self->only_reads && geteuid() == 0);
    return S_ISREG(status->st_mode) && ours && (status->st_mode & 077U) == 0;
}

bool web_token_refresh(web_token_t *self, bool *out_changed, FILE *err) {
    struct stat status = {0};
    *out_changed = false;
    const int file = open_in_force(self, err);
    if (file < 0) {
        return false;
    }
    const bool ours = fstat(file, &status) == 0 && is_private(self, &status);
    const bool good = ours && read_file(self, file, &status, out_changed);
    (void)close(file);
    if (!ours) {
        return complain(self, "other users may read or write it; delete it, and the bridge makes a new one", err);
    }
    return good || complain(self, "contains no token; delete it, and the bridge makes a new one", err);
}

bool web_token_judge(const web_token_t *self, FILE *err) {
    web_token_t seen = *self;
    struct stat status = {0};
    bool changed = false;
    const int file = open_file(self);
    const bool made = (file < 0) ? errno == ENOENT : (fstat(file, &status) == 0 && is_over(self, &status));
    if (file >= 0) {
        (void)close(file);
    }
    seen.only_reads = true;
    return made || web_token_refresh(&seen, &changed, err);
}
