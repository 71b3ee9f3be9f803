// SPDX-License-Identifier: MIT
#include "recording.h"

#include "talk/ctl.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int tell_unopened(const char *path, int error) {
    switch (error) {
    case ENOENT:
        return ctl_fail(CTL_DATA, "%s: there is no such file; record one: iwheelctl record FILE", path);
    case EACCES:
    case EPERM:
        return ctl_fail(CTL_PERMISSION, "%s: you may not read it; ask its owner, or use sudo", path);
    case EISDIR:
        return ctl_fail(CTL_DATA, "%s: is a directory; name a recording in it", path);
    default:
        return ctl_fail(CTL_DATA, "%s: cannot be opened: %s", path, strerror(error));
    }
}

int recording_open(recording_t *self, const char *path) {
    const bool standard = strcmp(path, "-") == 0;
    const int fd = standard ? STDIN_FILENO : open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY);
    return (fd >= 0) ? recording_take(self, standard ? "standard input" : path, fd) : tell_unopened(path, errno);
}

int recording_take(recording_t *self, const char *path, int fd) {
    struct stat status;
    self->name = path;
    self->frames = 0;
    self->bad = 0;
    self->fd = fd;
    if (fstat(self->fd, &status) == 0 && S_ISDIR(status.st_mode)) {
        (void)close(self->fd);
        return tell_unopened(path, EISDIR);
    }
    candump_reader_init(&self->reader, self->fd);
    return CTL_OK;
}

static void tell_bad(recording_t *self) {
    self->bad++;
    if (self->bad <= RECORDING_TOLD_MAX) {
        (void)ctl_fail(CTL_DATA, "%s:%" PRIu64 ": %s", self->name, self->reader.line, self->reader.why);
    } else if (self->bad == RECORDING_TOLD_MAX + 1U) {
        (void)ctl_fail(CTL_DATA, "%s: more bad lines follow; they are counted, not told", self->name);
    }
}

bool recording_next(recording_t *self, candump_t *out_frame) {
    for (;;) {
        switch (candump_reader_next(&self->reader, out_frame)) {
        case CANDUMP_READ_FRAME:
            self->frames++;
            return true;
        case CANDUMP_READ_BAD:
            tell_bad(self);
            break;
        default:
            return false;
        }
    }
}

bool recording_is_drained(const recording_t *self) {
    return self->reader.begin == self->reader.end;
}

int recording_close(recording_t *self) {
    const int error = errno;
    if (self->fd > STDERR_FILENO) {
        (void)close(self->fd);
    }
    if (self->reader.failed) {
        return ctl_fail(CTL_DATA, "%s: cannot be read further than line %" PRIu64 ": %s", self->name, self->reader.line,
                        strerror(error));
    }
    if (self->bad > 0U) {
        return ctl_fail(CTL_DATA, "%s: %" PRIu64 " of %" PRIu64 " lines with something on them were left out",
                        self->name, self->bad, self->bad + self->frames);
    }
    if (self->frames == 0U) {
        return ctl_fail(CTL_DATA, "%s: there is no frame in it", self->name);
    }
    return CTL_OK;
}
