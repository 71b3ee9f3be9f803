// SPDX-License-Identifier: MIT
#include "inspect.h"

#include <inttypes.h>
#include <stdio.h>

/// Size of 21 frames in the kernel: a full bus carries as many in a millisecond.
#define BYTES_PER_MS 16384U

/// Writes the commands that configure the interface for the wheels.
static void fix_timing(const inspect_config_t *config, inspect_findings_t *findings) {
    const char *bus = config->name;
    inspect_fix(findings,
                "set it: ip link set %s down; ip link set %s type can bitrate %" PRIu32
                " sample-point 0.%03u restart-ms 100; ip link set %s txqueuelen %u; ip link set %s up",
                bus, bus, config->bitrate_hz, config->sample_point_permille, bus, IWL_LINK_QUEUE_MAX, bus);
}

static void judge_presence(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    const char *bus = config->name;
    switch (link->presence) {
    case IWL_LINK_ABSENT:
        inspect_add(findings, "interface", INSPECT_FAIL, "bus %s: there is no such interface", bus);
        inspect_fix(findings, "plug the adapter in, or name the right one in [bus] interface: ip -brief link show "
                              "type can");
        break;
    case IWL_LINK_NOT_CAN:
        inspect_add(findings, "interface", INSPECT_FAIL, "bus %s: not a CAN interface", bus);
        inspect_fix(findings, "name the right one in [bus] interface: ip -brief link show type can");
        break;
    case IWL_LINK_DOWN:
        inspect_add(findings, "interface", INSPECT_FAIL, "bus %s: the interface is down", bus);
        if (link->is_virtual) {
            inspect_fix(findings, "ip link set %s up", bus);
        } else {
            fix_timing(config, findings);
        }
        break;
    default:
        inspect_add(findings, "interface", INSPECT_OK, "bus %s: the interface is up", bus);
        break;
    }
}

static void judge_mode(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    const char *bus = config->name;
    if (link->is_mute) {
        inspect_add(findings, "mode", INSPECT_FAIL, "%s is in listen-only mode and cannot send", bus);
        inspect_fix(findings, "ip link set %s down; ip link set %s type can listen-only off; ip link set %s up", bus,
                    bus, bus);
    }
}

static void judge_timing(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    static const inspect_verdict_t verdicts[] = {
        [IWL_TIMING_VIRTUAL] = INSPECT_OK, [IWL_TIMING_UNKNOWN] = INSPECT_WARN, [IWL_TIMING_RIGHT] = INSPECT_OK,
        [IWL_TIMING_NEAR] = INSPECT_WARN,  [IWL_TIMING_WRONG] = INSPECT_FAIL,
    };
    const iwl_timing_t timing = iwl_timing_judge(link, config->bitrate_hz, config->sample_point_permille);
    char bitrate[24] = "--";
    char sample_point[24] = "--";
    if (timing == IWL_TIMING_VIRTUAL || link->presence < IWL_LINK_DOWN) {
        return;
    }
    if (link->bitrate_hz != 0U) {
        (void)snprintf(bitrate, sizeof bitrate, "%" PRIu32 " bit/s", link->bitrate_hz);
    }
    if (link->sample_point_permille != 0U) {
        (void)snprintf(sample_point, sizeof sample_point, "%u.%u %%", link->sample_point_permille / 10U,
                       link->sample_point_permille % 10U);
    }
    inspect_add(findings, "bit_timing",
                (timing == IWL_TIMING_WRONG && !config->refuses) ? INSPECT_WARN : verdicts[timing],
                "bit timing: %s, sample point %s; wanted %" PRIu32 " bit/s, %u.%u %%", bitrate, sample_point,
                config->bitrate_hz, config->sample_point_permille / 10U, config->sample_point_permille % 10U);
    if (timing != IWL_TIMING_RIGHT) {
        fix_timing(config, findings);
    }
}

static void judge_queue(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    if (link->presence < IWL_LINK_DOWN || link->is_virtual || link->queue_length <= IWL_LINK_QUEUE_MAX) {
        return;
    }
    inspect_add(findings, "queue", INSPECT_WARN,
                "queue of %s: %" PRIu32 " frames may wait in it, and be outdated when the bus works again",
                config->name, link->queue_length);
    inspect_fix(findings, "ip link set %s txqueuelen %u", config->name, IWL_LINK_QUEUE_MAX);
}

static void judge_restart(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    const char *bus = config->name;
    if (link->presence < IWL_LINK_DOWN || link->is_virtual || link->restart_ms != 0U) {
        return;
    }
    inspect_add(findings, "restart", INSPECT_WARN, "after bus-off %s stays off until a person restarts it", bus);
    inspect_fix(findings, "ip link set %s down; ip link set %s type can restart-ms 100; ip link set %s up", bus, bus,
                bus);
}

static void judge_echo(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    if (link->presence == IWL_LINK_ABSENT || link->presence == IWL_LINK_NOT_CAN || link->echo_proven) {
        return;
    }
    inspect_add(findings, "echo", INSPECT_WARN,
                "the echo of %s is unproven: whether a setpoint was on the bus cannot be known", config->name);
    inspect_fix(findings, "use an adapter whose driver has IFF_ECHO (most have it; vcan and slcan do not)");
}

void inspect_room(const iwl_bus_link_t *link, inspect_findings_t *findings) {
    if (link->presence != IWL_LINK_UP || link->room_bytes == 0U) {
        return;
    }
    const bool granted = link->room_bytes >= 2U * IWL_LINK_ROOM_BYTES;
    inspect_add(findings, "room", granted ? INSPECT_OK : INSPECT_WARN,
                "receive buffer: %" PRIu32 " of %u KiB granted, %" PRIu32 " ms of a full bus%s",
                link->room_bytes / 2U / 1024U, IWL_LINK_ROOM_BYTES / 1024U, link->room_bytes / BYTES_PER_MS,
                granted ? "" : "; if other programs use the processor for longer, frames get lost");
    if (!granted) {
        inspect_fix(findings, "sudo sysctl net.core.rmem_max=%u, and start the gateway again", IWL_LINK_ROOM_BYTES);
    }
}

void inspect_link(const iwl_bus_link_t *link, const inspect_config_t *config, inspect_findings_t *findings) {
    if (link->presence == IWL_LINK_LOCAL) {
        return;
    }
    judge_presence(link, config, findings);
    judge_mode(link, config, findings);
    judge_timing(link, config, findings);
    judge_queue(link, config, findings);
    judge_restart(link, config, findings);
    judge_echo(link, config, findings);
}
