// SPDX-License-Identifier: MIT
#include "metrics.h"

#include "iwheel_northbound/words.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/// One metric in the base units of OpenMetrics: the integer of the gateway divided by 10 to the power of `digits`.
typedef struct {
    const char *path;
    const char *name;
    const char *help;
    unsigned digits;
    bool is_counter;
    bool is_truth;
} figure_t;

static const figure_t wheel_figures[] = {
    {"heard", "iwheel_wheel_heard", "1: online, its speed is received", 0, false, true},
    {"speed_mm_s", "iwheel_wheel_speed_meters_per_second", "Measured speed", 3, false, false},
    {"commanded_mm_s", "iwheel_wheel_commanded_meters_per_second", "Speed that the client requests", 3, false, false},
    {"applied_mm_s", "iwheel_wheel_applied_meters_per_second", "Speed in the last setpoint to the wheel", 3, false,
     false},
    {"applied_mA", "iwheel_wheel_applied_amperes", "Current in the last setpoint to the wheel", 3, false, false},
    {"force_net_mN", "iwheel_wheel_force_newtons", "Net force, while it is valid", 3, false, false},
    {"force_offset_mN", "iwheel_wheel_force_offset_newtons", "Zero of the force", 3, false, false},
    {"battery_dV", "iwheel_wheel_battery_volts", "Voltage of the wheel's battery", 1, false, false},
    {"temperature_degC", "iwheel_wheel_temperature_celsius", "Temperature of the wheel's controller", 0, false, false},
    {"distance_mm", "iwheel_wheel_distance_meters", "Distance by odometry", 3, false, false},
    {"reboots", "iwheel_wheel_reboots", "Restarts of the wheel since the gateway's start", 0, true, false},
};

static const figure_t figures[] = {
    {"lease.holder", "iwheel_lease_holder", "Number of the client that may drive", 0, false, false},
    {"bus.load_permille", "iwheel_bus_load_ratio", "Load of the bus in the last second", 3, false, false},
    {"bus.lost_frames", "iwheel_bus_lost_frames", "Frames that came faster than they were read", 0, true, false},
    {"clients", "iwheel_clients", "Clients connected to the gateway", 0, false, false},
    {"gaps.worst_us", "iwheel_setpoint_gap_worst_seconds", "Longest gap between setpoint pairs", 6, false, false},
    {"counters.received", "iwheel_frames_received", "Frames from other nodes", 0, true, false},
    {"counters.echoes", "iwheel_frames_echoed", "Echoes of the gateway's own frames", 0, true, false},
    {"counters.stray_echoes", "iwheel_frames_stray_echoes", "Echoes without a frame that waits for one", 0, true,
     false},
    {"counters.unknown", "iwheel_frames_unknown", "Frames with an id that no wheel has", 0, true, false},
    {"counters.foreign", "iwheel_frames_foreign", "Setpoints of another sender", 0, true, false},
    {"counters.bad_format", "iwheel_frames_bad_format", "Frames of the wheels with another format", 0, true, false},
    {"counters.bad_length", "iwheel_frames_bad_length", "Frames of the wheels with another length", 0, true, false},
    {"counters.pairs", "iwheel_setpoint_pairs", "Pairs of setpoints sent", 0, true, false},
    {"counters.send_later", "iwheel_setpoint_send_later", "Setpoints that the bus did not accept", 0, true, false},
    {"counters.clamped", "iwheel_setpoint_clamped", "Setpoints whose current was limited", 0, true, false},
    {"counters.purges", "iwheel_setpoint_purges", "Times that waiting setpoints were removed", 0, true, false},
    {"counters.left_behind", "iwheel_setpoint_left_behind", "Times that a setpoint stayed in the controller", 0, true,
     false},
    {"counters.gate_stopped", "iwheel_setpoint_gate_stopped", "Setpoints that the last check stopped", 0, true, false},
    {"counters.out_of_range", "iwheel_drive_out_of_range", "Refused drive commands", 0, true, false},
    {"counters.late_steps", "iwheel_late_steps", "Steps of the loop that came late", 0, true, false},
    {"counters.still_moving", "iwheel_still_moving", "Stops that ended with a wheel turning", 0, true, false},
};

static void write_head(FILE *out, const char *name, const char *type, const char *help) {
    (void)fprintf(out, "# TYPE %s %s\n# HELP %s %s.\n", name, type, name, help);
}

static void write_value(FILE *out, int64_t value, unsigned digits) {
    uint64_t whole = (value < 0) ? 0U - (uint64_t)value : (uint64_t)value;
    uint64_t unit = 1;
    for (unsigned i = 0; i < digits; i++) {
        unit *= 10U;
    }
    (void)fprintf(out, " %s%" PRIu64, (value < 0) ? "-" : "", whole / unit);
    if (digits > 0U) {
        (void)fprintf(out, ".%0*" PRIu64, (int)digits, whole % unit);
    }
    (void)fputc('\n', out);
}

static iwc_value_t read_value(const iwc_message_t *state, const figure_t *figure, const char *side) {
    char path[64];
    (void)snprintf(path, sizeof path, "%s%s%s", side, (side[0] != '\0') ? "." : "", figure->path);
    return figure->is_truth ? iwc_truth(state, path) : iwc_integer(state, path);
}

static void write_figure(const iwc_message_t *state, const figure_t *figure, bool of_wheels, FILE *out) {
    const char *const sides[] = {of_wheels ? "left" : "", "right"};
    write_head(out, figure->name, figure->is_counter ? "counter" : "gauge", figure->help);
    for (size_t i = 0; i < (of_wheels ? 2U : 1U); i++) {
        const iwc_value_t value = read_value(state, figure, sides[i]);
        if (!value.known) {
            continue;
        }
        (void)fprintf(out, "%s%s", figure->name, figure->is_counter ? "_total" : "");
        if (of_wheels) {
            (void)fprintf(out, "{side=\"%s\"}", sides[i]);
        }
        write_value(out, value.value, figure->digits);
    }
}

/// Writes a set of words, one of which is true.
static void write_words(const iwc_message_t *state, const char *path, const char *name, const char *const *words,
                        FILE *out) {
    write_head(out, name, "stateset", path);
    for (; *words != NULL; words++) {
        (void)fprintf(out, "%s{%s=\"%s\"} %d\n", name, name, *words, iwc_is(state, path, *words) ? 1 : 0);
    }
}

/// Returns the next integer of a list, or -1 at its end.
static int64_t next_in_list(const char **at, const char *end) {
    while (*at < end && (**at < '0' || **at > '9')) {
        (*at)++;
    }
    if (*at >= end) {
        return -1;
    }
    int64_t value = 0;
    for (; *at < end && **at >= '0' && **at <= '9' && value < INT64_MAX / 16; (*at)++) {
        value = value * 10 + (**at - '0');
    }
    return value;
}

static void write_gaps(const iwc_message_t *state, FILE *out) {
    static const char name[] = "iwheel_setpoint_gap_seconds";
    size_t limits_length = 0;
    size_t counts_length = 0;
    uint64_t sum = 0;
    const char *limits = iwc_json(state, "gaps.limits_ms", &limits_length);
    const char *counts = iwc_json(state, "gaps.count", &counts_length);
    if (limits == NULL || counts == NULL) {
        return;
    }
    const char *const limits_end = limits + limits_length;
    const char *const counts_end = counts + counts_length;
    write_head(out, name, "histogram", "Between setpoint pairs, while they are sent");
    for (int64_t count = next_in_list(&counts, counts_end); count >= 0; count = next_in_list(&counts, counts_end)) {
        const int64_t limit = next_in_list(&limits, limits_end);
        sum += (uint64_t)count;
        if (limit >= 0) {
            (void)fprintf(out, "%s_bucket{le=\"%" PRId64 ".%03" PRId64 "\"} %" PRIu64 "\n", name, limit / 1000,
                          limit % 1000, sum);
        }
    }
    (void)fprintf(out, "%s_bucket{le=\"+Inf\"} %" PRIu64 "\n", name, sum);
}

static void write_own(const web_own_t *own, FILE *out) {
    const struct {
        const char *name;
        const char *help;
        uint64_t value;
        bool is_counter;
    } rows[] = {
        {"iwheel_web_watchers", "Event streams that are open", own->watchers, false},
        {"iwheel_web_refused", "Requests refused", own->refused, true},
        {"iwheel_web_dropped_commands", "Drive commands that were too old, doubled or of another page", own->dropped,
         true},
        {"iwheel_web_gateway_connections", "Connections made to the gateway", own->connections, true},
        {"iwheel_web_crowded_out", "Connections closed for newer ones", own->crowded_out, true},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        write_head(out, rows[i].name, rows[i].is_counter ? "counter" : "gauge", rows[i].help);
        (void)fprintf(out, "%s%s %" PRIu64 "\n", rows[i].name, rows[i].is_counter ? "_total" : "", rows[i].value);
    }
}

static void write_state(const iwc_message_t *state, FILE *out) {
    static const char *const states[] = {"listening", "armed", "stopping", "latched", NULL};
    static const char *const lines[] = {"released", "pressed", "unreadable", "disagrees", "none", NULL};
    static const char *const contacts[] = {"neither", "line", "line2", "both", NULL};
    static const char *const buses[] = {"down", "bus_off", "passive", "active", NULL};
    write_words(state, "state", "iwheel_state", states, out);
    write_words(state, "estop.state", "iwheel_estop", lines, out);
    write_words(state, "estop.pressed_at", "iwheel_estop_pressed_at", contacts, out);
    write_words(state, "bus.state", "iwheel_bus", buses, out);
    for (size_t i = 0; i < sizeof figures / sizeof figures[0]; i++) {
        write_figure(state, &figures[i], false, out);
    }
    for (size_t i = 0; i < sizeof wheel_figures / sizeof wheel_figures[0]; i++) {
        write_figure(state, &wheel_figures[i], true, out);
    }
    write_gaps(state, out);
}

/// Writes every cause from the start, so that the first stop is an increase.
static void write_stops(const web_tally_t *stops, FILE *out) {
    static const char name[] = "iwheel_stops";
    write_head(out, name, "counter",
               "Stops by cause since the start of iwheel-web; unknown: it was not connected then");
    for (unsigned cause = IW_CAUSE_NONE; cause < IW_CAUSES; cause++) {
        (void)fprintf(out, "%s_total{cause=\"%s\"} %" PRIu64 "\n", name,
                      (cause == IW_CAUSE_NONE) ? "unknown" : iwn_cause_name((iw_cause_t)cause), stops->by_cause[cause]);
    }
    write_head(out, "iwheel_last_stop_number", "gauge",
               "Of the last stop, as the gateway counts; 0: none since its start");
    if (stops->begun) {
        (void)fprintf(out, "iwheel_last_stop_number %" PRId64 "\n", stops->number);
    }
    write_head(out, "iwheel_last_stop_timestamp_seconds", "gauge", "When the last stop was seen");
    if (stops->wall_us > 0) {
        (void)fputs("iwheel_last_stop_timestamp_seconds", out);
        write_value(out, stops->wall_us, 6);
    }
}

void web_metrics_write(const iwc_message_t *state, const web_own_t *own, const web_tally_t *stops, FILE *out) {
    write_head(out, "iwheel_build_info", "gauge", "1, with the version of iwheel-web");
    (void)fprintf(out, "iwheel_build_info{version=\"%s\"} 1\n", IWHEEL_VERSION);

    write_head(out, "iwheel_up", "gauge", "1: the gateway reports its state");
    (void)fprintf(out, "iwheel_up %d\n", (state != NULL) ? 1 : 0);
    if (state != NULL) {
        write_state(state, out);
    }
    write_stops(stops, out);
    write_own(own, out);
    (void)fputs("# EOF\n", out);
}
