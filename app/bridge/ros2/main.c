// SPDX-License-Identifier: MIT
#include "ros2_bridge.h"

#include "common/bridge_service.h"
#include "common/program.h"
#include "common/reach.h"

#include "ros_texts.h"

#include <stdlib.h>
#include <sysexits.h>

static void loop(bridge_t *bridge) {
    struct pollfd entries[2] = {{.fd = ros_fd(bridge->ros), .events = POLLIN}};
    bridge_service_t service;
    int wait_ms = 0;
    bridge_service_open(&service);
    bridge_service_notify(&service, "READY=1");
    do {
        bridge_step(bridge);
        bridge_service_round(&service, bridge_now_us());
        entries[1] = (struct pollfd){.events = POLLIN};
        wait_ms = bridge_wait_ms(bridge, &entries[1].fd);
    } while (bridge_service_wait(entries, 2, wait_ms));
    bridge_service_notify(&service, "STOPPING=1");
}

/// Reports that the bridge listens to a network. If the unit does not permit that, other machines receive nothing,
/// without an error.
static void report_reach(const ros_settings_t *settings) {
    char text[BRIDGE_REACH_TEXT];
    if (!settings->ros.loopback) {
        (void)fprintf(
            stderr,
            "iwheel-ros2: info: %u sockets receive from every address (%s); the unit lets other machines through only "
            "if it was edited as docs/user/ros2.md shows\n",
            bridge_reach_count(NULL, 0, text), text);
    }
}

/// Blocks the signals before DDS creates its threads, because the threads inherit the signal mask.
static int run(const ros_settings_t *settings) {
    bridge_service_take_signals();
    bridge_t *bridge = calloc(1, sizeof *bridge);
    if (bridge == NULL) {
        (void)fputs("iwheel-ros2: not enough memory to start\n", stderr);
        return EX_UNAVAILABLE;
    }
    const int result = bridge_open(bridge, settings);
    if (result == 0) {
        report_reach(settings);
        loop(bridge);
        bridge_close(bridge);
    }
    free(bridge);
    return result;
}

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
    if (iwc_ask(gateway, "{\"cmd\":\"config\"}", 1000, &status) == IWC_OK) { // Only a board accepts it.
        ros_facts_read_config(&status, &machine);
    }
    if (iwc_ask(gateway, "{\"cmd\":\"status\"}", 1000, &status) == IWC_OK) {
        ros_facts_read_assumptions(&status, &machine);
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

static void check_reach(const ros_settings_t *settings) {
    char text[BRIDGE_REACH_TEXT];
    const unsigned count = bridge_reach_count(NULL, 0, text);
    if (count == 0U) {
        (void)puts("ok    other machines cannot reach it");
    } else {
        (void)printf("warn  other machines can reach %u of its sockets: %s\n", count, text);
    }
    if (settings->drive.enabled) {
        (void)printf("warn  %s may arm and drive; see SECURITY.md\n",
                     (count == 0U) ? "every program on this machine" : "every program that reaches this DDS domain");
    }
}

static int check(const ros_settings_t *settings) {
    (void)puts("ok    configuration");
    int failures = check_gateway(settings);
    ros_t *ros = ros_open(settings, NULL, NULL, stdout);
    if (ros != NULL) {
        (void)printf("ok    DDS domain %u, node %s in namespace %s\n", settings->ros.domain, settings->ros.node,
                     settings->ros.ns);
        check_reach(settings);
        ros_close(ros);
    } else {
        (void)puts("fail  DDS: see above");
        failures++;
    }
    return (failures > 0) ? 1 : 0;
}

int main(int count, char **arguments) {
    static ros_settings_t settings;
    const bridge_program_t program = {
        .form = &ros_settings_form,
        .path = ROS_SETTINGS_PATH,
        .help = ros_help,
        .settings = &settings,
        .standard = &ros_settings_standard,
    };
    int action = BRIDGE_RUN;
    settings = ros_settings_standard;
    const int code = bridge_program_begin(&program, count, arguments, &action);
    if (code != BRIDGE_GO) {
        return code;
    }
    return (action == BRIDGE_CHECK) ? check(&settings) : run(&settings);
}
