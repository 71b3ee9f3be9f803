// SPDX-License-Identifier: MIT
#include "bus_facts.h"

#include <fcntl.h>
#include <stdarg.h>
#include <unistd.h>

#define PATH_SIZE 256

static iw_timing_t judge(const gw_daemon_t *daemon) {
    return iw_timing_judge(iw_linux_hal_link(&daemon->hal), daemon->config.bus.bitrate,
                           daemon->config.bus.sample_point_permille);
}

static bool refuses(const gw_daemon_t *daemon) {
    return judge(daemon) == IW_TIMING_WRONG && daemon->config.bus.on_mismatch == GATEWAY_MISMATCH_REFUSE;
}

const char *gw_bus_facts_timing(const gw_daemon_t *daemon) {
    switch (judge(daemon)) {
    case IW_TIMING_RIGHT:
        return "confirmed";
    case IW_TIMING_NEAR:
        return "near";
    case IW_TIMING_WRONG:
        return "contradicted";
    default:
        return "unproven";
    }
}

static void log_purge(gw_daemon_t *daemon, iw_link_purge_t purge) {
    const char *bus = daemon->config.bus.interface;
    if (purge == daemon->purge_told) {
        return;
    }
    daemon->purge_told = purge;
    if (purge == IW_LINK_PURGE_DONE) {
        gw_log(&daemon->log, GW_LOG_WARNING, "bus %s: taken down and up again, so that no old setpoint waits in it",
               bus);
    } else if (purge == IW_LINK_PURGE_NOT_ALLOWED) {
        gw_log(&daemon->log, GW_LOG_WARNING,
               "bus %s: an old setpoint may still wait in its queue, and this process may not empty it; do: ip link "
               "set %s down; ip link set %s up (or, once and for all: systemctl enable --now "
               "iwheel-can-restart@%s.path)",
               bus, bus, bus, bus);
    } else if (purge == IW_LINK_PURGE_FAILED) {
        gw_log(&daemon->log, GW_LOG_ERROR,
               "bus %s: its queue could not be emptied; look with: ip -details link show %s", bus, bus);
    }
}

__attribute__((format(printf, 2, 3))) static void warn(gw_daemon_t *daemon, const char *format, ...) {
    if (daemon->warnings < GW_WARNINGS) {
        va_list arguments;
        va_start(arguments, format);
        (void)vsnprintf(daemon->warning[daemon->warnings], GW_WARNING_SIZE, format, arguments);
        va_end(arguments);
        daemon->warnings++;
    }
}

static void note_left_behind(gw_daemon_t *daemon) {
    if (gw_daemon_look(daemon).left_behind) {
        char sentence[GW_WARNING_SIZE];
        gw_bus_left_sentence(iw_linux_hal_link(&daemon->hal), daemon->config.bus.interface, sentence, sizeof sentence);
        warn(daemon, "%s", sentence);
    }
}

/// What is wrong enough to be said at start, in `status` and with every arm.
static void note_warnings(gw_daemon_t *daemon) {
    const iw_linux_hal_t *hal = &daemon->hal;
    daemon->warnings = 0;
    if (!hal->estop_ops->present) {
        warn(daemon, "there is no e-stop line: only software and the wheels' own 1 s watchdog can stop the wheels; "
                     "configure [estop] line");
    } else if (hal->estop_ops->simulated) {
        warn(daemon, "the e-stop %s is SIMULATED: no button of this machine stops the wheels",
             daemon->config.estop.line);
    }
    note_left_behind(daemon);
    static inspect_findings_t findings; // Too large for a stack.
    inspect_begin(&findings);
    const inspect_wish_t wish = gw_bus_facts_wish(&daemon->config);
    inspect_link(iw_linux_hal_link(hal), &wish, &findings);
    for (unsigned i = 0; i < findings.count; i++) {
        if (findings.finding[i].verdict != INSPECT_OK) {
            char sentence[GW_WARNING_SIZE];
            inspect_sentence(&findings.finding[i], sentence, sizeof sentence);
            warn(daemon, "%s", sentence);
        }
    }
}

/// Once when it begins: who may empty the queue is asked to, as far as that is set up.
static void tell_left_behind(gw_daemon_t *daemon) {
    const iw_bus_link_t *link = iw_linux_hal_link(&daemon->hal);
    const char *bus = daemon->config.bus.interface;
    daemon->left_told = gw_daemon_look(daemon).left_behind;
    if (daemon->left_told) {
        char sentence[GW_WARNING_SIZE];
        gw_bus_left_sentence(link, bus, sentence, sizeof sentence);
        gw_log(&daemon->log, GW_LOG_WARNING, "%s", sentence);
        if (link->presence != IW_LINK_LOCAL) {
            (void)gw_bus_left_ask(GW_RUNTIME_DIRECTORY,
                                  bus); // Where nobody could be asked, the sentence says what to do.
        }
    }
    note_warnings(daemon);
}

void gw_bus_facts_follow(gw_daemon_t *daemon) {
    const iw_bus_link_t *link = iw_linux_hal_link(&daemon->hal);
    if (daemon->left_told != gw_daemon_look(daemon).left_behind) {
        tell_left_behind(daemon);
    }
    if (daemon->link_known && link->changes == daemon->link_changes) {
        return;
    }
    const iw_bus_facts_t facts = {.timing_contradicted = refuses(daemon), .echo_proven = link->echo_proven};
    daemon->link_known = true;
    daemon->link_changes = link->changes;
    iw_gateway_bus_facts(&daemon->gateway, &facts);
    gw_tape_facts(&daemon->tape, daemon->now_us, &facts);
    note_warnings(daemon);
    log_purge(daemon, link->purge);
}

inspect_wish_t gw_bus_facts_wish(const gateway_config_t *config) {
    return (inspect_wish_t){
        .name = config->bus.interface,
        .bitrate_hz = config->bus.bitrate,
        .sample_point_permille = config->bus.sample_point_permille,
        .refuses = config->bus.on_mismatch == GATEWAY_MISMATCH_REFUSE,
    };
}

void gw_bus_left_sentence(const iw_bus_link_t *link, const char *bus, char *out_sentence, size_t size) {
    static const char what[] = "a setpoint is still in the controller and may leave when wheels get power";
    if (link->presence == IW_LINK_LOCAL) {
        (void)snprintf(out_sentence, size, "bus %s: %s; start its hub (the simulator) again", bus, what);
    } else if (!link->echo_proven) {
        (void)snprintf(out_sentence, size, "bus %s: %s; this adapter gives nothing back: switch it off and on", bus,
                       what);
    } else {
        (void)snprintf(out_sentence, size,
                       "bus %s: %s; empty it: ip link set %s down; ip link set %s up (or let the service do it: "
                       "systemctl enable --now iwheel-can-restart@%s.path)",
                       bus, what, bus, bus, bus);
    }
}

bool gw_bus_left_ask(const char *directory, const char *interface) {
    static const char text[] = "restart\n";
    char path[PATH_SIZE];
    if (snprintf(path, sizeof path, "%s/%s.restart", directory, interface) >= (int)sizeof path) {
        return false;
    }
    (void)unlink(path); // Made anew, so that nothing is written through a link.
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (fd < 0) {
        return false;
    }
    const bool written = write(fd, text, sizeof text - 1U) == (ssize_t)(sizeof text - 1U);
    return (close(fd) == 0) && written;
}
