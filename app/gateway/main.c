// SPDX-License-Identifier: MIT
#include "daemon.h"
#include "sockets/sock_clients.h"
#include "start/options.h"
#include "start/start_report.h"

#include "begin/begin.h"

#include "iwheel_linux/clock.h"

#include "gateway_texts.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

static int open_hal(gw_daemon_t *daemon) {
    const char *cause;
    const iwl_estop_config_t estop = gw_report_estop(&daemon->config);
    const int error = iwl_hal_open(&daemon->wheels.hal, daemon->config.bus.interface, &estop, &cause);
    if (error != 0) {
        gw_report_unopened(&daemon->config, cause, error, stderr);
        return (error == ENOTUNIQ) ? EX_CONFIG : EX_UNAVAILABLE;
    }
    return 0;
}

static int start_core(gw_daemon_t *daemon) {
    const iw_config_t *config = &daemon->config.core;
    const bool restarted = gw_runtime_crashed(&daemon->runtime) && !config->listen_only;
    daemon->wheels.now_us = iwl_clock_now_us();
    daemon->loop.suspended_us = iwl_clock_suspended_us();
    if (gw_wheels_begin(&daemon->wheels, config, daemon->box.ring, restarted) != IW_CONFIG_OK) {
        (void)fputs("iwheel-gateway: the configuration contradicts itself; see iwheel-gateway --check\n", stderr);
        return EX_CONFIG;
    }
    gw_bus_facts_follow(&daemon->facts, &daemon->wheels, false);
    if (restarted && config->hold) {
        sock_log(
            &daemon->log, SOCK_LOG_WARNING,
            "the gateway before this one died while the wheels were armed: sending zeros until: iwheelctl release");
    } else if (restarted) {
        sock_log(&daemon->log, SOCK_LOG_WARNING,
                 "the gateway before this one died while the wheels were armed: sending zeros for %u ms",
                 config->zero_hold_ms);
    }
    return 0;
}

/// Watchers must not prevent driving: without their socket the gateway serves anyway.
static void listen_to_watchers(gw_daemon_t *daemon) {
    const sock_listener_config_t wanted = gw_report_socket(&daemon->config, SOCK_WATCH);
    sock_listener_t *watch = &daemon->clients.listener[SOCK_WATCH];
    *watch = (sock_listener_t){.fd = -1, .reserve_fd = -1, .folder = {.fd = -1}};
    if (strcmp(wanted.path, "none") != 0 &&
        (sock_listener_prepare(watch, &wanted, stderr) != 0 || sock_listener_open(watch, &daemon->log, stderr) != 0)) {
        sock_log(&daemon->log, SOCK_LOG_WARNING, "no client can watch on %s (see above); clients that drive are served",
                 wanted.path);
    }
}

static void report_start(gw_daemon_t *daemon) {
    const gw_wheels_t *wheels = &daemon->wheels;
    gw_report_start(&daemon->config, wheels->hal.estop_ops->simulated, daemon->clients.listener[SOCK_WATCH].fd >= 0,
                    &daemon->log);
    gw_report_room(iwl_hal_link(&wheels->hal), &daemon->log);
    for (uint32_t i = 0; i < wheels->warnings; i++) {
        sock_log(&daemon->log, SOCK_LOG_WARNING, "%s", wheels->warning[i]);
    }
}

/// Starts everything between the core and the loop, and ends it in reverse order.
static int serve(gw_daemon_t *daemon) {
    int result = sock_listener_open(&daemon->clients.listener[SOCK_DRIVE], &daemon->log, stderr);
    if (result != 0) {
        return result;
    }
    listen_to_watchers(daemon);
    result = start_core(daemon);
    if (result == 0 && gw_loop_open(daemon) != 0) {
        (void)fputs("iwheel-gateway: cannot create the descriptors for the event loop; raise the limit of open files\n",
                    stderr);
        result = EX_UNAVAILABLE;
    }
    if (result == 0) {
        gw_notify_open(&daemon->notify);
        report_start(daemon);
        const int error = gw_loop_run(daemon);
        if (error != 0) {
            sock_log(&daemon->log, SOCK_LOG_ERROR, "waiting for events failed: %s", strerror(error));
            result = EX_SOFTWARE;
        }
        if (daemon->loop.phase == GW_LOOP_GIVES_WAY) {
            result = EX_UNAVAILABLE;
        }
        sock_service_close_all(&daemon->clients);
        gw_assumptions_close(&daemon->assumptions);
        gw_loop_close(daemon);
        gw_notify_close(&daemon->notify);
    }
    sock_listener_close(&daemon->clients.listener[SOCK_WATCH]);
    sock_listener_close(&daemon->clients.listener[SOCK_DRIVE]);
    return result;
}

/// Returns the configuration as a file; NULL if there is no memory. The caller frees it.
static char *print_config(const gateway_config_t *config) {
    char *text = NULL;
    size_t size;
    FILE *stream = open_memstream(&text, &size);
    if (stream != NULL) {
        gateway_config_print(config, stream);
        (void)fclose(stream);
    }
    return text;
}

static int open_box(gw_daemon_t *daemon, const char *config_text) {
    const gateway_config_t *config = &daemon->config;
    const gw_box_config_t wanted = {.blackbox_s = config->record.blackbox_s,
                                    .keep_stops = config->record.keep_stops,
                                    .directory = config->record.directory,
                                    .bus = config->bus.interface,
                                    .estop = config->estop.line,
                                    .config = config_text};
    if (config_text == NULL || gw_box_open(&daemon->box, &wanted) != 0) {
        (void)fputs("iwheel-gateway: not enough memory for the black box; lower [record] blackbox_s\n", stderr);
        return EX_UNAVAILABLE;
    }
    return 0;
}

static int run(gw_daemon_t *daemon) {
    const gateway_config_t *config = &daemon->config;
    const sock_listener_config_t drive = gw_report_socket(config, SOCK_DRIVE);
    gw_daemon_compose(daemon);
    gw_assumptions_open(&daemon->assumptions, config->record.directory);
    int result = sock_listener_prepare(&daemon->clients.listener[SOCK_DRIVE], &drive, stderr);
    if (result == 0) {
        result = gw_runtime_open(&daemon->runtime, config->bus.interface, config->northbound.socket,
                                 SOCK_RUNTIME_DIRECTORY, stderr);
    }
    if (result != 0) {
        return result;
    }
    char *text = print_config(config);
    result = open_box(daemon, text);
    if (result == 0) {
        result = open_hal(daemon);
    }
    if (result == 0) {
        result = serve(daemon);
        iwl_hal_close(&daemon->wheels.hal);
    }
    gw_box_close(&daemon->box);
    free(text);
    gw_runtime_close(&daemon->runtime);
    return result;
}

static int act(const gw_options_t *options, gw_daemon_t *daemon) {
    const int result = gw_options_configure(options, &daemon->config, stderr);
    if (result != 0) {
        return result;
    }
    if (options->action == GW_PRINT_CONFIG) {
        gateway_config_print(&daemon->config, stdout);
        return 0;
    }
    sock_log_open(&daemon->log, options->log_level);
    const int code = (options->action == GW_CHECK) ? gw_report_check(&daemon->config, stdout) : run(daemon);
    sock_log_close(&daemon->log);
    return code;
}

int main(int argc, char **argv) {
    gw_options_t options;
    int result = begin_program("iwheel-gateway", argc, argv);
    if (result == 0) {
        result = gw_options_parse(argc, argv, &options, stderr);
    }
    if (result != 0) {
        return result;
    }
    if (options.action == GW_VERSION) {
        (void)puts("iwheel-gateway " IWHEEL_VERSION);
        return 0;
    }
    if (options.action == GW_HELP) {
        (void)fputs(gateway_help, stdout);
        return 0;
    }
    gw_daemon_t *daemon = (gw_daemon_t *)calloc(1, sizeof *daemon);
    if (daemon == NULL) {
        (void)fputs("iwheel-gateway: not enough memory to start\n", stderr);
        return EX_UNAVAILABLE;
    }
    const int code = act(&options, daemon);
    free(daemon);
    return code;
}
