// SPDX-License-Identifier: MIT
#include "recorder.h"
#include "talk/near.h"
#include "talk/signals.h"
#include "text/duration.h"
#include "text/text.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define USUAL_BUS "can0"
/// A millisecond to a month.
#define FOR_MIN_US 1000
#define FOR_MAX_US (720 * INT64_C(3600000000))

typedef struct {
    const char *path; ///< NULL: a name made of the time.
    const char *bus;  ///< NULL: not told.
    int64_t for_us;   ///< 0: until a signal.
} words_t;

static int parse(words_t *self, int count, char **words) {
    static const duration_range_t range = {FOR_MIN_US, FOR_MAX_US};
    char why[DURATION_WHY_SIZE];
    for (int i = 0; i < count; i++) {
        const char *next = (i + 1 < count) ? words[i + 1] : NULL;
        if (strcmp(words[i], "--for") == 0) {
            if (!duration_option("--for", next, range, &self->for_us, why)) {
                return ctl_fail(CTL_USAGE, "%s", why);
            }
            i++;
        } else if (strcmp(words[i], "--can") == 0) {
            if (next == NULL) {
                return ctl_fail(CTL_USAGE, "--can wants a bus: can0, or unix:PATH");
            }
            self->bus = next;
            i++;
        } else if ((words[i][0] == '-' && words[i][1] != '\0') || self->path != NULL) {
            return ctl_fail(CTL_USAGE, "record does not understand \"%s\"; see: iwheelctl record --help", words[i]);
        } else {
            self->path = words[i];
        }
    }
    return CTL_OK;
}

static int open_file(recorder_t *self, const char *path) {
    static char made[64];
    const time_t now = time(NULL);
    struct tm local;
    if (path != NULL && strcmp(path, "-") == 0) {
        self->file = stdout;
        self->name = "standard output";
        return CTL_OK;
    }
    if (path == NULL) {
        if (localtime_r(&now, &local) == NULL ||
            strftime(made, sizeof made, "iwheel-%Y%m%d-%H%M%S.log", &local) == 0U) {
            (void)snprintf(made, sizeof made, "iwheel.log");
        }
        path = made;
    }
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    self->file = (fd >= 0) ? fdopen(fd, "w") : NULL;
    self->name = path;
    if (self->file == NULL) {
        return (errno == EEXIST)
                   ? ctl_fail(CTL_USAGE, "%s is there already; name another file, or remove it", path)
                   : ctl_fail(CTL_UNAVAILABLE, "%s: cannot be made: %s; name another place", path, strerror(errno));
    }
    return CTL_OK;
}

static void name_interface(recorder_t *self, const char *bus) {
    const bool local = strncmp(bus, "unix:", 5) == 0;
    (void)snprintf(self->interface, sizeof self->interface, "%.31s", local ? "local" : bus);
}

static int64_t wall_minus_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000 - client_now_us();
}

/// From the gateway if there is one for this bus: it also knows its own frames from others'.
static int record(ctl_t *ctl, const words_t *words, recorder_t *self) {
    near_gateway_t gateway = {0};
    near_look(ctl, words->bus, &gateway);
    json_decref(gateway.status);
    if (gateway.result == NEAR_FOUND) {
        name_interface(self, gateway.bus);
        (void)snprintf(self->bus, sizeof self->bus, "%s", gateway.bus);
        self->from_gateway = true;
        (void)ctl_fail(CTL_OK, "recording what the gateway on %s sees, to %s; Ctrl-C ends it", gateway.bus, self->name);
        return recorder_from_gateway(ctl, self);
    }
    const char *bus = (words->bus != NULL) ? words->bus : USUAL_BUS;
    name_interface(self, bus);
    (void)snprintf(self->bus, sizeof self->bus, "%s", bus);
    (void)ctl_fail(CTL_OK, "no gateway for it: recording from %s itself, sending nothing, to %s; Ctrl-C ends it", bus,
                   self->name);
    return recorder_from_bus(bus, self);
}

/// Nothing came: no file is left behind.
static int finish_empty(recorder_t *self, int code) {
    if (self->file != stdout) {
        (void)fclose(self->file);
        (void)unlink(self->name);
    }
    return (code != CTL_OK)
               ? code
               : ctl_fail(CTL_NO, "the bus was silent, nothing is recorded: wheels powered? cable? iwheelctl "
                                  "doctor tells");
}

static void sum_up(const recorder_t *self, bool json) {
    const int64_t span_us = self->last_us - self->first_us;
    const int64_t ms = span_us / 1000;
    if (json) {
        json_t *sum = json_pack("{s:b,s:s,s:s,s:b,s:I,s:I,s:I}", "ok", 1, "file", self->name, "bus", self->bus,
                                "gateway", (int)self->from_gateway, "frames", (json_int_t)self->frames, "lost",
                                (json_int_t)self->lost, "span_us", (json_int_t)span_us);
        (void)json_dumpf(sum, stdout, JSON_COMPACT);
        (void)putchar('\n');
        json_decref(sum);
        return;
    }
    (void)ctl_fail(CTL_OK, "%" PRIu64 " frames in %" PRId64 ".%" PRId64 " s recorded to %s", self->frames, ms / 1000,
                   ms % 1000 / 100, self->name);
    if (self->lost > 0U) {
        (void)ctl_fail(CTL_OK, "%" PRIu64 " frames came faster than they could be taken and are missing", self->lost);
    }
}

static int finish(recorder_t *self, bool json, int code) {
    const int error = errno;
    const bool broken = ferror(self->file) != 0;
    if (self->frames == 0U) {
        return finish_empty(self, code);
    }
    const bool closed = (self->file == stdout) ? fflush(stdout) == 0 : fclose(self->file) == 0;
    const int why = broken ? error : errno;
    if (!broken && closed) {
        sum_up(self, json);
        return code;
    }
    return (why == EPIPE)
               ? CTL_OK
               : ctl_fail(CTL_UNAVAILABLE, "%s: cannot be written: %s; make room", self->name, strerror(why));
}

int verb_record(ctl_t *self, int count, char **words) {
    words_t parsed = {0};
    recorder_t recorder = {.wall_minus_us = wall_minus_us()};
    const bool json = self->json;
    int code = parse(&parsed, count, words);
    if (code == CTL_OK && json && parsed.path != NULL && strcmp(parsed.path, "-") == 0) {
        return ctl_fail(CTL_USAGE, "record writes the recording or --json to standard output, not both; name a FILE");
    }
    code = (code == CTL_OK) ? open_file(&recorder, parsed.path) : code;
    if (code != CTL_OK) {
        return code;
    }
    self->json = false;
    signals_catch();
    recorder.end_us = (parsed.for_us > 0) ? client_now_us() + parsed.for_us : INT64_MAX;
    code = record(self, &parsed, &recorder);
    self->json = json;
    return finish(&recorder, json, code);
}
