// SPDX-License-Identifier: MIT
#include "mqtt_bridge.h"

#include "common/bridge_service.h"
#include "common/program.h"
#include "common/reach.h"

#include "mqtt_texts.h"

#include <sysexits.h>
#include <unistd.h>

static int loop(mqtt_bridge_t *bridge) {
    bridge_service_t service;
    if (!bridge_reach_is_local("iwheel-mqtt", NULL, 0)) { // It connects to others and accepts no connection.
        return EX_UNAVAILABLE;
    }
    bridge_service_open(&service);
    bridge_service_notify(&service, "READY=1");
    bool goes_on = true;
    while (goes_on) {
        const int code = mqtt_bridge_step(bridge, bridge_now_us());
        if (code != 0) {
            return code;
        }
        bool writes = false;
        struct pollfd waits[] = {{bridge_link_fd(&bridge->link), POLLIN, 0},
                                 {mqtt_broker_fd(&bridge->broker, &writes), POLLIN, 0},
                                 {mqtt_spool_fd(&bridge->spool), POLLIN, 0}};
        waits[1].events = (short)(POLLIN | (writes ? POLLOUT : 0));
        goes_on = bridge_service_wait(waits, 3, mqtt_bridge_wait_ms(bridge));
        bridge_service_round(&service, bridge_now_us());
    }
    bridge_service_notify(&service, "STOPPING=1");
    return 0;
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
    bridge_service_take_signals();
    int code = mqtt_bridge_open(&bridge, settings);
    if (code != 0) {
        return code;
    }
    code = loop(&bridge);
    if (!mqtt_bridge_close(&bridge)) {
        _exit(code); // A thread still waits for the network or the disk, and uses the memory.
    }
    return code;
}

int main(int count, char **arguments) {
    static mqtt_settings_t settings;
    const bridge_program_t program = {
        .form = &mqtt_settings_form,
        .path = MQTT_SETTINGS_PATH,
        .help = mqtt_help,
        .settings = &settings,
        .standard = &mqtt_settings_standard,
    };
    int action = BRIDGE_RUN;
    settings = mqtt_settings_standard;
    const int code = bridge_program_begin(&program, count, arguments, &action);
    if (code != BRIDGE_GO) {
        return code;
    }
    return (action == BRIDGE_CHECK) ? check(&settings) : run(&settings);
}
