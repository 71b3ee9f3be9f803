// SPDX-License-Identifier: MIT
#include "inspect.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/// A rate that differs from the nominal one by this share causes a warning, with a tolerance of two frames.
#define RATE_OFF_PERMILLE 100U
#define RATE_OFF_FRAMES   2U
/// A higher load delays setpoints: their ids have lower priority than those of the wheels' speeds and all lower ids.
#define LOAD_HIGH_PERMILLE 500U

#define MESSAGE_FORMAT "%s %s %u (0x%03X)"

static const char *side_of(const iw_codec_row_t *row) {
    return (row->side == IW_LEFT) ? "left" : "right";
}

static const char *name_of(const iw_codec_row_t *row) {
    return iw_codec_name((iw_codec_kind_t)row->kind);
}

static const char *wheel_check(iw_side_t side) {
    return (side == IW_LEFT) ? "left_wheel" : "right_wheel";
}

/// Writes "250.0".
static void write_rate(uint32_t rate_mHz, char out_text[16]) {
    (void)snprintf(out_text, 16, "%" PRIu32 ".%" PRIu32, rate_mHz / 1000U, rate_mHz % 1000U / 100U);
}

/// Returns true if the message does not arrive at its rate.
static bool rate_is_off(const inspect_traffic_t *traffic, unsigned index) {
    const iw_codec_row_t *row = &iw_codec_rows[index];
    const uint64_t wanted = (uint64_t)inspect_nominal_mHz(row) * traffic->span_us / 1000000U / 1000U;
    const uint64_t got = traffic->count[index];
    const uint64_t off = (got > wanted) ? got - wanted : wanted - got;
    return inspect_always(row) && off > wanted * RATE_OFF_PERMILLE / 1000U + RATE_OFF_FRAMES;
}

static void judge_rate(const inspect_traffic_t *traffic, unsigned index, inspect_findings_t *findings) {
    const iw_codec_row_t *row = &iw_codec_rows[index];
    char rate[16];
    char nominal[16];
    if (!rate_is_off(traffic, index)) {
        return;
    }
    write_rate(inspect_rate_mHz(traffic, index), rate);
    write_rate(inspect_nominal_mHz(row), nominal);
    if (traffic->count[index] == 0U) {
        inspect_add(findings, "rates", INSPECT_WARN, MESSAGE_FORMAT ": none received; the document has %s a second",
                    side_of(row), name_of(row), row->id, row->id, nominal);
    } else {
        inspect_add(findings, "rates", INSPECT_WARN, MESSAGE_FORMAT ": %s a second; the document has %s", side_of(row),
                    name_of(row), row->id, row->id, rate, nominal);
    }
    inspect_fix(findings, "frames get lost: check termination (60 ohm between CAN-H and CAN-L), cable and adapter; or "
                          "this wheel has another firmware");
}

/// Judges the presence of a wheel and the rates of its messages.
static void judge_wheel(const inspect_traffic_t *traffic, iw_side_t side, inspect_findings_t *findings) {
    const char *name = (side == IW_LEFT) ? "left" : "right";
    const uint64_t span_ms = traffic->span_us / IW_US_PER_MS;
    char list[INSPECT_TEXT_SIZE] = "";
    uint32_t speeds = 0;
    for (unsigned i = 0; i < IW_CODEC_ROWS; i++) {
        const iw_codec_row_t *row = &iw_codec_rows[i];
        if (row->side != side || inspect_nominal_mHz(row) == 0U) {
            continue;
        }
        speeds += (row->kind == IW_CODEC_SPEED) ? traffic->count[i] : 0U;
        if (traffic->count[i] > 0U) {
            const size_t length = strlen(list);
            char rate[16];
            write_rate(inspect_rate_mHz(traffic, i), rate);
            (void)snprintf(&list[length], sizeof list - length, "%s%s %s/s", (length > 0U) ? ", " : "", name_of(row),
                           rate);
        }
    }
    if (speeds == 0U) {
        inspect_add(findings, wheel_check(side), INSPECT_FAIL, "%s wheel: no telemetry for %" PRIu64 " ms", name,
                    span_ms);
        inspect_fix(findings, "check its power, cable and termination");
        return;
    }
    inspect_add(findings, wheel_check(side), INSPECT_OK, "%s wheel: %s", name, list);
    for (unsigned i = 0; i < IW_CODEC_ROWS; i++) {
        if (iw_codec_rows[i].side == side) {
            judge_rate(traffic, i, findings);
        }
    }
}

static void judge_others(const inspect_traffic_t *traffic, const inspect_config_t *config,
                         inspect_findings_t *findings) {
    const uint32_t setpoints = traffic->count[inspect_message_of(IW_ID_LEFT_SETPOINT)] +
                               traffic->count[inspect_message_of(IW_ID_RIGHT_SETPOINT)];
    if (setpoints > 0U && !config->others_may_send) {
        inspect_add(findings, "second_master", INSPECT_FAIL,
                    "another device sends setpoints: %" PRIu32 " frames with id 266 (0x10A) or 298 (0x12A)", setpoints);
        inspect_fix(findings, "switch it off, or stop the gateway that sends them");
    }
}

static void judge_strangers(const inspect_traffic_t *traffic, const inspect_config_t *config,
                            inspect_findings_t *findings) {
    char list[160] = "";
    if (traffic->strange == 0U) {
        return;
    }
    for (uint32_t i = 0; i < traffic->strange_ids; i++) {
        const uint32_t id = traffic->strange_id[i];
        const bool extended = (id & IW_CAN_EXTENDED) != 0U;
        const uint32_t number = id & (extended ? 0x1FFFFFFFU : IW_CAN_ID_MASK);
        const size_t length = strlen(list);
        (void)snprintf(&list[length], sizeof list - length, extended ? "%s0x%08" PRIX32 : "%s0x%03" PRIX32,
                       (i > 0U) ? " " : "", number);
    }
    inspect_add(findings, "unknown_ids", INSPECT_WARN, "%" PRIu32 " frames do not belong to the wheels: %s%s",
                traffic->strange, list, (traffic->strange_ids == INSPECT_STRANGERS) ? " ..." : "");
    inspect_fix(findings, "find out which device sends them: iwheelctl record - --can %s --for 2s | iwheelctl decode",
                config->name);
}

static void judge_damage(const inspect_traffic_t *traffic, inspect_findings_t *findings) {
    if (traffic->bad_length > 0U) {
        inspect_add(findings, "lengths", INSPECT_WARN,
                    "%" PRIu32 " frames of the wheels' ids are shorter than the document's table, and are ignored",
                    traffic->bad_length);
        inspect_fix(findings, "another device uses these ids, or this wheel has another firmware");
    }
    if (traffic->bad_format > 0U) {
        inspect_add(findings, "lengths", INSPECT_WARN,
                    "%" PRIu32 " remote, extended or FD frames have the wheels' ids, and are ignored",
                    traffic->bad_format);
        inspect_fix(findings, "find the device that sends them and configure other ids for it");
    }
}

static void judge_load(const inspect_traffic_t *traffic, const inspect_config_t *config, inspect_findings_t *findings) {
    const uint32_t load = inspect_load_permille(traffic, config->bitrate_hz);
    const bool high = load > LOAD_HIGH_PERMILLE;
    inspect_add(findings, "load", high ? INSPECT_WARN : INSPECT_OK,
                "bus load: %" PRIu32 ".%" PRIu32 " %% without stuff bits; both wheels alone make about 6 %%",
                load / 10U, load % 10U);
    if (high) {
        inspect_fix(findings, "setpoints have to wait for lower ids: remove other devices from this bus");
    }
}

/// Reports a controller that is bus-off: missing frames then show nothing about wheels and cables.
static void add_bus_off(const iwl_bus_link_t *link, const char *bus, inspect_findings_t *findings) {
    inspect_add(findings, "bus_state", INSPECT_FAIL,
                "bus %s: bus-off: too many errors, the controller has left the bus", bus);
    if (link->presence == IWL_LINK_LOCAL) {
        inspect_fix(findings, "end it in the simulator: iwheel-sim busoff off");
    } else {
        inspect_fix(findings, "check cable, termination and bit rate, then: ip link set %s down; ip link set %s up",
                    bus, bus);
    }
}

/// Returns false if nothing more can be judged.
static bool judge_life(const iwl_bus_link_t *link, const inspect_traffic_t *traffic, const inspect_config_t *config,
                       inspect_findings_t *findings) {
    const char *bus = config->name;
    const bool off = traffic->last == IW_BUS_OFF || (!traffic->was_up && link->presence == IWL_LINK_UP);
    if (link->presence == IWL_LINK_LOCAL && (traffic->was_up || off)) {
        inspect_add(findings, "interface", INSPECT_OK, "bus %s: up", bus);
    } else if (link->presence == IWL_LINK_LOCAL) {
        inspect_add(findings, "interface", INSPECT_FAIL, "bus %s: no simulator there", bus);
        inspect_fix(findings, "start the simulator: iwheel-sim --can %s", bus);
    }
    if (off) {
        add_bus_off(link, bus, findings);
    } else if (traffic->was_up && traffic->worst == IW_BUS_OFF) {
        inspect_add(findings, "bus_state", INSPECT_WARN, "bus %s: it was bus-off during the check", bus);
        inspect_fix(findings, "check cable, termination and bit rate");
    } else if (traffic->was_up && traffic->worst == IW_BUS_PASSIVE) {
        inspect_add(findings, "bus_state", INSPECT_WARN, "bus %s: error passive: most frames fail", bus);
        inspect_fix(findings, "check bit rate, sample point, termination; a wheel without power acknowledges nothing");
    }
    return traffic->was_up && !off;
}

void inspect_bus(const iwl_bus_link_t *link, const inspect_traffic_t *traffic, const inspect_config_t *config,
                 inspect_findings_t *findings) {
    if (!judge_life(link, traffic, config, findings)) {
        return;
    }
    judge_wheel(traffic, IW_LEFT, findings);
    judge_wheel(traffic, IW_RIGHT, findings);
    judge_load(traffic, config, findings);
    judge_others(traffic, config, findings);
    judge_strangers(traffic, config, findings);
    judge_damage(traffic, findings);
}
