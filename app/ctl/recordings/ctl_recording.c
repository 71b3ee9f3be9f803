// SPDX-License-Identifier: MIT
#include "ctl_recording.h"

#include "config/gateway_config.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define PREFIX "stop-"
/// Frames of two buses in one recording may be out of order by this time; if a clock was set, time goes back further.
#define BACK_US 100000
/// Two frames of a bus in use are closer than this.
#define AHEAD_US 2000000
/// A stamp that is further ahead shows that the clock was set: no recording has a pause this long.
#define PAUSE_MAX_US INT64_C(3600000000)
/// Time limit for one piece, for a gateway with a slow disk.
#define PIECE_MS 20000
/// The gateway stores at most 128 MiB of recordings in total.
#define BYTES_MAX ((int64_t)160 * 1024 * 1024)

static const char *last_part(const char *path) {
    const char *slash = strrchr(path, '/');
    return (slash != NULL) ? slash + 1 : path;
}

/// Returns true if the name is that of a file of the gateway's recordings.
static bool is_ours(const char *path) {
    const char *name = last_part(path);
    const char *ending = strrchr(name, '.');
    return strncmp(name, PREFIX, sizeof PREFIX - 1U) == 0 && ending != NULL &&
           (strcmp(ending, ".log") == 0 || strcmp(ending, ".jsonl") == 0 || strcmp(ending, ".conf") == 0);
}

/// Connects to the gateway without messages: a missing file is reported as a missing file.
static bool connected(ctl_t *ctl) {
    if (!ctl->client.open) {
        near_gateway_t gateway = {0};
        near_find(ctl, NULL, &gateway);
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

/// Fetches the file piece by piece; the whole is compared with its checksum.
static bool fetch(ctl_t *ctl, const char *name, int64_t most, int fd) {
    static char bytes[IWC_PIECE_MAX];
    iwc_piece_t piece = {.size = 1};
    while (piece.next < piece.size && piece.next < most) {
        iwc_let_in(ctl->client.gateway, signals_let_in());
        const iwc_result_t result = iwc_recording(ctl->client.gateway, name, PIECE_MS, bytes, &piece);
        if (result != IWC_OK || piece.size > BYTES_MAX || !write_all(fd, bytes, piece.length)) {
            if (result != IWC_REFUSED) {
                client_close(&ctl->client); // A late reply would count as the reply to another request.
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
    const int file = memfd_create("recording", MFD_CLOEXEC);
    if (file >= 0 && fetch(ctl, last_part(path), most, file)) {
        return file;
    }
    if (file >= 0) {
        (void)close(file);
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

static int report_unopened(const char *path, int error) {
    switch (error) {
    case ENOENT:
        return ctl_fail(CTL_DATA, "%s: the file does not exist; record one: iwheelctl record FILE", path);
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
    self->refused = false;
    self->frames = 0;
    self->bad = 0;
    self->others = 0;
    self->steps = 0;
    self->wrong_stamps = 0;
    self->shift_us = 0;
    self->has_pending = false;
    self->interface[0] = '\0';
    self->fd = standard ? STDIN_FILENO : source_open(ctl, path, SOURCE_WHOLE);
    if (self->fd < 0) {
        return report_unopened(path, errno);
    }
    if (fstat(self->fd, &status) == 0 && S_ISDIR(status.st_mode)) {
        (void)close(self->fd);
        return report_unopened(self->name, EISDIR);
    }
    candump_reader_init(&self->reader, self->fd);
    return CTL_OK;
}

static void report_bad(recording_t *self) {
    self->bad++;
    if (self->bad <= RECORDING_PRINTED_MAX) {
        (void)ctl_fail(CTL_DATA, "%s:%" PRIu64 ": %s", self->name, self->reader.line, self->reader.why);
    } else if (self->bad == RECORDING_PRINTED_MAX + 1U) {
        (void)ctl_fail(CTL_DATA, "%s: more bad lines follow; they are counted, not printed", self->name);
    }
}

/// Returns true if the frame belongs to the interface that is read. If there is a second interface and no choice, the
/// recording is refused.
static bool is_chosen(recording_t *self, const candump_t *frame) {
    if (self->every_interface) {
        return true;
    }
    const char *chosen = (self->only != NULL) ? self->only : self->interface;
    if (self->only == NULL && self->interface[0] == '\0') {
        memcpy(self->interface, frame->interface, sizeof self->interface);
    }
    if (strcmp(frame->interface, chosen) == 0) {
        return true;
    }
    self->others++;
    if (self->only == NULL) {
        self->refused = true;
        (void)ctl_fail(CTL_DATA, "%s:%" PRIu64 ": has frames of two interfaces, %s and %s; choose one: --interface %s",
                       self->name, self->reader.line, self->interface, frame->interface, self->interface);
    }
    return false;
}

/// Reads the next frame of the chosen interface, with its time unchanged.
static bool read_frame(recording_t *self, candump_t *out_frame) {
    while (!self->refused) {
        switch (candump_reader_next(&self->reader, out_frame)) {
        case CANDUMP_READ_FRAME:
            if (is_chosen(self, out_frame)) {
                return true;
            }
            break;
        case CANDUMP_READ_BAD:
            report_bad(self);
            break;
        case CANDUMP_READ_FOREIGN:
            self->refused = true;
            (void)ctl_fail(CTL_DATA, "%s: %s", self->name, self->reader.why);
            break;
        default:
            return false;
        }
    }
    return false;
}

static bool follows(int64_t time_us, int64_t before_us) {
    return time_us >= before_us - BACK_US && time_us <= before_us + AHEAD_US;
}

/// Returns the time of a frame that does not follow the one before it: because of a wrong stamp, a clock that was set,
/// or a pause.
static int64_t judge_jump(recording_t *self, int64_t stamp_us) {
    if (follows(stamp_us, self->last_us)) { // The clock was set back to its former time.
        self->shift_us = 0;
        return stamp_us;
    }
    const uint64_t line = self->reader.line;
    self->has_pending = read_frame(self, &self->pending);
    const bool wrong = self->has_pending && (follows(self->pending.time_us + self->shift_us, self->last_us) ||
                                             follows(self->pending.time_us, self->last_us));
    const int64_t jump_us = stamp_us + self->shift_us - self->last_us;
    if (!wrong && jump_us >= 0 && jump_us <= PAUSE_MAX_US) {
        return stamp_us + self->shift_us;
    }
    if (self->steps + self->wrong_stamps == 0U) {
        self->first_step = line;
    }
    self->steps += wrong ? 0U : 1U;
    self->wrong_stamps += wrong ? 1U : 0U;
    self->shift_us -= wrong ? 0 : jump_us;
    return self->last_us;
}

static void even_time(recording_t *self, candump_t *frame) {
    const int64_t time_us = frame->time_us + self->shift_us;
    const bool first = self->frames == 1U;
    frame->time_us = (first || follows(time_us, self->last_us)) ? time_us : judge_jump(self, frame->time_us);
    self->last_us = frame->time_us;
}

bool recording_next(recording_t *self, candump_t *out_frame) {
    if (self->has_pending) {
        self->has_pending = false;
        *out_frame = self->pending;
    } else if (!read_frame(self, out_frame)) {
        return false;
    }
    self->frames++;
    if (self->even) {
        even_time(self, out_frame);
    }
    return true;
}

bool recording_is_drained(const recording_t *self) {
    return self->reader.begin == self->reader.end && !self->has_pending;
}

static void report_clock(const recording_t *self) {
    if (self->steps + self->wrong_stamps > 0U) {
        (void)ctl_fail(CTL_OK,
                       "%s: the clock was set %" PRIu64 " times, and %" PRIu64
                       " single times are wrong, first in line %" PRIu64 "; each such frame is placed directly "
                       "after the one before it",
                       self->name, self->steps, self->wrong_stamps, self->first_step);
    }
}

int recording_close(recording_t *self) {
    const int error = errno;
    if (self->fd > STDERR_FILENO) {
        (void)close(self->fd);
    }
    if (self->reader.source == CANDUMP_BROKEN) {
        return ctl_fail(CTL_DATA, "%s: cannot be read further than line %" PRIu64 ": %s", self->name, self->reader.line,
                        strerror(error));
    }
    report_clock(self);
    if (self->refused) {
        return CTL_DATA;
    }
    if (self->bad > 0U) {
        return ctl_fail(CTL_DATA, "%s: %" PRIu64 " of %" PRIu64 " lines that are not empty were left out", self->name,
                        self->bad, self->bad + self->frames);
    }
    if (self->frames == 0U && self->others > 0U) {
        return ctl_fail(CTL_DATA,
                        "%s: it has no frame of interface %s; name one of its interfaces: iwheelctl decode %s",
                        self->name, self->only, self->name);
    }
    if (self->frames == 0U) {
        return ctl_fail(CTL_DATA, "%s: it has no frame", self->name);
    }
    return CTL_OK;
}

int config_option_load(const option_t *option, const char *verb, const char *path) {
    gateway_config_t config;
    if (path == NULL) {
        return ctl_fail(CTL_USAGE, "--config needs the gateway's configuration file; see: iwheelctl %s --help", verb);
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
