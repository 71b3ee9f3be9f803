// SPDX-License-Identifier: MIT
#include "iwheel_northbound/contents.h"

#include "contents_force.h"

void iwn_write_age(const char *name, iw_time_us_t now_us, iw_time_us_t then_us, iwn_out_t *json) {
    const bool known = then_us != IW_NEVER && then_us <= now_us;
    iwn_out_known(json, name, known, known ? (int64_t)((now_us - then_us) / IW_US_PER_MS) : 0);
}

static bool is_fresh(iw_time_us_t now_us, iw_time_us_t then_us) {
    return then_us != IW_NEVER && now_us - then_us < IWN_STATUS_STALE_US;
}

static bool contradicted(const iw_snapshot_t *seen, iw_assumption_item_t item) {
    return seen->assumed[item].state == IW_CONTRADICTED;
}

/// Returns true if distances are valid: they depend on radius and gear ratio.
static bool is_distance_known(const iw_snapshot_t *seen) {
    return !contradicted(seen, IW_ASSUMPTION_WHEEL_RADIUS) && !contradicted(seen, IW_ASSUMPTION_GEAR_RATIO);
}

static void write_motion(const iw_snapshot_t *seen, iw_side_t side, iwn_out_t *json) {
    const iw_snapshot_wheel_t *wheel = &seen->wheel[side];
    const bool online = wheel->heard;
    const bool following = seen->demand == IW_DEMAND_FOLLOW;
    const bool sending = seen->demand != IW_DEMAND_SILENCE;
    const iw_command_t applied = seen->applied.wheel[side];
    const iw_command_t wanted = seen->target.wheel[side];
    iwn_out_bool(json, "heard", online);
    if (online) {
        iwn_out_bool(json, "at_rest", wheel->at_rest);
    } else {
        iwn_out_null(json, "at_rest");
    }
    iwn_out_known32(json, "speed_rpm", online, wheel->telemetry->speed.speed_rpm);
    iwn_out_known32(json, "speed_mm_s", online && iwn_is_speed_known(seen), wheel->speed_mm_s);
    iwn_out_known32(json, "acceleration_raw", online, wheel->telemetry->speed.acceleration_raw);
    iwn_out_known32(json, "commanded_mm_s", following, wanted.speed_mm_s);
    iwn_out_known32(json, "commanded_mA", following, wanted.current_mA);
    iwn_out_known32(json, "applied_mm_s", sending, applied.speed_mm_s);
    iwn_out_known32(json, "applied_mA", sending, applied.current_mA);
    iwn_write_age("speed_age_ms", seen->at_us, wheel->speed_us, json);
}

/// Divides without sign: a microcontroller has no 64-bit division, and the signed one of its library is large.
static int64_t mm_of_nm(int64_t nm) {
    const uint64_t mm = ((nm < 0) ? 0U - (uint64_t)nm : (uint64_t)nm) / 1000000U;
    return (nm < 0) ? -(int64_t)mm : (int64_t)mm;
}

static void write_condition(const iw_snapshot_t *seen, iw_side_t side, iwn_out_t *json) {
    const iw_snapshot_wheel_t *wheel = &seen->wheel[side];
    const iw_codec_status_t *status = &wheel->telemetry->status;
    const iw_force_validity_t force = iw_snapshot_force_validity(seen, side);
    const bool ever = wheel->status_us != IW_NEVER;
    const bool fresh = is_fresh(seen->at_us, wheel->status_us);
    const bool warm = fresh && status->temperature_degC <= IW_TEMPERATURE_MAX_degC;
    const bool cpu = fresh && status->cpu_percent <= 100U;
    iwn_out_known32(json, "battery_dV", fresh, status->battery_dV);
    iwn_out_known32(json, "temperature_degC", warm, status->temperature_degC);
    iwn_out_known32(json, "cpu_percent", cpu, status->cpu_percent);
    iwn_out_known(json, "ticks", ever, wheel->ticks);
    iwn_out_known(json, "distance_mm", ever && is_distance_known(seen), mm_of_nm(wheel->ticks * wheel->nm_per_tick));
    iwn_write_age("status_age_ms", seen->at_us, wheel->status_us, json);
    iwn_out_int(json, "reboots", wheel->reboots);
    iwn_out_open(json, "valid", '{');
    iwn_out_bool(json, "speed", wheel->heard);
    iwn_out_bool(json, "status", fresh);
    iwn_out_bool(json, "temperature", warm);
    iwn_out_bool(json, "cpu", cpu);
    iwn_out_bool(json, "force", force == IW_FORCE_VALID);
    iwn_out_close(json, '}');
    iwn_out_open(json, "saturated", '{');
    iwn_out_bool(json, "battery", fresh && status->battery_dV == IW_BATTERY_SATURATED_dV);
    iwn_out_bool(json, "force", force == IW_FORCE_SATURATED);
    iwn_out_close(json, '}');
}

static void write_wheel(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iw_side_t side, iwn_out_t *json) {
    iwn_out_open(json, (side == IW_LEFT) ? "left" : "right", '{');
    write_motion(seen, side, json);
    write_condition(seen, side, json);
    iwn_write_wheel_force(seen, around, side, false, json);
    iwn_out_close(json, '}');
}

static bool at_limit(int16_t value) {
    return value == INT16_MIN || value == INT16_MAX;
}

static void write_pose(const iw_snapshot_t *seen, iwn_out_t *json) {
    const iw_codec_pose_t *pose = &seen->wheel[IW_RIGHT].telemetry->pose;
    const bool fresh = is_fresh(seen->at_us, seen->pose_us) && !contradicted(seen, IW_ASSUMPTION_POSE_BYTE_ORDER);
    iwn_out_open(json, "pose", '{');
    iwn_out_known32(json, "x_mm", fresh, pose->x_mm);
    iwn_out_known32(json, "y_mm", fresh, pose->y_mm);
    iwn_out_known32(json, "z_mm", fresh, pose->z_mm);
    iwn_out_known32(json, "psi_mrad", fresh, pose->psi_mrad);
    iwn_out_bool(json, "limited", fresh && (at_limit(pose->x_mm) || at_limit(pose->y_mm) || at_limit(pose->z_mm)));
    iwn_write_age("age_ms", seen->at_us, seen->pose_us, json);
    iwn_out_close(json, '}');
}

static bool has_text(const char *text) {
    return text != NULL && text[0] != '\0';
}

static void write_lease(const iw_snapshot_t *seen, const iwn_holder_t *holder, iwn_out_t *json) {
    const bool held = holder->client != IW_CLIENT_NONE;
    const bool running = held && !seen->arming && seen->lease_until_us > seen->at_us;
    iwn_out_open(json, "lease", '{');
    iwn_out_known(json, "holder", held, holder->client);
    iwn_out_text(json, "name", (held && has_text(holder->name)) ? holder->name : NULL);
    iwn_out_known32(json, "pid", held && holder->pid > 0, holder->pid);
    iwn_out_known(json, "remaining_ms", running,
                  running ? (int64_t)((seen->lease_until_us - seen->at_us) / IW_US_PER_MS) : 0);
    iwn_out_int(json, "lease_ms", seen->config->lease_ms);
    iwn_out_close(json, '}');
}

static void write_bus(const iw_snapshot_t *seen, const iwn_bus_t *bus, iwn_out_t *json) {
    iwn_out_open(json, "bus", '{');
    iwn_out_text(json, "name", bus->name);
    iwn_out_text(json, "state", iwn_bus_state_name(seen->bus));
    iwn_out_text(json, "timing", bus->timing);
    iwn_out_text(json, "echo", seen->echo_proven ? "proven" : "unproven");
    iwn_out_known(json, "bitrate", bus->bitrate_hz != 0U, bus->bitrate_hz);
    iwn_out_known(json, "sample_point_permille", bus->sample_point_permille != 0U, bus->sample_point_permille);
    iwn_out_known(json, "load_permille", bus->up, bus->load_permille);
    iwn_out_known(json, "lost_frames", bus->up, bus->lost);
    iwn_out_close(json, '}');
}

static void write_estop(const iwn_estop_t *estop, iwn_out_t *json) {
    iwn_out_open(json, "estop", '{');
    iwn_out_text(json, "line", estop->line);
    iwn_out_text(json, "state", iwn_estop_name(estop->answer, estop->present));
    if (estop->line2 != NULL) {
        iwn_out_text(json, "line2", estop->line2);
        iwn_out_text(json, "pressed_at", estop->pressed_at);
    }
    iwn_out_bool(json, "simulated", estop->simulated);
    iwn_out_known(json, "tried_wall_us", estop->tried_us > 0, estop->tried_us);
    iwn_out_close(json, '}');
}

static void write_causes(const char *name, uint32_t causes, iwn_out_t *json) {
    iwn_out_open(json, name, '[');
    for (unsigned cause = 0; cause < IW_CAUSES; cause++) {
        if ((causes & (1U << cause)) != 0U) {
            iwn_out_text(json, NULL, iwn_cause_name((iw_cause_t)cause));
        }
    }
    iwn_out_close(json, ']');
}

void iwn_write_machine(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json) {
    const bool stopped = seen->state == IW_STATE_STOPPING || seen->state == IW_STATE_LATCHED;
    iwn_out_int(json, "t_us", (int64_t)seen->at_us);
    iwn_out_known(json, "wall_us", around->wall_us != IWN_WALL_UNKNOWN, around->wall_us);
    iwn_out_text(json, "version", around->version);
    iwn_out_text(json, "state", iwn_state_name(seen->state));
    iwn_out_bool(json, "arming", seen->arming);
    iwn_out_text(json, "cause", stopped ? iwn_cause_name(seen->stop->first) : NULL);
    write_causes("present", seen->present, json);
    write_lease(seen, &around->holder, json);
    write_bus(seen, &around->bus, json);
    write_estop(&around->estop, json);
    write_wheel(seen, around, IW_LEFT, json);
    write_wheel(seen, around, IW_RIGHT, json);
    write_pose(seen, json);
}

static void write_budget(const iw_snapshot_t *seen, iwn_out_t *json) {
    const iw_stop_budget_t budget = iw_config_stop_budget(seen->config);
    iwn_out_open(json, "budget", '{');
    IWN_OUT_NUMBERS(json, "client_lost_ms\0client_lost_mm\0killed_ms\0killed_mm\0", budget.client_lost_ms,
                    budget.client_lost_mm, budget.killed_ms, budget.killed_mm);
    iwn_out_close(json, '}');
}

static void write_pair(const iw_snapshot_t *seen, iwn_out_t *json) {
    iwn_out_open(json, "pair", '{');
    iwn_out_int(json, "deviation_mm", seen->pair_mm);
    iwn_out_int(json, "largest_mm", seen->pair_largest_mm);
    iwn_out_int(json, "limit_mm", seen->config->pair_mm);
    iwn_out_close(json, '}');
}

static void write_counters(const iw_snapshot_t *seen, iwn_out_t *json) {
    const iw_counters_t *counters = seen->counters;
    const iw_sent_t *sent = seen->sent;
    iwn_out_open(json, "counters", '{');
    IWN_OUT_NUMBERS(
        json,
        "received\0echoes\0bad_format\0bad_length\0unknown\0foreign\0late_steps\0out_of_range\0purges\0left_behind\0"
        "pairs\0send_later\0clamped\0gate_stopped\0stray_echoes\0gap_max_us\0still_moving\0",
        counters->received, counters->echoes, counters->bad_format, counters->bad_length, counters->unknown,
        counters->foreign, counters->late_steps, counters->out_of_range, counters->purges, counters->left_behind,
        sent->pairs, sent->later, sent->clamped, seen->stopped, seen->stray_echoes, sent->gap_max_us,
        seen->still_moving);
    iwn_out_close(json, '}');
}

void iwn_write_warnings(const iwn_surroundings_t *around, iwn_out_t *json) {
    iwn_out_open(json, "warnings", '[');
    for (uint32_t i = 0; i < around->warnings; i++) {
        iwn_out_text(json, NULL, around->warning[i]);
    }
    iwn_out_close(json, ']');
}

void iwn_write_rest(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json) {
    write_budget(seen, json);
    write_pair(seen, json);
    write_counters(seen, json);
    iwn_out_int(json, "clients", around->clients);
    iwn_out_bool(json, "holding", seen->holding);
    iwn_out_bool(json, "rolling", seen->rolling);
    iwn_out_bool(json, "listen_only", seen->config->listen_only);
    iwn_out_bool(json, "shutting_down", around->shutting_down);
    iwn_write_warnings(around, json);
}

void iwn_write_stop(const iwn_stop_note_t *note, iw_time_us_t now_us, iwn_out_t *json) {
    const iw_stop_t *stop = &note->stop;
    const bool any = stop->number > 0U;
    iwn_out_int(json, "number", stop->number);
    iwn_out_text(json, "cause", any ? iwn_cause_name(stop->cause) : NULL);
    iwn_out_text(json, "side", any ? iwn_sides_name(stop->sides) : NULL);
    iwn_out_known(json, "detail", any, stop->detail);
    iwn_out_text(json, "from", any ? iwn_state_name(stop->from) : NULL);
    iwn_out_bool(json, "latched", any && stop->latched);
    iwn_out_known(json, "client", stop->client != IW_CLIENT_NONE, stop->client);
    iwn_out_text(json, "client_name", has_text(note->client_name) ? note->client_name : NULL);
    iwn_out_known32(json, "applied_left_mm_s", any, stop->applied.wheel[IW_LEFT].speed_mm_s);
    iwn_out_known32(json, "applied_right_mm_s", any, stop->applied.wheel[IW_RIGHT].speed_mm_s);
    iwn_out_known(json, "at_us", any, (int64_t)stop->at_us);
    iwn_out_known(json, "wall_us", any && note->wall_us != IWN_WALL_UNKNOWN, note->wall_us);
    iwn_write_age("age_ms", now_us, any ? stop->at_us : IW_NEVER, json);
    iwn_out_text(json, "sentence", note->sentence);
}
