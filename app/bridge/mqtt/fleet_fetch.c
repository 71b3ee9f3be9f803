// SPDX-License-Identifier: MIT
// Verbs for recordings: lists the recordings of a machine, and fetches one of them into files.
#include "fleet_verbs.h"

#include "broker.h"
#include "fetch.h"
#include "mqtt_contents.h"

#include "common/bridge_service.h"
#include "iwheel_northbound/json_out.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sysexits.h>
#include <time.h>
#include <unistd.h>

#define PATH_SIZE 1024U
/// With MQTT 5 the broker drops a command that it did not deliver in this time. The machine would refuse it, too.
#define COMMAND_S 1U

/// A file that is written under a temporary name.
typedef struct {
    char path[PATH_SIZE];
    char part[PATH_SIZE + 16U];
    int fd; ///< Descriptor; -1 if none.
} part_t;

typedef struct {
    fetch_t fetch;
    mqtt_broker_t broker;
    part_t parts[FETCH_FILES];
    const fleet_wanted_t *wanted;
    char from[MQTT_SENDER_SIZE];
    char topics[2][MQTT_TOPIC_SIZE];
    const char *listed[3];
    uint64_t now_us;
    uint64_t bytes;
    int code; ///< Exit code of a local error; 0: none.
    bool was_up;
} asking_t;

static int complain(int code, const char *what, const char *why) {
    (void)fprintf(stderr, "iwheel-fleet: %s: %s\n", what, why);
    return code;
}

/// Sets the names of the files. Existing files are not replaced.
static int name_files(asking_t *self) {
    const char *name = self->fetch.list[self->fetch.chosen].name;
    const char *out = self->wanted->out;
    size_t base = (out != NULL) ? strlen(out) : 0U;
    base -= (base > 4U && strcmp(out + base - 4U, ".log") == 0) ? 4U : 0U;
    for (size_t i = 0; i < FETCH_FILES; i++) {
        part_t *part = &self->parts[i];
        const int length =
            (out != NULL) ? snprintf(part->path, sizeof part->path, "%.*s%s", (int)base, out, fetch_endings[i])
                          : snprintf(part->path, sizeof part->path, "%s-%s%s", self->fetch.id, name, fetch_endings[i]);
        if (length < 0 || (size_t)length >= sizeof part->path) {
            return complain(EX_USAGE, "-o", "the path is too long");
        }
        if (access(part->path, F_OK) == 0) {
            return complain(EX_CANTCREAT, part->path, "exists already and is not changed; name another: -o FILE");
        }
    }
    return 0;
}

static int open_part(part_t *part) {
    static const char unique[] = ".XXXXXX";
    const size_t length = strlen(part->path);
    memcpy(part->part, part->path, length);
    memcpy(part->part + length, unique, sizeof unique);
    part->fd = mkostemp(part->part, O_CLOEXEC);
    return (part->fd >= 0) ? 0 : complain(EX_CANTCREAT, part->path, strerror(errno));
}

static int write_piece(asking_t *self) {
    part_t *part = &self->parts[self->fetch.got_file];
    int code = (part->fd < 0) ? open_part(part) : 0;
    for (size_t done = 0; code == 0 && done < self->fetch.got;) {
        const ssize_t now = write(part->fd, self->fetch.bytes + done, self->fetch.got - done);
        if (now <= 0) {
            code = complain(EX_CANTCREAT, part->path, strerror(errno));
        }
        done += (now > 0) ? (size_t)now : 0U;
    }
    self->bytes += self->fetch.got;
    return code;
}

/// Moves the file to its name without replacing another file. The fallback serves file systems that support only one of
/// both calls.
static bool place(const part_t *part) {
    return fsync(part->fd) == 0 && (link(part->part, part->path) == 0 ||
                                    renameat2(AT_FDCWD, part->part, AT_FDCWD, part->path, RENAME_NOREPLACE) == 0);
}

/// Moves all files to their names, the one with the frames last. If one fails, the others are removed.
static int place_files(const asking_t *self) {
    for (size_t i = 0; i < FETCH_FILES; i++) {
        if (self->parts[i].fd >= 0 && !place(&self->parts[i])) {
            const int error = errno;
            for (size_t k = 0; k < i; k++) {
                (void)unlink(self->parts[k].path);
            }
            return complain(EX_CANTCREAT, self->parts[i].path, strerror(error));
        }
    }
    return 0;
}

static void remove_parts(const asking_t *self) {
    for (size_t i = 0; i < FETCH_FILES; i++) {
        if (self->parts[i].fd >= 0) {
            (void)close(self->parts[i].fd);
            (void)unlink(self->parts[i].part);
        }
    }
}

static void up(void *context) {
    asking_t *self = context;
    self->was_up = true;
}

/// Shows the progress on a terminal.
static void show_progress(const asking_t *self) {
    const fetch_t *fetch = &self->fetch;
    int64_t all = 0;
    for (size_t i = 0; i < FETCH_FILES; i++) {
        all += fetch->list[fetch->chosen].bytes[i].value;
    }
    if (isatty(STDERR_FILENO) == 1 && all > 0) {
        (void)fprintf(stderr, "\r%s: %s %3" PRIu64 " %%%s", fetch->id, fetch->list[fetch->chosen].name,
                      self->bytes * 100U / (uint64_t)all, (fetch->stage == FETCH_DONE) ? "\n" : "");
    }
}

static void came(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels) {
    asking_t *self = context;
    char id[MQTT_ID_SIZE];
    const char *what = "";
    (void)labels; // The answer contains `seq`.
    if (self->code == 0 && fleet_split(message->topic, id, &what) && strcmp(id, self->fetch.id) == 0 &&
        fetch_take(&self->fetch, what, message->payload, (size_t)message->payloadlen, self->now_us) == FETCH_PIECE) {
        self->code = write_piece(self);
        show_progress(self);
    }
}

static void ask(asking_t *self) {
    char payload[512];
    char topic[MQTT_TOPIC_SIZE];
    const char *verb = "";
    if (self->broker.state != MQTT_UP || !fetch_step(&self->fetch, self->now_us, &verb, payload)) {
        return;
    }
    const mqtt_way_t way = {.labels = {.expiry_s = COMMAND_S,
                                       .answer_to = self->topics[1],
                                       .correlation = &self->fetch.seq,
                                       .correlation_length = sizeof self->fetch.seq}};
    mqtt_topic(self->fetch.id, "cmd", verb, topic);
    (void)mqtt_broker_send(&self->broker, topic, payload, strlen(payload), way);
}

/// Runs until the stage is reached, the fetch has failed, or a signal asks for the end. Returns an exit code.
static int run_to(asking_t *self, fetch_stage_t stage) {
    const uint64_t no_broker_us = bridge_now_us() + self->fetch.patience_us;
    while (self->code == 0 && self->fetch.stage != stage && self->fetch.stage != FETCH_FAILED) {
        bool writes = false;
        self->now_us = bridge_now_us();
        mqtt_broker_step(&self->broker, self->now_us);
        ask(self);
        struct pollfd wait = {.fd = mqtt_broker_fd(&self->broker, &writes), .events = POLLIN};
        wait.events = (short)(POLLIN | (writes ? POLLOUT : 0));
        (void)poll(&wait, 1, 50);
        if (*self->wanted->end_asked != 0) {
            return complain(EX_TEMPFAIL, self->fetch.id,
                            "ended before the recording was complete; no file was written");
        }
        if (self->broker.state != MQTT_UP && bridge_now_us() >= no_broker_us) {
            return complain(EX_UNAVAILABLE, self->fetch.id, "no broker; check host and port under [broker]");
        }
    }
    if (self->fetch.stage == FETCH_FAILED) {
        (void)fprintf(stderr, "iwheel-fleet: %s\n", self->fetch.why);
        return self->fetch.code;
    }
    return self->code;
}

static bool make_name(char out[MQTT_SENDER_SIZE]) {
    uint64_t number = 0;
    const bool good = getrandom(&number, sizeof number, 0) == (ssize_t)sizeof number;
    (void)snprintf(out, MQTT_SENDER_SIZE, "fleet-%016" PRIx64, number);
    return good;
}

/// Connects, fetches the list, then runs `rest`.
static int with_list(const mqtt_settings_t *settings, const fleet_wanted_t *wanted, int (*rest)(asking_t *self)) {
    static asking_t self;
    self.wanted = wanted;
    for (size_t i = 0; i < FETCH_FILES; i++) {
        self.parts[i].fd = -1;
    }
    if (!make_name(self.from)) {
        return complain(EX_OSERR, wanted->id, "no random numbers");
    }
    mqtt_topic(wanted->id, "availability", NULL, self.topics[0]);
    mqtt_topic(wanted->id, "reply", self.from, self.topics[1]);
    self.listed[0] = self.topics[0];
    self.listed[1] = self.topics[1];
    const mqtt_broker_listener_t listener = {"iwheel-fleet", self.from,         self.listed,          NULL, &self, up,
                                             fleet_ignore,   fleet_ignore_sent, fleet_ignore_refused, came};
    fetch_begin(&self.fetch, wanted->id, self.from, wanted->wait_s * 1000000U, bridge_now_us());
    int code = mqtt_broker_open(&self.broker, settings, &listener);
    if (code == 0) {
        code = run_to(&self, FETCH_LISTED);
    }
    if (code == 0) {
        code = rest(&self);
    }
    remove_parts(&self);
    if (!mqtt_broker_close(&self.broker)) {
        _exit(code);
    }
    return code;
}

static void show_list(const fetch_t *fetch) {
    char when[32];
    for (size_t i = 0; i < fetch->count; i++) {
        const fetch_recording_t *one = &fetch->list[i];
        const time_t seconds = (time_t)(one->wall_us.value / 1000000);
        struct tm parts;
        (void)snprintf(when, sizeof when, "--");
        if (one->wall_us.known && localtime_r(&seconds, &parts) != NULL) {
            (void)strftime(when, sizeof when, "%Y-%m-%d %H:%M:%S", &parts);
        }
        (void)printf("%-19s %-40s", when, one->name);
        if (one->bytes[FETCH_FILES - 1U].known) {
            (void)printf(" %6" PRId64 " kB\n", (one->bytes[FETCH_FILES - 1U].value + 999) / 1000);
        } else {
            (void)puts("  no frames");
        }
    }
    (void)printf("%zu recordings of %s, its own clock", fetch->count, fetch->id);
    if (fetch->count > 0U) {
        (void)printf("; the newest: iwheel-fleet recording %s", fetch->id);
    }
    (void)puts("");
}

static void print_list(const fetch_t *fetch) {
    for (size_t i = 0; i < fetch->count; i++) {
        const fetch_recording_t *one = &fetch->list[i];
        char line[512];
        iwn_out_t json;
        iwn_out_init(&json, line, sizeof line);
        iwn_out_open(&json, NULL, '{');
        iwn_out_text(&json, "machine", fetch->id);
        iwn_out_text(&json, "name", one->name);
        iwn_out_text(&json, "cause", one->cause);
        iwn_out_known(&json, "wall_us", one->wall_us.known, one->wall_us.value);
        iwn_out_known(&json, "conf_bytes", one->bytes[0].known, one->bytes[0].value);
        iwn_out_known(&json, "jsonl_bytes", one->bytes[1].known, one->bytes[1].value);
        iwn_out_known(&json, "log_bytes", one->bytes[2].known, one->bytes[2].value);
        iwn_out_close(&json, '}');
        (void)fwrite(line, 1, iwn_out_finish(&json), stdout);
    }
}

static int list(asking_t *self) {
    if (self->wanted->json) {
        print_list(&self->fetch);
    } else {
        show_list(&self->fetch);
    }
    return 0;
}

static void show_fetched(const asking_t *self) {
    const fetch_t *fetch = &self->fetch;
    const char *path = self->parts[FETCH_FILES - 1U].path;
    (void)printf("%s: %s, %" PRIu64 " bytes in %" PRIu64 " pieces, %" PRIu64
                 " requested again; the checksums are correct\n",
                 fetch->id, fetch->list[fetch->chosen].name, self->bytes, fetch->pieces, fetch->again);
    (void)printf("why it stopped: iwheelctl why %s\nits frames:     iwheelctl decode %s\n", path, path);
}

static void print_fetched(const asking_t *self) {
    const fetch_t *fetch = &self->fetch;
    char line[2U * PATH_SIZE];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "machine", fetch->id);
    iwn_out_text(&json, "name", fetch->list[fetch->chosen].name);
    iwn_out_text(&json, "file", self->parts[FETCH_FILES - 1U].path);
    iwn_out_int(&json, "bytes", (int64_t)self->bytes);
    iwn_out_int(&json, "pieces", (int64_t)fetch->pieces);
    iwn_out_int(&json, "asked_again", (int64_t)fetch->again);
    iwn_out_close(&json, '}');
    (void)fwrite(line, 1, iwn_out_finish(&json), stdout);
}

static int fetch_one(asking_t *self) {
    fetch_choose(&self->fetch, self->wanted->name, self->now_us);
    int code = (self->fetch.stage == FETCH_FAILED) ? 0 : name_files(self);
    if (code == 0) {
        code = run_to(self, FETCH_DONE);
    }
    if (code == 0) {
        code = place_files(self);
    }
    if (code != 0) {
        return code;
    }
    if (self->wanted->json) {
        print_fetched(self);
    } else {
        show_fetched(self);
    }
    return 0;
}

int fleet_verb_recordings(const mqtt_settings_t *settings, const fleet_wanted_t *wanted) {
    return with_list(settings, wanted, list);
}

int fleet_verb_recording(const mqtt_settings_t *settings, const fleet_wanted_t *wanted) {
    return with_list(settings, wanted, fetch_one);
}
