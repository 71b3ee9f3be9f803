// SPDX-License-Identifier: MIT
#include "recorder.h"
#include "talk/near.h"
#include "talk/signals.h"
#include "text/text.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define USUAL_BUS "can0"

typedef struct {
    const char *path; ///< NULL: a name made of the time.
    const char *bus;  ///< NULL: not told.
    int64_t for_us;   ///< 0: until a signal.
} words_t;

/// "10s", "5min", "2h", "500ms". False if it is none.
static bool parse_time(const char *text, int64_t *out_us) {
    static const struct {
        const char *unit;
        int64_t us;
    } units[] = {{"ms", 1000}, {"s", 1000000}, {"min", 60000000}, {"h", 3600000000}};
    char *end = NULL;
    if (text == NULL || text[0] < '0' || text[0] > '9') {
        return false;
    }
    const unsigned long number = strtoul(text, &end, 10);
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(end, units[i].unit) == 0 && number > 0U && number < 1000000U) {
            *out_us = (int64_t)number * units[i].us;
            return true;
        }
    }
    return false;
}

static int parse(words_t *self, int count, char **words) {
    for (int i = 0; i < count; i++) {
        const char *next = i + 1 < count ? words[i + 1] : NULL;
        if (strcmp(words[i], "--for") == 0) {
            if (!parse_time(next, &self->for_us)) {
                return ctl_fail(CTL_USAGE, "--for wants a time with its unit: 500ms, 10s, 5min, 2h");
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
    self->file = fd >= 0 ? fdopen(fd, "w") : NULL;
    self->name = path;
    if (self->file == NULL) {
        return errno == EEXIST
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
        (void)ctl_fail(CTL_OK, "recording what the gateway on %s sees, to %s; Ctrl-C ends it", gateway.bus, self->name);
        return recorder_from_gateway(ctl, self);
    }
    const char *bus = words->bus != NULL ? words->bus : USUAL_BUS;
    name_interface(self, bus);
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
    return code != CTL_OK
               ? code
               : ctl_fail(CTL_NO, "the bus was silent, nothing is recorded: wheels powered? cable? iwheelctl "
                                  "doctor tells");
}

static int finish(recorder_t *self, int code) {
    const int error = errno;
    const bool broken = ferror(self->file) != 0;
    if (self->frames == 0U) {
        return finish_empty(self, code);
    }
    const bool closed = self->file == stdout ? fflush(stdout) == 0 : fclose(self->file) == 0;
    const int64_t ms = (self->last_us - self->first_us) / 1000;
    (void)ctl_fail(CTL_OK, "%" PRIu64 " frames in %" PRId64 ".%" PRId64 " s recorded to %s", self->frames, ms / 1000,
                   ms % 1000 / 100, self->name);
    if (self->lost > 0U) {
        (void)ctl_fail(CTL_OK, "%" PRIu64 " frames came faster than they could be taken and are missing", self->lost);
    }
    if (broken || !closed) {
        const int why = broken ? error : errno;
        return why == EPIPE
                   ? CTL_OK
                   : ctl_fail(CTL_UNAVAILABLE, "%s: cannot be written: %s; make room", self->name, strerror(why));
    }
    return code;
}

int verb_record(ctl_t *self, int count, char **words) {
    words_t parsed = {0};
    recorder_t recorder = {.wall_minus_us = wall_minus_us()};
    int code = parse(&parsed, count, words);
    code = code == CTL_OK ? open_file(&recorder, parsed.path) : code;
    if (code != CTL_OK) {
        return code;
    }
    self->json = false;
    signals_catch();
    recorder.end_us = parsed.for_us > 0 ? client_now_us() + parsed.for_us : INT64_MAX;
    code = record(self, &parsed, &recorder);
    return finish(&recorder, code);
}
