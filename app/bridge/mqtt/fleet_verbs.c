// SPDX-License-Identifier: MIT
// Verbs for the table and the history.
#include "fleet_verbs.h"

#include "broker.h"
#include "stream.h"

#include "common/bridge_service.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#define SHOW_US 1000000U
/// The stream is read from this time before the span on: the clock of a machine may be ahead of the servers, and a gap
/// at the start of the span shows only by the event before it. For a single machine the whole stream is read.
#define AHEAD_US 86400000000LL
/// Time for each host, as long as for the greeting of a broker, so that a host without an answer does not hide the next
/// one.
#define INFO_HOST_US (MQTT_GREETING_US + 1000000U)
/// If every host was tried and none is being tried, the hosts refuse: the wait ends this time after its start.
#define INFO_LEAST_US 5000000U
/// Longest wait for the next retained message, from the accepted connection on.
#define INFO_NEXT_US 1000000U

typedef struct {
    fleet_t fleet;
    mqtt_broker_t broker;
    char host[MQTT_HOST_SIZE]; ///< Host of the stream that provided the last stops.
    uint64_t now_us;
} console_t;

static int complain(int code, const char *why) {
    (void)fprintf(stderr, "iwheel-fleet: %s\n", why);
    return code;
}

void fleet_ignore(void *context) {
    (void)context;
}

void fleet_ignore_sent(void *context, int message) {
    (void)context;
    (void)message;
}

void fleet_ignore_refused(void *context, int message, const char *why) {
    (void)context;
    (void)message;
    (void)why;
}

static void came(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels) {
    console_t *self = context;
    (void)labels;
    fleet_take(&self->fleet, message->topic, message->payload, (size_t)message->payloadlen, self->now_us);
}

static bool take_stored(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us) {
    console_t *self = context;
    (void)stored_us;
    fleet_take_stored(&self->fleet, topic, payload, length);
    return true;
}

/// Reads the stops before the start of this console. Without a stream the `info` of the machines is used.
static void read_last_stops(console_t *self, const mqtt_settings_t *settings) {
    const stream_config_t config = {.event = "stop", .last = true, .visit = take_stored, .context = self};
    char why[STREAM_WHY_SIZE];
    if (settings->broker.stream_port == 0U) {
        return;
    }
    if (stream_read(settings, &config, self->host, why) == 0) {
        self->fleet.stream = self->host;
    } else {
        (void)complain(0, why);
    }
}

/// Replaces the file by rename, so that readers always find a complete file.
static int write_file(const console_t *self, const char *path) {
    char part[1024];
    const int length = snprintf(part, sizeof part, "%s.part", path);
    const int fd = (length > 0 && (size_t)length < sizeof part)
                       ? open(part, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0640)
                       : -1;
    FILE *file = (fd >= 0) ? fdopen(fd, "w") : NULL;
    if (file != NULL) {
        fleet_write(&self->fleet, self->now_us, bridge_wall_us(), file);
    }
    if (file == NULL || fclose(file) != 0 || rename(part, path) != 0) {
        (void)fprintf(stderr, "iwheel-fleet: %s: %s; name a file in a folder that this user may write to\n", path,
                      strerror(errno));
        return EX_CANTCREAT;
    }
    return 0;
}

/// Returns false if the output is closed.
static bool show(const console_t *self, const fleet_wanted_t *wanted) {
    if (wanted->json) {
        fleet_print(&self->fleet, self->now_us, stdout);
        return true;
    }
    if (wanted->seconds == 0U && isatty(STDOUT_FILENO) == 1) {
        (void)fputs("\033[H\033[2J", stdout);
    }
    fleet_show(&self->fleet, self->now_us, stdout);
    return fflush(stdout) == 0;
}

static int listen_to(console_t *self, const fleet_wanted_t *wanted) {
    const uint64_t end_us = (wanted->seconds > 0U) ? bridge_now_us() + wanted->seconds * 1000000U : UINT64_MAX;
    uint64_t show_us = bridge_now_us() + SHOW_US;
    bool was_up = false;
    while (*wanted->end_asked == 0 && self->now_us < end_us) {
        bool writes = false;
        self->now_us = bridge_now_us();
        mqtt_broker_step(&self->broker, self->now_us);
        was_up = was_up || self->broker.state == MQTT_UP;
        if (self->now_us >= show_us) {
            show_us = self->now_us + SHOW_US;
            const int code = (wanted->out != NULL) ? write_file(self, wanted->out) : 0;
            if (code != 0) {
                return code;
            }
            if (wanted->out == NULL && wanted->seconds == 0U && !show(self, wanted)) {
                break;
            }
        }
        struct pollfd wait = {.fd = mqtt_broker_fd(&self->broker, &writes), .events = POLLIN};
        wait.events = (short)(POLLIN | (writes ? POLLOUT : 0));
        (void)poll(&wait, 1, 100);
    }
    if (wanted->seconds > 0U && wanted->out == NULL) {
        (void)show(self, wanted);
    }
    return was_up ? 0 : EX_UNAVAILABLE;
}

int fleet_verb_table(const mqtt_settings_t *settings, const fleet_wanted_t *wanted) {
    static console_t console;
    static const char *const topics[] = {"iwheel/+/availability", "iwheel/+/info", "iwheel/+/state",
                                         "iwheel/+/event/stop", NULL};
    char name[32];
    (void)snprintf(name, sizeof name, "iwheel-fleet-%d", (int)getpid());
    const mqtt_broker_listener_t listener = {
        "iwheel-fleet",       name, topics, NULL, &console, fleet_ignore, fleet_ignore, fleet_ignore_sent,
        fleet_ignore_refused, came};
    if (!fleet_open(&console.fleet)) {
        return complain(EX_OSERR, "no memory");
    }
    int code = mqtt_broker_open(&console.broker, settings, &listener);
    if (code == 0) {
        read_last_stops(&console, settings);
        code = listen_to(&console, wanted);
    }
    if (!mqtt_broker_close(&console.broker)) {
        _exit(code);
    }
    fleet_close(&console.fleet);
    return code;
}

typedef struct {
    history_t *history;
    uint64_t until_us;
} asking_info_t;

static void info_up(void *context) {
    asking_info_t *self = context;
    self->until_us = bridge_now_us() + INFO_NEXT_US;
    self->history->has_info = true;
}

static void info_came(void *context, const struct mosquitto_message *message, const mqtt_labels_t *labels) {
    asking_info_t *self = context;
    (void)labels;
    self->until_us = bridge_now_us() + INFO_NEXT_US;
    history_take_info(self->history, message->topic, message->payload, (size_t)message->payloadlen);
}

/// Reads the retained `info` of the machines at the broker. Without a broker the history reports that its end is not
/// checked. Returns an exit code.
static int read_info(const mqtt_settings_t *settings, const fleet_wanted_t *wanted, history_t *history) {
    static mqtt_broker_t broker; // Its thread may wait for the network longer than this function.
    asking_info_t self = {history, bridge_now_us()};
    char topic[64];
    char name[40];
    char host[MQTT_HOST_SIZE];
    const char *const topics[] = {topic, NULL};
    const mqtt_broker_listener_t listener = {
        "iwheel-fleet",       name,     topics, NULL, &self, info_up, fleet_ignore, fleet_ignore_sent,
        fleet_ignore_refused, info_came};
    (void)snprintf(topic, sizeof topic, "iwheel/%s/info", (wanted->span.machine != NULL) ? wanted->span.machine : "+");
    (void)snprintf(name, sizeof name, "iwheel-fleet-history-%d", (int)getpid());
    const uint64_t least_us = self.until_us + INFO_LEAST_US;
    size_t hosts = 0;
    for (; mqtt_settings_host(settings, hosts, host); hosts++) {
        self.until_us += INFO_HOST_US;
    }
    const int code = mqtt_broker_open(&broker, settings, &listener);
    bool all_tried = false;
    while (code == 0 && bridge_now_us() < self.until_us &&
           !(all_tried && broker.state == MQTT_AWAY && bridge_now_us() >= least_us)) {
        bool writes = false;
        mqtt_broker_step(&broker, bridge_now_us());
        all_tried = all_tried || broker.next >= hosts;
        struct pollfd wait = {.fd = mqtt_broker_fd(&broker, &writes), .events = POLLIN};
        wait.events = (short)(POLLIN | (writes ? POLLOUT : 0));
        (void)poll(&wait, 1, 50);
    }
    (void)mqtt_broker_close(&broker);
    return code;
}

int fleet_verb_history(const mqtt_settings_t *settings, const fleet_wanted_t *wanted) {
    static history_t history;
    char host[MQTT_HOST_SIZE];
    char why[STREAM_WHY_SIZE];
    const int64_t since_us = (wanted->span.machine != NULL) ? 1 : wanted->span.since_us - AHEAD_US;
    const stream_config_t config = {.machine = wanted->span.machine,
                                    .since_us = (since_us > 0) ? since_us : 1,
                                    .visit = history_take,
                                    .context = &history};
    if (!history_open(&history, &wanted->span, stdout)) {
        return complain(EX_OSERR, "no memory");
    }
    int code = (settings->broker.stream_port != 0U) ? read_info(settings, wanted, &history) : 0;
    if (code != 0) {
        history_close(&history);
        return code;
    }
    code = stream_read(settings, &config, host, why);
    if (code == 0) {
        history_end(&history);
        history_sum(&history, host);
    } else {
        (void)complain(code, why);
    }
    history_close(&history);
    return code;
}
