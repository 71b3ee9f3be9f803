// SPDX-License-Identifier: MIT
#include "candump.h"
#include "decode/frame.h"
#include "talk/ctl.h"
#include "talk/ctl_words.h"

#include "iwheel_linux/backend.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define USUAL_BUS "can0"
/// Bounds of --for: a millisecond to a month.
#define FOR_MIN_US 1000
#define FOR_MAX_US (720 * INT64_C(3600000000))

/// Interval at which the file is flushed, so that other programs can read it.
#define FLUSH_US 1000000
#define POLL_US  500000
/// Longest time in which an interface must come up.
#define UP_US   1000000
#define WAIT_MS 50

/// A recording in progress: its file, its end and the source of its frames.
typedef struct {
    FILE *file;
    const char *name; ///< Name of the file in messages; "standard output".
    char interface[CANDUMP_INTERFACE_SIZE];
    char bus[128];         ///< Bus as requested, or as the gateway names it.
    bool from_gateway;     ///< Otherwise from the bus itself.
    int64_t wall_minus_us; ///< Wall clock minus monotonic clock, constant: the recorded times have no steps.
    int64_t end_us;        ///< Monotonic; INT64_MAX: until a signal.
    int64_t first_us;      ///< Time of the first frame.
    int64_t last_us;
    uint64_t frames;
    uint64_t lost; ///< Frames that are known to be missing.
    int64_t flushed_us;
} recorder_t;

typedef struct {
    const char *path; ///< NULL: a name made of the time.
    const char *bus;  ///< NULL if the option is absent.
    int64_t for_us;   ///< 0: until a signal.
    const char *disk; ///< "on" or "off": the recording on the gateway's disk; NULL if the option is absent.
} words_t;

static int parse(words_t *self, int count, char **words) {
    const option_t options[] = {
        {OPTION("--for", option_time, &self->for_us), .range = {FOR_MIN_US, FOR_MAX_US}},
        {OPTION("--can", option_text, &self->bus), .wants = "a bus: can0, or unix:PATH"},
        {OPTION("--gateway", option_text, &self->disk), .wants = "on or off"},
        {.name = NULL},
    };
    const words_syntax_t syntax = {"record", options, words_is_file, &self->path};
    return words_read(&syntax, count, words);
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
                   ? ctl_fail(CTL_USAGE, "%s exists already; name another file, or remove it", path)
                   : ctl_fail(CTL_UNAVAILABLE, "%s: cannot be created: %s; name another place", path, strerror(errno));
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

/// Writes one frame that arrived at `at_us` (monotonic). Returns false, with errno, if it cannot be written.
static bool put(recorder_t *self, const candump_t *frame, int64_t at_us) {
    char line[CANDUMP_LINE_SIZE];
    candump_t whole = *frame;
    whole.time_us = at_us + self->wall_minus_us;
    (void)snprintf(whole.interface, sizeof whole.interface, "%s", self->interface);
    const size_t length = candump_write(&whole, line);
    if (self->frames == 0U) {
        self->first_us = at_us;
    }
    self->last_us = at_us;
    self->frames++;
    return fwrite(line, 1, length, self->file) == length;
}

/// Flushes the file once a second. Returns false, with errno, if it cannot be written.
static bool poll_recorder(recorder_t *self) {
    const int64_t now_us = client_now_us();
    if (now_us - self->flushed_us < FLUSH_US) {
        return ferror(self->file) == 0;
    }
    self->flushed_us = now_us;
    return fflush(self->file) == 0;
}

/// Records an event of the gateway. Returns false if it cannot be written.
static bool take_event(recorder_t *self, const json_t *line) {
    const char *event = json_string_value(json_object_get(line, "event"));
    int64_t at_us = 0;
    if (event != NULL && strcmp(event, "lost") == 0) {
        const json_int_t count = json_integer_value(json_object_get(line, "count"));
        self->lost += (count > 0) ? (uint64_t)count : 0U;
    }
    if (event == NULL || strcmp(event, "frame") != 0) {
        return true;
    }
    const candump_t frame = frame_from_json(line, &at_us);
    return put(self, &frame, at_us);
}

/// Records the frames that the connected gateway receives and sends, until the end or a signal. Returns an exit code.
static int record_gateway(ctl_t *ctl, recorder_t *self) {
    json_t *reply = NULL;
    int code = ctl_ask(ctl, json_pack("{s:s,s:[s]}", "cmd", "watch", "topics", "frame"), &reply);
    json_decref(reply);
    bool written = true;
    while (code == CTL_OK && written && client_now_us() < self->end_us) {
        json_t *line = NULL;
        const int64_t poll_us = client_now_us() + POLL_US;
        const iwc_result_t result =
            client_receive(&ctl->client, (poll_us < self->end_us) ? poll_us : self->end_us, &line);
        written = result != IWC_OK || take_event(self, line);
        written = poll_recorder(self) && written;
        json_decref(line);
        if (result == IWC_INTERRUPTED) {
            break;
        }
        if (result != IWC_OK && result != IWC_TIMEOUT) {
            code = ctl_lost(result);
        }
    }
    return code;
}

typedef struct {
    iwl_backend_store_t bus;
    unsigned signals;
} source_t;

static int report_unopened(const char *bus, int error) {
    if (error == ENOTSUP) {
        return ctl_fail(CTL_UNAVAILABLE,
                        "%s: libmnl was missing when this was built, so it reads the simulator's bus only (unix:PATH)",
                        bus);
    }
    if (error == EAFNOSUPPORT) {
        return ctl_fail(CTL_UNAVAILABLE, "%s: this kernel has no CAN sockets; modprobe can_raw, or: --can unix:PATH",
                        bus);
    }
    return ctl_fail(CTL_UNAVAILABLE, "%s: cannot be opened: %s", bus, strerror(error));
}

static int report_down(const char *bus) {
    return (strncmp(bus, "unix:", 5) == 0)
               ? ctl_fail(CTL_UNAVAILABLE, "no simulator answers on %s; start it: iwheel-sim --can %s", bus, bus)
               : ctl_fail(CTL_UNAVAILABLE,
                          "%s is absent or not up; sudo ip link set %s up type can bitrate 1000000 sample-point 0.625",
                          bus, bus);
}

/// Waits for a frame, a signal, or WAIT_MS.
static void wait_a_while(source_t *source) {
    const struct timespec while_ = {.tv_sec = 0, .tv_nsec = WAIT_MS * 1000000L};
    struct pollfd entry = {.fd = iwl_bus_fd(&source->bus), .events = POLLIN};
    (void)ppoll(&entry, 1, &while_, signals_let_in());
}

/// Records all received frames. Returns false if they cannot be written.
static bool drain(source_t *source, recorder_t *self) {
    iw_can_frame_t frame;
    const int64_t now_us = client_now_us();
    bool written = true;
    iwl_bus_poll(&source->bus, (iw_time_us_t)now_us);
    while (written && iwl_bus_receive(&source->bus, &frame) > 0) {
        candump_t out = candump_from_core(&frame, 0, "");
        out.mark = CANDUMP_RECEIVED;
        written = put(self, &out, now_us);
    }
    return poll_recorder(self) && written;
}

static bool comes_up(source_t *source) {
    const int64_t until_us = client_now_us() + UP_US;
    for (;;) {
        iwl_bus_poll(&source->bus, (iw_time_us_t)client_now_us());
        if (iwl_bus_state(&source->bus) >= IW_BUS_PASSIVE) {
            return true;
        }
        if (client_now_us() > until_us || signals_count() != source->signals) {
            return false;
        }
        wait_a_while(source);
    }
}

/// Records from the bus itself. The port's backend is opened as the gateway opens it, but only its receiving half is
/// used. Returns an exit code.
static int record_bus(const char *bus, recorder_t *self) {
    static source_t source; // Too large for a stack.
    source.signals = signals_count();
    const int error = iwl_bus_open(&source.bus, bus);
    if (error != 0) {
        return report_unopened(bus, error);
    }
    int code = comes_up(&source) ? CTL_OK : report_down(bus);
    bool up = true;
    while (code == CTL_OK && signals_count() == source.signals && client_now_us() < self->end_us) {
        wait_a_while(&source);
        if (!drain(&source, self)) {
            break;
        }
        const bool now_up = iwl_bus_state(&source.bus) >= IW_BUS_PASSIVE;
        if (now_up != up) {
            (void)ctl_fail(CTL_OK, now_up ? "%s is up again" : "%s went down; waiting for it", bus);
        }
        up = now_up;
    }
    const iwl_bus_link_t *link = iwl_bus_link(&source.bus);
    self->lost += link->lost;
    iwl_bus_close(&source.bus);
    return code;
}

/// Records from the gateway if there is one for this bus: it also distinguishes its own frames from those of others.
static int record(ctl_t *ctl, const words_t *words, recorder_t *self) {
    near_gateway_t gateway = {0};
    near_find(ctl, words->bus, &gateway);
    json_decref(gateway.status);
    if (gateway.result == NEAR_FOUND) {
        name_interface(self, gateway.bus);
        (void)snprintf(self->bus, sizeof self->bus, "%s", gateway.bus);
        self->from_gateway = true;
        (void)ctl_fail(CTL_OK, "recording the frames of the gateway on %s to %s; Ctrl-C ends it", gateway.bus,
                       self->name);
        return record_gateway(ctl, self);
    }
    const char *bus = (words->bus != NULL) ? words->bus : USUAL_BUS;
    name_interface(self, bus);
    (void)snprintf(self->bus, sizeof self->bus, "%s", bus);
    (void)ctl_fail(CTL_OK, "no gateway on this bus: recording from %s itself, sending nothing, to %s; Ctrl-C ends it",
                   bus, self->name);
    return record_bus(bus, self);
}

/// Ends a recording without frames: the file is removed.
static int finish_empty(recorder_t *self, int code) {
    if (self->file != stdout) {
        (void)fclose(self->file);
        (void)unlink(self->name);
    }
    return (code != CTL_OK)
               ? code
               : ctl_fail(CTL_NO, "no frame arrived, nothing is recorded; check the wheels' power and cable: "
                                  "iwheelctl doctor");
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
        (void)ctl_fail(CTL_OK, "%" PRIu64 " frames arrived too fast to be recorded and are missing", self->lost);
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
               : ctl_fail(CTL_UNAVAILABLE, "%s: cannot be written: %s; free some space", self->name, strerror(why));
}

/// Begins or ends the recording on the gateway's disk, and prints its state.
static int ask_gateway(ctl_t *ctl, const words_t *words) {
    json_t *reply = NULL;
    const bool on = strcmp(words->disk, "on") == 0;
    if (!on && strcmp(words->disk, "off") != 0) {
        return ctl_fail(CTL_USAGE, "--gateway \"%s\": write on or off", words->disk);
    }
    if (words->path != NULL || words->bus != NULL || words->for_us != 0) {
        return ctl_fail(CTL_USAGE, "record --gateway writes on the gateway's disk: omit FILE, --for and --can");
    }
    const int code = ctl_ask(ctl, json_pack("{s:s,s:b}", "cmd", "record", "on", on ? 1 : 0), &reply);
    if (code == CTL_OK && !ctl->json) {
        (void)puts(on ? "recording on the gateway's disk, at most 10 min or 16 MiB; to end it: iwheelctl record "
                        "--gateway off"
                      : "the recording on the gateway's disk ends; its files have the cause \"requested\"");
    }
    json_decref(reply);
    return code;
}

int verb_record(ctl_t *self, int count, char **words) {
    words_t parsed = {0};
    recorder_t recorder = {.wall_minus_us = wall_minus_us()};
    const bool json = self->json;
    int code = parse(&parsed, count, words);
    if (code == CTL_OK && parsed.disk != NULL) {
        return ask_gateway(self, &parsed);
    }
    if (code == CTL_OK && json && parsed.path != NULL && strcmp(parsed.path, "-") == 0) {
        return ctl_fail(CTL_USAGE, "record writes the recording or --json to standard output, not both; name a FILE");
    }
    if (code == CTL_OK) {
        code = open_file(&recorder, parsed.path);
    }
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
