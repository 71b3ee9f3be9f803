// SPDX-License-Identifier: MIT
#include "recording.h"

#include "config/gateway_config.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define PREFIX "stop-"
/// A gateway whose disk is slow.
#define PIECE_MS 20000
/// The gateway keeps no more than 128 MiB of recordings together.
#define BYTES_MAX ((int64_t)160 * 1024 * 1024)

static const char *last_part(const char *path) {
    const char *slash = strrchr(path, '/');
    return (slash != NULL) ? slash + 1 : path;
}

/// A file of a recording of the gateway's, by its name.
static bool is_ours(const char *path) {
    const char *name = last_part(path);
    const char *ending = strrchr(name, '.');
    return strncmp(name, PREFIX, sizeof PREFIX - 1U) == 0 && ending != NULL &&
           (strcmp(ending, ".log") == 0 || strcmp(ending, ".jsonl") == 0 || strcmp(ending, ".conf") == 0);
}

/// Looked for without a word: a file that is not there is told as such.
static bool connected(ctl_t *ctl) {
    if (!ctl->client.open) {
        near_gateway_t gateway = {0};
        near_look(ctl, NULL, &gateway);
        json_decref(gateway.status);
    }
    return ctl->client.open;
}

static bool write_all(int fd, const char *bytes, size_t length) {
    while (length > 0U) {
        const ssize_t now = write(fd, bytes, length);
        if (now <= 0) {
            return false;
        }
        bytes += now;
        length -= (size_t)now;
    }
    return true;
}

/// Piece after piece, the whole compared with its checksum.
static bool fetch(ctl_t *ctl, const char *name, int64_t most, int fd) {
    static char bytes[IWC_PIECE_MAX];
    iwc_piece_t piece = {.size = 1};
    while (piece.next < piece.size && piece.next < most) {
        iwc_let_in(ctl->client.gateway, signals_let_in());
        const iwc_result_t result = iwc_recording(ctl->client.gateway, name, PIECE_MS, bytes, &piece);
        if (result != IWC_OK || piece.size > BYTES_MAX || !write_all(fd, bytes, piece.length)) {
            if (result != IWC_REFUSED) {
                client_close(&ctl->client); // A late reply would be taken for another's.
            }
            return false;
        }
    }
    return lseek(fd, 0, SEEK_SET) == 0;
}

int source_open(ctl_t *ctl, const char *path, int64_t most) {
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY);
    const int error = errno;
    const bool absent = error == ENOENT || error == ENOTDIR || error == EACCES || error == EPERM;
    if (fd >= 0 || ctl == NULL || !absent || !is_ours(path) || !connected(ctl)) {
        return fd;
    }
    const int memory = memfd_create("recording", MFD_CLOEXEC);
    if (memory >= 0 && fetch(ctl, last_part(path), most, memory)) {
        return memory;
    }
    if (memory >= 0) {
        (void)close(memory);
    }
    errno = error;
    return -1;
}

FILE *source_stream(ctl_t *ctl, const char *path, int64_t most) {
    const int fd = source_open(ctl, path, most);
    return (fd >= 0) ? fdopen(fd, "r") : NULL;
}

json_t *source_list(ctl_t *ctl) {
    json_t *reply = connected(ctl) ? near_ask(ctl, json_pack("{s:s}", "cmd", "recordings")) : NULL;
    if (!json_is_array(json_object_get(reply, "recordings"))) {
        json_decref(reply);
        return NULL;
    }
    return reply;
}

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

int recording_open(recording_t *self, ctl_t *ctl, const char *path) {
    const bool standard = strcmp(path, "-") == 0;
    struct stat status;
    self->name = standard ? "standard input" : path;
    self->frames = 0;
    self->bad = 0;
    self->fd = standard ? STDIN_FILENO : source_open(ctl, path, SOURCE_WHOLE);
    if (self->fd < 0) {
        return tell_unopened(path, errno);
    }
    if (fstat(self->fd, &status) == 0 && S_ISDIR(status.st_mode)) {
        (void)close(self->fd);
        return tell_unopened(self->name, EISDIR);
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

int config_option_load(const option_t *option, const char *verb, const char *path) {
    gateway_config_t config;
    if (path == NULL) {
        return ctl_fail(CTL_USAGE, "--config wants the gateway's configuration file; see: iwheelctl %s --help", verb);
    }
    if (gateway_config_load(path, &config, stderr) != 0) {
        return CTL_CONFIG;
    }
    *(iw_config_t *)option->out = config.core;
    return CTL_OK;
}

int config_option_take(const char *path, int fd, iw_config_t *out_config) {
    static char text[GATEWAY_CONFIG_FILE_MAX + 1U];
    gateway_config_t config;
    size_t size = 0;
    ssize_t got = 1;
    while (got > 0 && size < sizeof text) {
        got = read(fd, text + size, sizeof text - size);
        size += (got > 0) ? (size_t)got : 0U;
    }
    const int error = errno;
    (void)close(fd);
    if (got < 0 || size == sizeof text) {
        return ctl_fail(CTL_CONFIG, "%s: cannot be read: %s", path, (got < 0) ? strerror(error) : "it is too long");
    }
    if (gateway_config_parse(path, text, size, &config, stderr) != 0) {
        return CTL_CONFIG;
    }
    *out_config = config.core;
    return CTL_OK;
}
