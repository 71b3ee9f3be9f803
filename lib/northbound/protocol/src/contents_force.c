// SPDX-License-Identifier: MIT
// Forces, with source and quality of their offset.
#include "contents_force.h"

/// Source and quality of the offset.
typedef struct {
    const char *word;
    int64_t age_ms; ///< -1 if unknown.
    uint32_t samples;
    uint32_t deviation_mN;
    int32_t drift_mN;
    bool measured;     ///< The three members before are valid.
    bool judged;       ///< The next member is valid.
    bool contaminated; ///< Measured while the wheel turned, under load, or with a noisy sensor.
} zero_t;

static int64_t age_ms(iw_time_us_t now_us, int64_t wall_us, const iw_force_t *force, const iwn_zero_note_t *noted) {
    if (force->provenance == IW_OFFSET_NONE) {
        return -1;
    }
    if (force->offset_us != IW_NEVER) {
        return (int64_t)((now_us - force->offset_us) / IW_US_PER_MS);
    }
    const bool known = noted->wall_us > 0 && noted->wall_us <= wall_us;
    return known ? (int64_t)((uint64_t)(wall_us - noted->wall_us) / IW_US_PER_MS) : -1;
}

static zero_t describe_zero(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iw_side_t side) {
    const iw_force_t *force = seen->wheel[side].force;
    const iwn_zero_note_t *noted = &around->zero[side];
    const bool ours = force->provenance != IW_OFFSET_NONE && force->provenance != IW_OFFSET_WHEEL &&
                      (noted->from == IW_OFFSET_ESTIMATED || noted->from == IW_OFFSET_OPERATOR);
    const bool window = force->quality.window != IW_WINDOW_OPEN;
    const bool bad = window && force->quality.window != IW_WINDOW_GOOD;
    zero_t zero = {.word = iwn_offset_word(force->provenance, force->offset_us),
                   .age_ms = age_ms(seen->at_us, around->wall_us, force, noted),
                   .samples = force->quality.samples,
                   .deviation_mN = force->quality.deviation_mN,
                   .drift_mN = force->quality.drift_mN,
                   .measured = window,
                   .judged = bad,
                   .contaminated = bad};
    if (ours) {
        zero.samples = noted->samples;
        zero.deviation_mN = noted->deviation_mN;
        zero.drift_mN = noted->drift_mN;
        zero.measured = true;
        zero.judged = true;
        zero.contaminated = false;
    } else if (force->provenance == IW_OFFSET_WHEEL) { // Judged by the core: its first two seconds, or its rest now.
        const bool doubted = force->observation == IW_UNIT_UNCLEAR;
        zero.judged = doubted || force->observation != IW_UNIT_UNKNOWN || (force->boot_seen && window);
        zero.contaminated = doubted;
    }
    return zero;
}

static void write_known_bool(iwn_out_t *json, const char *name, bool known, bool value) {
    if (known) {
        iwn_out_bool(json, name, value);
    } else {
        iwn_out_null(json, name);
    }
}

static bool is_fresh(const iw_force_t *force, iw_time_us_t now_us) {
    return force->raw_us != IW_NEVER && now_us - force->raw_us < IW_FORCE_STALE_US;
}

void iwn_write_wheel_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iw_side_t side, bool alone,
                           iwn_out_t *json) {
    const size_t force_prefix = alone ? sizeof "force_" - 1U : 0U;
    const size_t zero_prefix = alone ? sizeof "offset_" - 1U : 0U;
    const iw_force_t *force = seen->wheel[side].force;
    const iw_force_validity_t validity = iw_snapshot_force_validity(seen, side);
    const bool fresh = is_fresh(force, seen->at_us);
    const iwn_zero_note_t *noted = &around->zero[side];
    const zero_t zero = describe_zero(seen, around, side);
    iwn_out_known32(json, &"force_raw"[force_prefix], fresh, force -> raw);
    iwn_out_known32(json, &"force_raw_mN"[force_prefix], fresh, iw_force_raw_mN(force));
    iwn_out_known32(json, &"force_offset_mN"[force_prefix], force -> provenance != IW_OFFSET_NONE, force -> offset_mN);
    iwn_out_known32(json, &"force_net_mN"[force_prefix], validity == IW_FORCE_VALID, iw_force_net_mN(force));
    iwn_out_text(json, &"force_validity"[force_prefix], iwn_force_validity_name(validity));
    if (alone) {
        iwn_out_bool(json, "saturated", validity == IW_FORCE_SATURATED);
    }
    iwn_write_age(&"force_age_ms"[force_prefix], seen -> at_us, force -> raw_us, json);
    iwn_out_text(json, &"offset_provenance"[zero_prefix], zero.word);
    if (!alone) {
        iwn_out_text(json, "offset_origin", (noted->from != IW_OFFSET_NONE) ? iwn_provenance_name(noted->from) : NULL);
    }
    iwn_out_known(json, "offset_age_ms", zero.age_ms >= 0, zero.age_ms);
    write_known_bool(json, &"offset_contaminated"[zero_prefix], zero.judged, zero.contaminated);
    if (!alone) {
        iwn_out_text(json, "offset_window", iwn_window_name(force->quality.window));
    }
    iwn_out_known(json, &"offset_samples"[zero_prefix], zero.measured, zero.samples);
    iwn_out_known(json, &"offset_deviation_mN"[zero_prefix], zero.measured, zero.deviation_mN);
    if (!alone) {
        iwn_out_known32(json, "offset_drift_mN", zero.measured, zero.drift_mN);
        iwn_out_known32(json, "wheel_offset_mN", force->wheel_offset_received, (int32_t)force->wheel_offset_dN * 100);
        iwn_out_text(json, "unit_evidence", iwn_unit_observation_name(force->observation));
    }
}

void iwn_write_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json) {
    iwn_out_int(json, "t_us", (int64_t)seen->at_us);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        iwn_out_open(json, (side == IW_LEFT) ? "left" : "right", '{');
        iwn_write_wheel_force(seen, around, (iw_side_t)side, true, json);
        iwn_out_close(json, '}');
    }
}
