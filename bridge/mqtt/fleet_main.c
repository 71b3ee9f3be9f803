// SPDX-License-Identifier: MIT
// The console of a fleet: reads the broker, shows a row per machine, sends nothing.
#include "broker.h"
#include "fleet.h"

#include "common/service.h"

#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#define SETTINGS_PATH "/etc/iwheel/fleet.conf"
#define SHOW_US       1000000U

typedef struct {
    const char *path; ///< NULL: none is named.
    uint64_t seconds; ///< 0: until Ctrl-C.
    bool json;
} wanted_t;

typedef struct {
    fleet_t fleet;
    mqtt_broker_t broker;
    uint64_t now_us;
} console_t;

static volatile sig_atomic_t end_asked;

static void ask_end(int number) {
    (void)number;
    end_asked = 1;
}

static void help(void) {
    (void)fputs("iwheel-fleet: who of a fleet is there, who stopped last and why, batteries, zeros,\n"
                "versions, and what several machines contradict. Reads an MQTT broker, sends nothing.\n"
                "\n"
                "usage: iwheel-fleet [options]\n"
                "  -c, --config FILE   whose [broker] to use (" SETTINGS_PATH ", if it exists)\n"
                "      --for SECONDS   listen so long, then show it once\n"
                "      --json          one JSON object per machine; with --for\n"
                "      --version, --help\n"
                "\n"
                "exit codes: 0 ok, 64 usage, 69 no broker, 71 no memory, 77 permission,\n"
                "78 configuration\n",
                stdout);
}

static int misuse(const char *what) {
    (void)fprintf(stderr, "iwheel-fleet: %s; see iwheel-fleet --help\n", what);
    return EX_USAGE;
}

/// -1: go on; else the exit code.
static int parse(int count, char **arguments, wanted_t *out_wanted) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'}, {"for", required_argument, NULL, 'f'},
        {"json", no_argument, NULL, 'j'},         {"version", no_argument, NULL, 'V'},
        {"help", no_argument, NULL, 'h'},         {NULL, 0, NULL, 0},
    };
    int option = 0;
    uint32_t seconds = 0;
    opterr = 0;
    while ((option = getopt_long(count, arguments, ":c:", options, NULL)) != -1) {
        if (option == 'c') {
            out_wanted->path = optarg;
        } else if (option == 'f' && settings_digits(optarg, strlen(optarg), &seconds) && seconds > 0U) {
            out_wanted->seconds = seconds;
        } else if (option == 'j') {
            out_wanted->json = true;
        } else if (option == 'h') {
            help();
            return 0;
        } else if (option == 'V') {
            (void)printf("iwheel-fleet " IWHEEL_VERSION "\n");
            return 0;
        } else {
            return misuse("there is no such option, or its value is none");
        }
    }
    if (out_wanted->json && out_wanted->seconds == 0U) {
        return misuse("--json needs --for SECONDS");
    }
    return (optind < count) ? misuse("there are options only") : -1;
}

static void up(void *context) {
    (void)context;
}

static void sent(void *context, int message) {
    (void)context;
    (void)message;
}

static void came(void *context, const struct mosquitto_message *message) {
    console_t *self = context;
    fleet_take(&self->fleet, message->topic, message->payload, (size_t)message->payloadlen, self->now_us);
}

static void show(const console_t *self, const wanted_t *wanted) {
    if (wanted->json) {
        fleet_tell(&self->fleet, self->now_us, stdout);
        return;
    }
    if (wanted->seconds == 0U && isatty(STDOUT_FILENO) == 1) {
        (void)fputs("\033[H\033[2J", stdout);
    }
    fleet_show(&self->fleet, self->now_us, stdout);
    (void)fflush(stdout);
}

static int listen_to(console_t *self, const wanted_t *wanted) {
    const uint64_t end_us = (wanted->seconds > 0U) ? bridge_now_us() + wanted->seconds * 1000000U : UINT64_MAX;
    uint64_t show_us = bridge_now_us() + SHOW_US;
    bool was_up = false;
    while (end_asked == 0 && self->now_us < end_us) {
        bool writes = false;
        self->now_us = bridge_now_us();
        mqtt_broker_step(&self->broker, self->now_us);
        was_up = was_up || self->broker.state == MQTT_UP;
        if (wanted->seconds == 0U && self->now_us >= show_us) {
            show_us = self->now_us + SHOW_US;
            show(self, wanted);
        }
        struct pollfd wait = {.fd = mqtt_broker_fd(&self->broker, &writes), .events = POLLIN};
        wait.events = (short)(POLLIN | (writes ? POLLOUT : 0));
        (void)poll(&wait, 1, 100);
    }
    if (wanted->seconds > 0U) {
        show(self, wanted);
    }
    return was_up ? 0 : EX_UNAVAILABLE;
}

int main(int count, char **arguments) {
    static console_t console;
    static mqtt_settings_t settings;
    static const char *const topics[] = {"iwheel/+/availability", "iwheel/+/state", "iwheel/+/event/stop", NULL};
    char name[32];
    wanted_t wanted = {NULL, 0, false};
    const struct sigaction action = {.sa_handler = ask_end};
    int code = parse(count, arguments, &wanted);
    if (code >= 0) {
        return code;
    }
    mqtt_settings_default(&settings);
    if (wanted.path != NULL || access(SETTINGS_PATH, F_OK) == 0) {
        code =
            settings_load(&mqtt_settings_form, (wanted.path != NULL) ? wanted.path : SETTINGS_PATH, &settings, stderr);
    }
    if (code > 0) {
        return code;
    }
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    (void)snprintf(name, sizeof name, "iwheel-fleet-%d", (int)getpid());
    const mqtt_broker_listener_t listener = {"iwheel-fleet", name, topics, NULL, &console, up, up, sent, came};
    if (!fleet_open(&console.fleet)) {
        (void)fputs("iwheel-fleet: no memory\n", stderr);
        return EX_OSERR;
    }
    code = mqtt_broker_open(&console.broker, &settings, &listener);
    code = (code == 0) ? listen_to(&console, &wanted) : code;
    if (!mqtt_broker_close(&console.broker)) {
        _exit(code);
    }
    fleet_close(&console.fleet);
    return code;
}
