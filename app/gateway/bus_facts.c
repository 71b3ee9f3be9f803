// SPDX-License-Identifier: MIT
#include "bus_facts.h"

#include "report.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef gw_fact_verdict_t verdict_t;

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
               "set %s down; ip link set %s up (or give the gateway CAP_NET_ADMIN)",
               bus, bus, bus);
    } else if (purge == IW_LINK_PURGE_FAILED) {
        gw_log(&daemon->log, GW_LOG_ERROR,
               "bus %s: its queue could not be emptied; look with: ip -details link show %s", bus, bus);
    }
}

void gw_bus_facts_follow(gw_daemon_t *daemon) {
    const iw_bus_link_t *link = iw_linux_hal_link(&daemon->hal);
    if (daemon->link_known && link->changes == daemon->link_changes) {
        return;
    }
    const iw_bus_facts_t facts = {.timing_contradicted = refuses(daemon), .echo_proven = link->echo_proven};
    daemon->link_known = true;
    daemon->link_changes = link->changes;
    iw_gateway_bus_facts(&daemon->gateway, &facts);
    gw_report_warnings(daemon);
    log_purge(daemon, link->purge);
}

__attribute__((format(printf, 3, 4))) static verdict_t say(verdict_t verdict, char *out_text, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(out_text, GW_FACT_SIZE, format, arguments);
    va_end(arguments);
    return verdict;
}

/// How to set the bit timing; what follows the verdict on it.
static void append_cure(const gw_daemon_t *daemon, char *text) {
    const char *bus = daemon->config.bus.interface;
    const size_t length = strlen(text);
    (void)snprintf(text + length, GW_FACT_SIZE - length,
                   "; set it: ip link set %s down; ip link set %s type can bitrate %" PRIu32
                   " sample-point 0.%03u restart-ms 100; ip link set %s txqueuelen %u; ip link set %s up",
                   bus, bus, daemon->config.bus.bitrate, daemon->config.bus.sample_point_permille, bus,
                   IW_LINK_QUEUE_MAX, bus);
}

static verdict_t tell_presence(const gw_daemon_t *daemon, const iw_bus_link_t *link, char *out_text) {
    const char *bus = daemon->config.bus.interface;
    switch (link->presence) {
    case IW_LINK_ABSENT:
        return say(GW_FACT_FAIL, out_text,
                   "bus %s: there is no such interface; plug the adapter in, or name the right one in [bus] interface: "
                   "ip -brief link show type can",
                   bus);
    case IW_LINK_NOT_CAN:
        return say(GW_FACT_FAIL, out_text,
                   "bus %s: not a CAN interface; name the right one in [bus] interface: ip -brief link show type can",
                   bus);
    case IW_LINK_DOWN:
        (void)say(GW_FACT_FAIL, out_text, "bus %s: the interface is down", bus);
        if (link->is_virtual) {
            (void)say(GW_FACT_FAIL, out_text, "bus %s: the interface is down; ip link set %s up", bus, bus);
        } else {
            append_cure(daemon, out_text);
        }
        return GW_FACT_FAIL;
    default:
        return say(GW_FACT_OK, out_text, "bus %s: the interface is up", bus);
    }
}

static verdict_t tell_timing(const gw_daemon_t *daemon, const iw_bus_link_t *link, char *out_text) {
    static const verdict_t verdicts[] = {
        [IW_TIMING_VIRTUAL] = GW_FACT_OK, [IW_TIMING_UNKNOWN] = GW_FACT_WARN, [IW_TIMING_RIGHT] = GW_FACT_OK,
        [IW_TIMING_NEAR] = GW_FACT_WARN,  [IW_TIMING_WRONG] = GW_FACT_FAIL,
    };
    const iw_timing_t timing = judge(daemon);
    char bitrate[24] = "--";
    char sample_point[24] = "--";
    if (timing == IW_TIMING_VIRTUAL || link->presence < IW_LINK_DOWN) {
        return GW_FACT_OK;
    }
    if (link->bitrate_hz != 0U) {
        (void)snprintf(bitrate, sizeof bitrate, "%" PRIu32 " bit/s", link->bitrate_hz);
    }
    if (link->sample_point_permille != 0U) {
        (void)snprintf(sample_point, sizeof sample_point, "%u.%u %%", link->sample_point_permille / 10U,
                       link->sample_point_permille % 10U);
    }
    (void)say(GW_FACT_OK, out_text, "bit timing: %s, sample point %s; wanted %" PRIu32 " bit/s, %u.%u %%", bitrate,
              sample_point, daemon->config.bus.bitrate, daemon->config.bus.sample_point_permille / 10U,
              daemon->config.bus.sample_point_permille % 10U);
    if (timing != IW_TIMING_RIGHT) {
        append_cure(daemon, out_text);
    }
    return timing == IW_TIMING_WRONG && !refuses(daemon) ? GW_FACT_WARN : verdicts[timing];
}

static verdict_t tell_queue(const gw_daemon_t *daemon, const iw_bus_link_t *link, char *out_text) {
    const char *bus = daemon->config.bus.interface;
    if (link->presence < IW_LINK_DOWN || link->is_virtual || link->queue_length <= IW_LINK_QUEUE_MAX) {
        return GW_FACT_OK;
    }
    return say(GW_FACT_WARN, out_text,
               "queue of %s: %" PRIu32 " frames may wait in it, and be old when a dead bus revives; ip link set %s "
               "txqueuelen %u",
               bus, link->queue_length, bus, IW_LINK_QUEUE_MAX);
}

static verdict_t tell_restart(const gw_daemon_t *daemon, const iw_bus_link_t *link, char *out_text) {
    const char *bus = daemon->config.bus.interface;
    if (link->presence < IW_LINK_DOWN || link->is_virtual || link->restart_ms != 0U) {
        return GW_FACT_OK;
    }
    return say(GW_FACT_WARN, out_text,
               "after bus-off %s stays off until somebody restarts it; ip link set %s down; ip link set %s type can "
               "restart-ms 100; ip link set %s up",
               bus, bus, bus, bus);
}

static verdict_t tell_mode(const gw_daemon_t *daemon, const iw_bus_link_t *link, char *out_text) {
    const char *bus = daemon->config.bus.interface;
    if (!link->is_mute) {
        return GW_FACT_OK;
    }
    return say(GW_FACT_FAIL, out_text,
               "%s is in listen-only mode and cannot send; ip link set %s down; ip link set %s type can listen-only "
               "off; ip link set %s up",
               bus, bus, bus, bus);
}

static verdict_t tell_echo(const gw_daemon_t *daemon, const iw_bus_link_t *link, char *out_text) {
    if (link->presence == IW_LINK_ABSENT || link->presence == IW_LINK_NOT_CAN || link->echo_proven) {
        return GW_FACT_OK;
    }
    return say(GW_FACT_WARN, out_text,
               "the echo of %s is unproven: whether a setpoint was on the bus cannot be known; use an adapter whose "
               "driver has IFF_ECHO (most have; vcan and slcan have not)",
               daemon->config.bus.interface);
}

bool gw_bus_facts_tell(const gw_daemon_t *daemon, unsigned index, verdict_t *out_verdict, char out_text[GW_FACT_SIZE]) {
    static verdict_t (*const tellers[])(const gw_daemon_t *, const iw_bus_link_t *, char *) = {
        tell_presence, tell_mode, tell_timing, tell_queue, tell_restart, tell_echo,
    };
    const iw_bus_link_t *link = iw_linux_hal_link(&daemon->hal);
    out_text[0] = '\0';
    *out_verdict = GW_FACT_OK;
    if (link->presence == IW_LINK_LOCAL || index >= sizeof tellers / sizeof tellers[0]) {
        return false;
    }
    *out_verdict = tellers[index](daemon, link, out_text);
    return true;
}
