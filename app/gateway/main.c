// SPDX-License-Identifier: MIT
#include "answers/service.h"
#include "bus/bus_facts.h"
#include "loop.h"
#include "start/options.h"
#include "start/report.h"

#include "iwheel_linux/clock.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

/// 0, 1 and 2 must be open, or a socket of ours would take the place of one and be written to.
static void secure_standard_streams(void) {
    FILE *const streams[] = {stdin, stdout, stderr};
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++) {
        if (fcntl(fd, F_GETFD) < 0 && freopen("/dev/null", "r+", streams[fd]) == NULL) {
            return; // Without /dev/null there are worse troubles.
        }
    }
}

static int open_hal(gw_daemon_t *daemon) {
    const char *culprit;
    const iw_estop_wish_t estop = {.name = daemon->config.estop.line,
                                   .active_high = daemon->config.estop.active_high,
                                   .debounce_ms = daemon->config.estop.debounce_ms};
    const int error = iw_linux_hal_open(&daemon->hal, daemon->config.bus.interface, &estop, &culprit);
    if (error != 0) {
        gw_report_unopened(&daemon->config, culprit, error, stderr);
        return EX_UNAVAILABLE;
    }
    return 0;
}

static int start_core(gw_daemon_t *daemon) {
    const iw_hal_t hal = gw_tape_hal(&daemon->tape, &daemon->hal);
    const bool restarted = gw_runtime_crashed(&daemon->runtime) && !daemon->config.core.listen_only;
    daemon->now_us = iw_clock_now_us();
    daemon->suspended_us = iw_clock_suspended_us();
    if (iw_gateway_init(&daemon->gateway, &daemon->config.core, &hal, daemon->now_us, restarted) != IW_CONFIG_OK) {
        (void)fputs("iwheel-gateway: the configuration contradicts itself; see iwheel-gateway --check\n", stderr);
        return EX_CONFIG;
    }
    gw_tape_put(&daemon->tape, &(blackbox_entry_t){.at_us = daemon->now_us,
                                                   .kind = BLACKBOX_START,
                                                   .a = restarted,
                                                   .b = daemon->config.core.listen_only});
    iw_motion_evidence_init(&daemon->evidence);
    gw_bus_facts_follow(daemon);
    iwn_why_sentence(&daemon->last_stop.stop, &(iwn_why_context_t){0}, daemon->last_stop.sentence, IWN_SENTENCE_SIZE);
    if (restarted) {
        gw_log(&daemon->log, GW_LOG_WARNING,
               "the gateway before this one died while the wheels were armed: sending zeros for %u ms",
               daemon->config.core.zero_hold_ms);
    }
    return 0;
}

/// Who only watches must not keep anybody from driving: without its socket the gateway serves all the same.
static void listen_to_watchers(gw_daemon_t *daemon) {
    gw_listener_t *watch = &daemon->listener[GW_WATCH];
    *watch = (gw_listener_t){.right = GW_WATCH, .fd = -1, .reserve_fd = -1, .folder = {.fd = -1}};
    if (gw_listener_wanted(&daemon->config, GW_WATCH) &&
        (gw_listener_prepare(watch, &daemon->config, GW_WATCH, stderr) != 0 ||
         gw_listener_open(watch, &daemon->config, &daemon->log, stderr) != 0)) {
        gw_log(&daemon->log, GW_LOG_WARNING, "nobody can watch on %s (see above); who may drive is served all the same",
               daemon->config.northbound.watch_socket);
    }
}

/// Everything between the start of the core and the loop, in the reverse order at the end.
static int serve(gw_daemon_t *daemon) {
    int result = gw_listener_open(&daemon->listener[GW_DRIVE], &daemon->config, &daemon->log, stderr);
    if (result != 0) {
        return result;
    }
    listen_to_watchers(daemon);
    result = start_core(daemon);
    if (result == 0 && gw_loop_open(daemon) != 0) {
        (void)fputs("iwheel-gateway: cannot make the descriptors for the event loop; raise the limit of open files\n",
                    stderr);
        result = EX_UNAVAILABLE;
    }
    if (result == 0) {
        gw_notify_open(&daemon->notify);
        gw_report_start(daemon);
        const int error = gw_loop_run(daemon);
        if (error != 0) {
            gw_log(&daemon->log, GW_LOG_ERROR, "waiting for events failed: %s", strerror(error));
            result = EX_SOFTWARE;
        }
        result = daemon->gave_way ? EX_UNAVAILABLE : result;
        gw_service_close_all(daemon);
        gw_knowledge_close(&daemon->knowledge, daemon->config.bus.interface);
        gw_loop_close(daemon);
        gw_notify_close(&daemon->notify);
    }
    gw_listener_close(&daemon->listener[GW_WATCH]);
    gw_listener_close(&daemon->listener[GW_DRIVE]);
    return result;
}

static int run(gw_daemon_t *daemon) {
    gw_knowledge_open(&daemon->knowledge, &daemon->config);
    int result = gw_listener_prepare(&daemon->listener[GW_DRIVE], &daemon->config, GW_DRIVE, stderr);
    result = (result != 0) ? result : gw_runtime_open(&daemon->runtime, &daemon->config, GW_RUNTIME_DIRECTORY, stderr);
    if (result != 0) {
        return result;
    }
    if (gw_box_open(&daemon->box, &daemon->config) != 0) {
        (void)fputs("iwheel-gateway: not enough memory for the black box; lower [record] blackbox_s\n", stderr);
        result = EX_UNAVAILABLE;
    }
    gw_tape_init(&daemon->tape, daemon->box.ring);
    result = (result == 0) ? open_hal(daemon) : result;
    if (result == 0) {
        result = serve(daemon);
        iw_linux_hal_close(&daemon->hal);
    }
    gw_box_close(&daemon->box);
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
    gw_log_open(&daemon->log, options->log_level);
    const int code = (options->action == GW_CHECK) ? gw_report_check(&daemon->config, stdout) : run(daemon);
    gw_log_close(&daemon->log);
    return code;
}

int main(int argc, char **argv) {
    gw_options_t options;
    secure_standard_streams();
    const int result = gw_options_parse(argc, argv, &options, stderr);
    if (result != 0) {
        return result;
    }
    if (options.action == GW_VERSION) {
        (void)puts("iwheel-gateway " IWHEEL_VERSION);
        return 0;
    }
    if (options.action == GW_HELP) {
        gw_options_help(stdout);
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
