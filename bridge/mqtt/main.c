// SPDX-License-Identifier: MIT
#include "bridge.h"

#include "common/service.h"

#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

typedef enum { RUN, CHECK, PRINT, VERSION, HELP } action_t;

static volatile sig_atomic_t end_asked;

static void ask_end(int number) {
    (void)number;
    end_asked = 1;
}

static void help(FILE *out) {
    (void)fputs("iwheel-mqtt: tells an MQTT broker what the wheels do, loses no stop or fault, and\n"
                "passes on stop and estop. It drives only if configured to. No safety function.\n"
                "\n"
                "usage: iwheel-mqtt [options]\n"
                "  -c, --config FILE   configuration (" MQTT_SETTINGS_PATH ", if it exists)\n"
                "      --check         check configuration and files; connect to nothing\n"
                "      --print-config  print the configuration in force\n"
                "      --version, --help\n"
                "\n"
                "exit codes: 0 ok, 64 usage, 71 no memory, 73 no directory for events,\n"
                "77 permission, 78 configuration\n",
                out);
}

static int misuse(const char *what) {
    (void)fprintf(stderr, "iwheel-mqtt: %.200s; see iwheel-mqtt --help\n", what);
    return EX_USAGE;
}

static int parse(int count, char **arguments, const char **out_path, action_t *out_action) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},   {"check", no_argument, NULL, CHECK},
        {"print-config", no_argument, NULL, PRINT}, {"version", no_argument, NULL, VERSION},
        {"help", no_argument, NULL, HELP},          {NULL, 0, NULL, 0},
    };
    int option = 0;
    opterr = 0;
    while ((option = getopt_long(count, arguments, ":c:", options, NULL)) != -1) {
        if (option == 'c') {
            *out_path = optarg;
        } else if (option == '?' || option == ':') {
            return misuse((option == ':') ? "an option needs a value" : "there is no such option");
        } else {
            *out_action = (action_t)option;
        }
    }
    return (optind < count) ? misuse("there are options only") : 0;
}

static int configure(const char *path, mqtt_settings_t *out_settings) {
    mqtt_settings_default(out_settings);
    if (path == NULL && access(MQTT_SETTINGS_PATH, F_OK) != 0) {
        return 0;
    }
    return settings_load(&mqtt_settings_form, (path != NULL) ? path : MQTT_SETTINGS_PATH, out_settings, stderr);
}

static int loop(mqtt_bridge_t *bridge) {
    bridge_service_t service;
    sigset_t none;
    (void)sigemptyset(&none);
    bridge_service_open(&service);
    bridge_service_tell(&service, "READY=1");
    while (end_asked == 0) {
        const int code = mqtt_bridge_step(bridge, bridge_now_us());
        if (code != 0) {
            return code;
        }
        bool writes = false;
        struct pollfd waits[] = {{bridge_link_fd(&bridge->link), POLLIN, 0},
                                 {mqtt_broker_fd(&bridge->broker, &writes), POLLIN, 0}};
        waits[1].events = (short)(POLLIN | (writes ? POLLOUT : 0));
        const int wait_ms = mqtt_bridge_wait_ms(bridge);
        const struct timespec wait = {wait_ms / 1000, (long)(wait_ms % 1000) * 1000000L};
        (void)ppoll(waits, 2, &wait, &none);
        bridge_service_round(&service, bridge_now_us());
    }
    bridge_service_tell(&service, "STOPPING=1");
    return 0;
}

/// Both signals come only while the loop waits; the thread that connects inherits that they do not come to it.
static void take_signals(void) {
    struct sigaction action = {.sa_handler = ask_end};
    sigset_t ours;
    (void)sigemptyset(&ours);
    (void)sigaddset(&ours, SIGTERM);
    (void)sigaddset(&ours, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &ours, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
}

static int check(const mqtt_settings_t *settings) {
    const int code = mqtt_bridge_check(settings);
    if (code == 0) {
        (void)printf("iwheel-mqtt: configuration and files are in order\n");
    }
    return code;
}

static int run(const mqtt_settings_t *settings) {
    static mqtt_bridge_t bridge;
    take_signals();
    int code = mqtt_bridge_open(&bridge, settings);
    if (code != 0) {
        return code;
    }
    code = loop(&bridge);
    if (!mqtt_bridge_close(&bridge)) {
        _exit(code); // A thread still waits for the network: nothing of it may be torn down under it.
    }
    return code;
}

int main(int count, char **arguments) {
    static mqtt_settings_t settings;
    const char *path = NULL;
    action_t action = RUN;
    int code = parse(count, arguments, &path, &action);
    if (code != 0) {
        return code;
    }
    if (action == HELP) {
        help(stdout);
        return 0;
    }
    if (action == VERSION) {
        (void)printf("iwheel-mqtt " IWHEEL_VERSION "\n");
        return 0;
    }
    code = configure(path, &settings);
    if (code != 0) {
        return code;
    }
    if (action == PRINT) {
        mqtt_settings_t defaults;
        mqtt_settings_default(&defaults);
        settings_print(&mqtt_settings_form, &settings, &defaults, NULL, stdout);
        return 0;
    }
    return (action == CHECK) ? check(&settings) : run(&settings);
}
