// SPDX-License-Identifier: MIT
#include "gateway_config.h"

#include "contacts.h"

#include "config/settings.h"

#include "gateway_keys.h"

#include <string.h>

#define WATCHDOG_MS        1000U
#define GEAR_TERM_MAX      1000U
#define INTERFACE_NAME_MAX 15U

#define AT(member)                SETTINGS_FIELD(gateway_config_t, member)
#define CORE(member, fault)       .kind = SETTINGS_NUMBER, .range = (fault), AT(core.member)
#define NUMBER(member, low, high) .kind = SETTINGS_NUMBER, .min = (low), .max = (high), AT(member)
#define WORD(member, list)        .kind = SETTINGS_WORD, .words = (list), AT(member)
#define RULE(text)                .rule = (text)
#define TEXT(member, judge)       .kind = SETTINGS_TEXT, .wrong = (judge), AT(member)

#define REST_RULE "rule R15, a wheel that rolls must not count as at standstill"

static const settings_word_t release_hold[] = {{"release", 0}, {"hold", 1}, {NULL, 0}};
static const settings_word_t wheel_rotor[] = {{"wheel", 0}, {"rotor", 1}, {NULL, 0}};
static const settings_word_t low_high[] = {{"low", 0}, {"high", 1}, {NULL, 0}};
static const settings_word_t mismatch[] = {
    {"refuse", GATEWAY_MISMATCH_REFUSE}, {"warn", GATEWAY_MISMATCH_WARN}, {NULL, 0}};
static const settings_word_t roles[] = {{"limit", IW_ROLE_LIMIT}, {"setpoint", IW_ROLE_SETPOINT}, {NULL, 0}};
static const settings_word_t units[] = {{"cN", IW_FORCE_CN}, {"dN", IW_FORCE_DN}, {NULL, 0}};

static const char *wrong_interface(const char *text) {
    if (strncmp(text, "unix:", 5) == 0) {
        return settings_wrong_address(text);
    }
    return (strlen(text) <= INTERFACE_NAME_MAX && strpbrk(text, " /:") == NULL)
               ? NULL
               : "is neither an interface name (at most 15 characters, such as can0) nor unix:PATH";
}

static bool parse_ratio(const char *text, void *values, char out_why[SETTINGS_MESSAGE_SIZE]) {
    gateway_config_t *config = values;
    const char *slash = strchr(text, '/');
    const size_t first = (slash != NULL) ? (size_t)(slash - text) : strlen(text);
    uint32_t turns = 0;
    uint32_t per = 1;
    if (!settings_digits(text, first, &turns) ||
        (slash != NULL && !settings_digits(slash + 1, strlen(slash + 1), &per))) {
        return settings_wrong(
            out_why, "gear_ratio = %s is not N or N/M; write rotor turns per wheel turn, for example 1 or 27/2", text);
    }
    if (turns < 1U || turns > GEAR_TERM_MAX || per < 1U || per > GEAR_TERM_MAX) {
        return settings_wrong(out_why, "gear_ratio = %s is out of range; write N and M within 1..1000", text);
    }
    iw_config_t trial;
    iw_config_default(&trial);
    trial.gear_turns = (uint16_t)turns;
    trial.gear_per = (uint16_t)per;
    if (iw_config_check(&trial) != IW_CONFIG_OK) {
        return settings_wrong(
            out_why, "gear_ratio = %s is out of range; rotor turns per wheel turn must lie within 1..100", text);
    }
    config->core.gear_turns = trial.gear_turns;
    config->core.gear_per = trial.gear_per;
    return true;
}

static void format_ratio(const void *values, char out[SETTINGS_MESSAGE_SIZE]) {
    const iw_config_t *core = &((const gateway_config_t *)values)->core;
    (void)snprintf(out, SETTINGS_MESSAGE_SIZE, (core->gear_per == 1U) ? "%u" : "%u/%u", (unsigned)core->gear_turns,
                   (unsigned)core->gear_per);
}

static const settings_key_t keys[] = {
    {"bus", "interface", "", TEXT(bus.interface, wrong_interface)},
    {"bus", "bitrate", " bit/s", NUMBER(bus.bitrate, 10000, 1000000)},
    {"bus", "sample_point_permille", " permille", NUMBER(bus.sample_point_permille, 500, 900)},
    {"bus", "on_mismatch", "", WORD(bus.on_mismatch, mismatch)},

    {"wheels", "setpoint_type", "", NUMBER(core.setpoint_type, 0, 255),
     .set = offsetof(gateway_config_t, core.setpoint_type_set)},
    {"wheels", "current_role", "", WORD(core.current_role, roles)},
    {"wheels", "rpm_of", "", WORD(core.rpm_of_rotor, wheel_rotor)},
    {"wheels", "radius_mm", " mm", CORE(radius_mm, IW_CONFIG_RADIUS),
     RULE("rule R15, a wrong radius makes every speed and distance wrong")},
    {"wheels", "gear_ratio", "", .kind = SETTINGS_OWN, .parse = parse_ratio, .format = format_ratio},
    {"wheels", "track_mm", " mm", CORE(track_mm, IW_CONFIG_TRACK), .unset_is_0 = true},
    {"wheels", "setpoint_dlc", "", CORE(setpoint_dlc, IW_CONFIG_SETPOINT_DLC)},

    {"left", "invert", "", WORD(core.invert[IW_LEFT], settings_no_yes)},
    {"left", "force_unit", "", WORD(core.force_unit[IW_LEFT], units)},
    {"right", "invert", "", WORD(core.invert[IW_RIGHT], settings_no_yes)},
    {"right", "force_unit", "", WORD(core.force_unit[IW_RIGHT], units)},

    {"drive", "period_ms", " ms", CORE(period_ms, IW_CONFIG_PERIOD)},
    {"drive", "lease_ms", " ms", CORE(lease_ms, IW_CONFIG_LEASE),
     .not_zero = "the lease cannot be disabled, it stops the wheels when the client dies"},
    {"drive", "accel_mm_s2", " mm/s2", CORE(accel_mm_s2, IW_CONFIG_ACCEL)},
    {"drive", "decel_mm_s2", " mm/s2", CORE(decel_mm_s2, IW_CONFIG_DECEL)},
    {"drive", "max_speed_mm_s", " mm/s", CORE(max_speed_mm_s, IW_CONFIG_MAX_SPEED)},
    {"drive", "max_yaw_mrad_s", " mrad/s", CORE(max_yaw_mrad_s, IW_CONFIG_MAX_YAW)},
    {"drive", "yaw_accel_mrad_s2", " mrad/s2", CORE(yaw_accel_mrad_s2, IW_CONFIG_YAW_ACCEL)},
    {"drive", "max_current_mA", " mA", CORE(max_current_mA, IW_CONFIG_MAX_CURRENT),
     RULE("rule R15, with less a loaded wheel may have no torque to brake with")},
    {"drive", "min_current_mA", " mA", CORE(min_current_mA, IW_CONFIG_MIN_CURRENT)},
    {"drive", "asymmetric_current", "", WORD(core.asymmetric_current, settings_no_yes)},
    {"drive", "zero_hold_ms", " ms", CORE(zero_hold_ms, IW_CONFIG_ZERO_HOLD)},
    {"drive", "hold_max_s", " s", CORE(hold_max_s, IW_CONFIG_HOLD_MAX)},
    {"drive", "after_stop", "", WORD(core.hold, release_hold)},

    {"limits", "wheel_silent_ms", " ms", CORE(wheel_silent_ms, IW_CONFIG_WHEEL_SILENT)},
    {"limits", "echo_ms", " ms", CORE(echo_ms, IW_CONFIG_ECHO)},
    {"limits", "rest_rpm", " rpm", CORE(rest_rpm, IW_CONFIG_REST_RPM), RULE(REST_RULE)},
    {"limits", "rest_ms", " ms", CORE(rest_ms, IW_CONFIG_REST)},
    {"limits", "follow_mm_s", " mm/s", CORE(follow_mm_s, IW_CONFIG_FOLLOW_SPEED),
     RULE("rule R13, a wheel that runs away must latch")},
    {"limits", "follow_ms", " ms", CORE(follow_ms, IW_CONFIG_FOLLOW),
     RULE("rule R13, a wheel that runs away must latch")},
    {"limits", "blocked_ms", " ms", CORE(blocked_ms, IW_CONFIG_BLOCKED),
     RULE("rule R13, a blocked wheel must stop the pair")},
    {"limits", "pair_mm", " mm", CORE(pair_mm, IW_CONFIG_PAIR),
     RULE("rule R14, a machine that turns on its own must stop")},
    {"limits", "pair_leak_ms", " ms", CORE(pair_leak_ms, IW_CONFIG_PAIR_LEAK),
     RULE("rule R14, a machine that turns on its own must stop")},
    {"limits", "wheel_lag_ms", " ms", CORE(wheel_lag_ms, IW_CONFIG_WHEEL_LAG)},
    {"limits", "battery_low_dV", " dV", NUMBER(health.battery_low_dV, 10, 254),
     .set = offsetof(gateway_config_t, health.has_battery)},
    {"limits", "temperature_high_degC", " degC", NUMBER(health.temperature_high_degC, 20, 200),
     .set = offsetof(gateway_config_t, health.has_temperature)},

    {"estop", "line", "", TEXT(estop.line, settings_wrong_address)},
    {"estop", "active", "", WORD(estop.active_high, low_high)},
    {"estop", "debounce_ms", " ms", NUMBER(estop.debounce_ms, 0, 1000)},
    {"estop", "chip", "", TEXT(estop.chip, settings_wrong_address)},
    {"estop", "chip_line", "", TEXT(estop.chip_line, settings_wrong_address)},
    {"estop", "line2", "", TEXT(estop.line2, settings_wrong_address)},
    {"estop", "line2_active", "", WORD(estop.active2_high, low_high)},
    {"estop", "chip2", "", TEXT(estop.chip2, settings_wrong_address)},
    {"estop", "chip2_line", "", TEXT(estop.chip2_line, settings_wrong_address)},
    {"estop", "estop_discrepancy_ms", " ms", NUMBER(estop.discrepancy_ms, 50, 1000)},

    {"northbound", "socket", "", TEXT(northbound.socket, settings_wrong_socket)},
    {"northbound", "mode", "", .kind = SETTINGS_MODE, AT(northbound.mode)},
    {"northbound", "group", "", TEXT(northbound.group, settings_wrong_group)},
    {"northbound", "max_clients", " clients", NUMBER(northbound.max_clients, 1, 64)},
    {"northbound", "watch_socket", "", TEXT(northbound.watch_socket, settings_wrong_socket)},
    {"northbound", "watch_mode", "", .kind = SETTINGS_MODE, AT(northbound.watch_mode)},
    {"northbound", "watch_group", "", TEXT(northbound.watch_group, settings_wrong_group)},
    {"northbound", "max_watchers", " clients", NUMBER(northbound.max_watchers, 1, 64)},
    {"northbound", "max_age_ms", " ms", NUMBER(northbound.max_age_ms, 200, 2000)},

    {"record", "blackbox_s", " s", NUMBER(record.blackbox_s, 0, 600)},
    {"record", "directory", "", TEXT(record.directory, settings_wrong_address)},
    {"record", "keep_stops", "", NUMBER(record.keep_stops, 8, 256)},
};

static void find_range(uint16_t range, uint32_t *out_min, uint32_t *out_max) {
    const iw_config_range_t found = iw_config_range((iw_config_fault_t)range);
    *out_min = found.min;
    *out_max = found.max;
}

static const char *hint(const char *key) {
    const char *id = strstr(key, "id");
    const bool speaks_of_ids = id != NULL && (id == key || id[-1] == '_') && strchr("s_", id[2]) != NULL;
    return speaks_of_ids
               ? "the ids are fixed by the wheels (setpoints: left 266 = 0x10A, right 298 = 0x12A), delete the "
                 "line; for exchanged wheels exchange their cables"
               : NULL;
}

static const settings_form_t form;

static unsigned line_of(const char *key, const unsigned *lines) {
    return lines[settings_find(&form, NULL, key) - keys];
}

/// Returns the line of the last given key of the stop budget.
static unsigned last_line(const unsigned *lines) {
    static const char *const budget[] = {"period_ms", "lease_ms", "decel_mm_s2", "max_speed_mm_s"};
    unsigned last = 0;
    for (size_t i = 0; i < sizeof budget / sizeof budget[0]; i++) {
        const unsigned line = line_of(budget[i], lines);
        if (line > last) {
            last = line;
        }
    }
    return last;
}

/// Lists each fix of the budget alone, as far as the range of its key allows.
static void budget_fixes(const iw_config_t *core, char *out, size_t size) {
    const uint32_t spent = (uint32_t)core->lease_ms + core->period_ms;
    const uint32_t ramp_ms = ((uint32_t)core->max_speed_mm_s * 1000U + core->decel_mm_s2 - 1U) / core->decel_mm_s2;
    const uint32_t left_ms = WATCHDOG_MS - spent;
    const uint32_t decel = ((uint32_t)core->max_speed_mm_s * 1000U + left_ms - 1U) / left_ms;
    const uint32_t speed = left_ms * core->decel_mm_s2 / 1000U;
    int used = snprintf(out, size, "write max_speed_mm_s = %u at most", (unsigned)speed);
    if (decel <= iw_config_range(IW_CONFIG_DECEL).max) {
        used += snprintf(out + used, size - (size_t)used, ", or decel_mm_s2 = %u at least", (unsigned)decel);
    }
    if (ramp_ms + core->period_ms + iw_config_range(IW_CONFIG_LEASE).min <= WATCHDOG_MS) {
        (void)snprintf(out + used, size - (size_t)used, ", or lease_ms = %u at most",
                       (unsigned)(WATCHDOG_MS - core->period_ms - ramp_ms));
    }
}

/// Sets the standstill values from radius and gear if they are not given.
static void complete(void *values, const unsigned *lines) {
    iw_config_t *core = &((gateway_config_t *)values)->core;
    if (line_of("rest_rpm", lines) == 0U) {
        core->rest_rpm = iw_config_rest(core).standard;
    }
}

static void complain_rest(settings_report_t *report, const iw_config_t *core, unsigned line) {
    settings_complain(report, line,
                      "rest_rpm = %u is more than 60 mm/s at a wheel with radius_mm = %u: " REST_RULE
                      "; write 0..%u rpm, or leave the key out to have %u",
                      core->rest_rpm, core->radius_mm, iw_config_rest(core).max, iw_config_rest(core).standard);
}

static void relate(settings_report_t *report, const void *values, const unsigned *lines) {
    const iw_config_t *core = &((const gateway_config_t *)values)->core;
    config_relate_contacts(values, report, line_of("line2", lines), line_of("estop_discrepancy_ms", lines));
    char fixes[SETTINGS_MESSAGE_SIZE];
    const iw_config_fault_t fault = iw_config_check(core);
    if (fault == IW_CONFIG_STOP_BUDGET) {
        budget_fixes(core, fixes, sizeof fixes);
        settings_complain(
            report, last_line(lines),
            "after a lost client the wheels would need lease_ms %u + period_ms %u + max_speed_mm_s %u / decel_mm_s2 %u "
            "= %u ms to stop, more than the %u ms of their own watchdog; %s",
            core->lease_ms, core->period_ms, core->max_speed_mm_s, core->decel_mm_s2,
            (unsigned)iw_config_stop_budget(core).client_lost_ms, WATCHDOG_MS, fixes);
    } else if (fault == IW_CONFIG_REST_SPEED) {
        complain_rest(report, core, line_of("rest_rpm", lines));
    } else if (fault == IW_CONFIG_MIN_CURRENT) {
        settings_complain(
            report, line_of("min_current_mA", lines),
            "min_current_mA = %u is more than max_current_mA = %u: rule R15, no limit of a client would be "
            "permitted; write min_current_mA = %u at most, or max_current_mA = %u at least",
            core->min_current_mA, core->max_current_mA, core->max_current_mA, core->min_current_mA);
    } else if (fault != IW_CONFIG_OK) {
        settings_complain(report, 0, "the values do not fit together (fault %d); compare with share/gateway.conf",
                          (int)fault);
    }
}

static const settings_form_t form = {
    .keys = keys,
    .help = gateway_keys,
    .count = sizeof keys / sizeof keys[0],
    .program = "the gateway",
    .missing = "create it from share/gateway.conf, or name another with -c FILE",
    .range = find_range,
    .hint = hint,
    .complete = complete,
    .relate = relate,
};
IW_STATIC_ASSERT(sizeof keys / sizeof keys[0] <= SETTINGS_KEYS_MAX, keys_fit);

void gateway_config_default(gateway_config_t *out_config) {
    static const gateway_config_t standard = {
        .bus = {"can0", 1000000U, 625U, GATEWAY_MISMATCH_REFUSE},
        .estop = {"ESTOP", true, 5U, "any", "any", "none", true, "any", "any", 200U},
        .northbound = {"/run/iwheel/gateway.sock", 0660U, "iwheel", 16U, "none", 0660U, "iwheel-watch", 16U, 1000U},
        .record = {30U, "/var/lib/iwheel", 200U},
    };
    *out_config = standard;
    iw_config_default(&out_config->core);
}

/// Stores the values if there was no error. Returns `result`.
static int store_good(int result, const gateway_config_t *read, gateway_config_t *out_config) {
    if (result == 0) {
        *out_config = *read;
    }
    return result;
}

int gateway_config_load(const char *path, gateway_config_t *out_config, FILE *err) {
    gateway_config_t config;
    gateway_config_default(&config);
    return store_good(settings_load(&form, path, &config, err), &config, out_config);
}

int gateway_config_parse(const char *name, const char *text, size_t size, gateway_config_t *out_config, FILE *err) {
    settings_report_t report = {.name = name, .err = err};
    gateway_config_t config;
    gateway_config_default(&config);
    return store_good(settings_parse(&form, &report, text, size, &config), &config, out_config);
}

int gateway_config_override(gateway_config_t *config, const char *name, const char *value, const char *origin,
                            FILE *err) {
    settings_report_t report = {.name = origin, .err = err};
    gateway_config_t changed = *config;
    return store_good(settings_override(&form, &report, name, value, &changed), &changed, config);
}

void gateway_config_print(const gateway_config_t *config, FILE *out) {
    gateway_config_print_noted(config, NULL, NULL, out);
}

void gateway_config_print_noted(const gateway_config_t *config, gateway_config_note_t note, const void *context,
                                FILE *out) {
    const settings_note_t noted = {.say = note, .context = context};
    gateway_config_t defaults;
    gateway_config_default(&defaults);
    defaults.core.rest_rpm = iw_config_rest(&config->core).standard;
    (void)fputs("; Configuration of the iWheel gateway. A key left out has its default; an unknown one is an error. "
                "Without\n; setpoint_type, current_role and track_mm, which have none, no wheel moves.\n",
                out);
    if (config->core.listen_only) {
        (void)fputs("; In force from the command line: --listen-only, nothing is ever sent.\n", out);
    }
    settings_print(&form, config, &defaults, (note != NULL) ? &noted : NULL, out);
}
