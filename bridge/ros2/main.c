// SPDX-License-Identifier: MIT
#include "bridge.h"

#include "common/service.h"

#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/signalfd.h>
#include <sysexits.h>
#include <unistd.h>

typedef enum { RUN = 0, CHECK, PRINT_CONFIG, VERSION, HELP } action_t;

enum { OPTION_CHECK = 256, OPTION_PRINT };

static const struct option long_options[] = {
    {"config", required_argument, NULL, 'c'},
    {"check", no_argument, NULL, OPTION_CHECK},
    {"print-config", no_argument, NULL, OPTION_PRINT},
    {"version", no_argument, NULL, 'V'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static void help(void) {
    (void)fputs("iwheel-ros2: the iWheel gateway as a node of ROS 2. It moves nothing until\n"
                "somebody calls its service iwheel/arm and sends cmd_vel.\n"
                "\n"
                "usage: iwheel-ros2 [options]\n"
                "  -c, --config FILE   configuration (" ROS_SETTINGS_PATH ", if it exists)\n"
                "      --check         check configuration, gateway and DDS; move nothing\n"
                "      --print-config  print the configuration in force\n"
                "      --version, --help\n"
                "\n"
                "exit codes: 0 ok, 1 a check failed, 64 usage, 69 DDS unavailable,\n"
                "77 the gateway's socket may not be used, 78 configuration\n",
                stdout);
}

static int misuse(const char *what, const char *word) {
    (void)fprintf(stderr, "iwheel-ros2: %s%s; see iwheel-ros2 --help\n", word, what);
    return EX_USAGE;
}

// ---- running ------------------------------------------------------------------------------------------------------

/// Blocked before DDS makes its threads, which inherit that. Both ends are the same: by a descriptor.
static int open_signals(void) {
    sigset_t set;
    (void)sigemptyset(&set);
    (void)sigaddset(&set, SIGTERM);
    (void)sigaddset(&set, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &set, NULL);
    return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

static void loop(bridge_t *bridge, int signals) {
    struct pollfd entries[3] = {{.fd = signals, .events = POLLIN}, {.fd = ros_fd(bridge->ros), .events = POLLIN}};
    bridge_service_t service;
    bridge_service_open(&service);
    bridge_service_tell(&service, "READY=1");
    while (entries[0].revents == 0) {
        bridge_step(bridge);
        bridge_service_round(&service, bridge_now_us());
        entries[2] = (struct pollfd){.events = POLLIN};
        const int wait_ms = bridge_wait_ms(bridge, &entries[2].fd);
        (void)poll(entries, 3, wait_ms);
    }
    bridge_service_tell(&service, "STOPPING=1");
}

static int run(const ros_settings_t *settings) {
    const int signals = open_signals();
    bridge_t *bridge = calloc(1, sizeof *bridge);
    if (signals < 0 || bridge == NULL) {
        (void)fputs("iwheel-ros2: not enough memory or descriptors to start\n", stderr);
        free(bridge);
        return EX_UNAVAILABLE;
    }
    const int result = bridge_open(bridge, settings);
    if (result == 0) {
        loop(bridge, signals);
        bridge_close(bridge);
    }
    free(bridge);
    return result;
}

// ---- checking -----------------------------------------------------------------------------------------------------

static int check_gateway(const ros_settings_t *settings) {
    iwc_t *gateway = iwc_new();
    iwc_message_t status;
    ros_machine_t machine = {.radius_mm = 0};
    int failures = 0;
    const iwc_result_t result = (gateway != NULL) ? iwc_connect(gateway, settings->gateway.socket, 1000) : IWC_CLOSED;
    if (result != IWC_OK) {
        (void)printf("fail  gateway %s: %s\n", settings->gateway.socket, iwc_words(result));
        iwc_free(gateway);
        return 1;
    }
    (void)printf("ok    gateway %s\n", settings->gateway.socket);
    if (iwc_ask(gateway, "{\"cmd\":\"status\"}", 1000, &status) == IWC_OK) {
        ros_facts_read_ledger(&status, &machine);
        if (settings->drive.enabled && machine.setpoint_current) {
            (void)puts("fail  current_role = setpoint: a twist carries no current, so driving is refused; set [drive] "
                       "enabled = no to watch");
            failures++;
        }
        (void)printf("%s\n", (machine.contradicted[0] != '\0')
                                 ? "warn  the gateway's assumptions are contradicted; see iwheelctl status"
                                 : "ok    nothing contradicts the gateway's assumptions");
    }
    iwc_free(gateway);
    return failures;
}

static int check(const ros_settings_t *settings) {
    (void)puts("ok    configuration");
    int failures = check_gateway(settings);
    ros_t *ros = ros_open(settings, NULL, NULL, stdout);
    if (ros != NULL) {
        (void)printf("ok    DDS domain %u, node %s in namespace %s\n", settings->ros.domain, settings->ros.node,
                     settings->ros.ns);
        ros_close(ros);
    } else {
        (void)puts("fail  DDS: see above");
        failures++;
    }
    if (settings->drive.enabled) {
        (void)puts("warn  whoever reaches this DDS domain may arm and drive; see SECURITY.md");
    }
    return (failures > 0) ? 1 : 0;
}

/// What the command line says. `*out_action`, `*out_path`; 0, or an exit code after a complaint.
static int parse(int argc, char **argv, action_t *out_action, const char **out_path) {
    opterr = 0;
    for (int option = 0; option != -1;) {
        option = getopt_long(argc, argv, ":c:hV", long_options, NULL);
        switch (option) {
        case -1:
            break;
        case 'c':
            *out_path = optarg;
            break;
        case OPTION_CHECK:
            *out_action = CHECK;
            break;
        case OPTION_PRINT:
            *out_action = PRINT_CONFIG;
            break;
        case 'V':
            *out_action = VERSION;
            return 0;
        case 'h':
            *out_action = HELP;
            return 0;
        default:
            return misuse((option == ':') ? " needs a value" : " is no option of this program", argv[optind - 1]);
        }
    }
    return (optind < argc) ? misuse(" means nothing: there are options only", argv[optind]) : 0;
}

static int act(action_t action, const char *path) {
    ros_settings_t settings;
    ros_settings_default(&settings);
    if (path != NULL || access(ROS_SETTINGS_PATH, F_OK) == 0) {
        const int result = ros_settings_load((path != NULL) ? path : ROS_SETTINGS_PATH, &settings, stderr);
        if (result != 0) {
            return result;
        }
    }
    if (action == PRINT_CONFIG) {
        ros_settings_print(&settings, stdout);
        return 0;
    }
    return (action == CHECK) ? check(&settings) : run(&settings);
}

int main(int argc, char **argv) {
    const char *path = NULL;
    action_t action = RUN;
    const int result = parse(argc, argv, &action, &path);
    if (result != 0) {
        return result;
    }
    if (action == VERSION) {
        (void)puts("iwheel-ros2 " IWHEEL_VERSION);
        return 0;
    }
    if (action == HELP) {
        help();
        return 0;
    }
    return act(action, path);
}
