// SPDX-License-Identifier: MIT
/// The core with arbitrary input, for Frama-C's Eva (`./check eva`): any configuration that `iw_config_check` accepts, then,
/// without end and in any order, steps and requests with any argument that their contracts allow, over a HAL whose functions
/// return anything and whose frames are any bytes.
///
/// Eva computes a superset of all values that every object can have at every statement of every such run. Undefined behaviour
/// that it cannot exclude is an alarm, and no alarm may stay: docs/developer/static.md.
#include "iwheel/bit_timing.h"
#include "iwheel/gateway.h"
#include "iwheel/observation.h"

#include <__fc_builtin.h>

#define GEAR_MAX 100U

static iw_gateway_t gateway;
static iw_observation_t observation;
static iw_time_us_t now_us;
static iw_estop_pair_t contacts;

static bool any_bool(void) {
    return Frama_C_interval(0, 1) != 0;
}

static uint32_t any_u32(void) {
    return Frama_C_unsigned_int_interval(0U, UINT32_MAX);
}

static int32_t any_i32(void) {
    return Frama_C_interval(INT32_MIN, INT32_MAX);
}

static uint8_t any_u8(void) {
    return (uint8_t)Frama_C_interval(0, UINT8_MAX);
}

static uint16_t any_u16(void) {
    return (uint16_t)Frama_C_interval(0, UINT16_MAX);
}

static uint16_t any_within(iw_config_fault_t field) {
    const iw_config_range_t range = iw_config_range(field);
    return (uint16_t)Frama_C_interval(range.min, range.max);
}

static iw_time_us_t any_time(void) {
    return Frama_C_unsigned_long_long_interval(0U, UINT64_MAX);
}

// ---- the HAL ----

static int send_frames(void *context, const iw_can_frame_t *frames, uint32_t count) {
    (void)context;
    uint32_t read = 0;
    for (uint32_t frame = 0; frame < count; frame++) {
        read += frames[frame].id + frames[frame].dlc + frames[frame].kind;
        for (size_t i = 0; i < IW_CAN_DATA_MAX; i++) {
            read += frames[frame].data[i];
        }
    }
    (void)read;
    return any_i32();
}

static int receive_frame(void *context, iw_can_frame_t *out_frame) {
    (void)context;
    out_frame->id = any_u32();
    out_frame->dlc = any_u8();
    out_frame->kind = any_u8();
    for (size_t i = 0; i < IW_CAN_DATA_MAX; i++) {
        out_frame->data[i] = any_u8();
    }
    return any_i32();
}

static iw_bus_state_t bus_state(void *context) {
    (void)context;
    return (iw_bus_state_t)Frama_C_interval(IW_BUS_DOWN, IW_BUS_ACTIVE);
}

static int purge(void *context) {
    (void)context;
    return any_i32();
}

static int estop_pressed(void *context) {
    (void)context;
    (void)iw_estop_pair_next_us(&contacts);
    return any_bool() ? iw_estop_pair_see(&contacts, now_us, any_i32(), any_i32()) : any_i32();
}

static const iw_hal_t hal = {send_frames, receive_frame, bus_state, purge, estop_pressed, NULL};

// ---- the configuration ----

/// The ratio is within 1..100. Eva does not relate two variables, so the classes of `gear_per` are analysed one by one, each with
/// the matching `gear_turns`.
static void any_gear(iw_config_t *out_config) {
    const iw_config_range_t per = iw_config_range(IW_CONFIG_GEAR_PER);
    const iw_config_range_t turns = iw_config_range(IW_CONFIG_GEAR_TURNS);
    uint32_t from = per.min;
    //@ loop unroll 100;
    while (from + from / 8U < per.max && any_bool()) {
        from += 1U + from / 8U;
    }
    const uint32_t to = from + from / 8U;
    const uint32_t most = GEAR_MAX * to;
    out_config->gear_per = (uint16_t)Frama_C_unsigned_int_interval(from, (to < per.max) ? to : per.max);
    out_config->gear_turns = (uint16_t)Frama_C_unsigned_int_interval(from, (most < turns.max) ? most : turns.max);
}

static void any_config(iw_config_t *out_config) {
    iw_config_default(out_config);
    out_config->period_ms = any_within(IW_CONFIG_PERIOD);
    out_config->lease_ms = any_within(IW_CONFIG_LEASE);
    out_config->accel_mm_s2 = any_within(IW_CONFIG_ACCEL);
    out_config->decel_mm_s2 = any_within(IW_CONFIG_DECEL);
    out_config->max_speed_mm_s = any_within(IW_CONFIG_MAX_SPEED);
    out_config->max_current_mA = any_within(IW_CONFIG_MAX_CURRENT);
    out_config->min_current_mA = any_within(IW_CONFIG_MIN_CURRENT);
    out_config->zero_hold_ms = any_within(IW_CONFIG_ZERO_HOLD);
    out_config->hold_max_s = any_within(IW_CONFIG_HOLD_MAX);
    out_config->wheel_silent_ms = any_within(IW_CONFIG_WHEEL_SILENT);
    out_config->echo_ms = any_within(IW_CONFIG_ECHO);
    out_config->rest_rpm = any_within(IW_CONFIG_REST_RPM);
    out_config->rest_ms = any_within(IW_CONFIG_REST);
    out_config->follow_mm_s = any_within(IW_CONFIG_FOLLOW_SPEED);
    out_config->follow_ms = any_within(IW_CONFIG_FOLLOW);
    out_config->blocked_ms = any_within(IW_CONFIG_BLOCKED);
    out_config->pair_mm = any_within(IW_CONFIG_PAIR);
    out_config->pair_leak_ms = any_within(IW_CONFIG_PAIR_LEAK);
    out_config->wheel_lag_ms = any_within(IW_CONFIG_WHEEL_LAG);
    out_config->max_yaw_mrad_s = any_within(IW_CONFIG_MAX_YAW);
    out_config->yaw_accel_mrad_s2 = any_within(IW_CONFIG_YAW_ACCEL);
    // 0: not set. Values between 0 and the range are not permitted, and must not cause undefined behaviour either.
    out_config->track_mm = (uint16_t)Frama_C_unsigned_int_interval(0U, iw_config_range(IW_CONFIG_TRACK).max);
    out_config->radius_mm = any_within(IW_CONFIG_RADIUS);
    any_gear(out_config);
    out_config->setpoint_dlc = any_within(IW_CONFIG_SETPOINT_DLC);
    out_config->setpoint_type = any_u8();
    out_config->setpoint_type_set = any_bool();
    out_config->rpm_of_rotor = any_bool();
    out_config->listen_only = any_bool();
    out_config->hold = any_bool();
    out_config->current_role = (iw_current_role_t)Frama_C_interval(IW_ROLE_UNSET, IW_ROLE_SETPOINT);
    for (size_t side = 0; side < IW_SIDES; side++) {
        out_config->invert[side] = any_bool();
        out_config->force_unit[side] = (iw_force_unit_t)Frama_C_interval(IW_FORCE_CN, IW_FORCE_DN);
    }
}

// ---- the world ----

static iw_time_us_t later(void) {
    return Frama_C_unsigned_long_long_interval(now_us, UINT64_MAX);
}

static void drive(bool has_current) {
    iw_drive_t request;
    iw_applied_t applied;
    for (size_t side = 0; side < IW_SIDES; side++) {
        request.speed_mm_s[side] = any_i32();
        request.current_mA[side] = any_i32();
    }
    request.has_current = has_current;
    (void)iw_gateway_drive(&gateway, any_time(), any_u32(), &request, &applied);
}

static void request(void) {
    iw_side_t refused;
    switch (Frama_C_interval(0, 9)) {
    case 0:
        (void)iw_gateway_arm(&gateway, now_us, any_u32(), any_bool());
        break;
    case 1:
        drive(any_bool() ? true : false);
        break;
    case 2:
        iw_gateway_stop(&gateway, now_us, any_u32(), any_bool() ? IW_CAUSE_CLIENT_STOP : IW_CAUSE_SHUTDOWN);
        break;
    case 3:
        iw_gateway_estop(&gateway, now_us, any_u32());
        break;
    case 4:
        (void)iw_gateway_reset(&gateway, now_us);
        break;
    case 5:
        iw_gateway_disconnect(&gateway, now_us, any_u32());
        break;
    case 6:
        (void)iw_gateway_tare(&gateway, now_us, (uint8_t)Frama_C_interval(IW_SIDES_NONE, IW_SIDES_BOTH), &refused);
        break;
    case 7:
        iw_gateway_suspended(&gateway, any_time());
        break;
    case 8:
        (void)iw_gateway_release(&gateway);
        break;
    default: {
        const iw_bus_facts_t facts = {any_bool(), any_bool()};
        iw_gateway_bus_facts(&gateway, &facts);
        break;
    }
    }
}

static void operate(iw_side_t side) {
    const iw_assumption_item_t item = (iw_assumption_item_t)Frama_C_interval(0, IW_ASSUMPTION_ITEMS - 1);
    const iw_source_t source = (iw_source_t)Frama_C_interval(IW_SOURCE_NONE, IW_SOURCE_OPERATOR);
    const iw_assumption_state_t state = (iw_assumption_state_t)Frama_C_interval(IW_ASSUMED, IW_CONTRADICTED);
    const iw_assumption_entry_t entry = {state, source, any_i32()};
    switch (Frama_C_interval(0, 4)) {
    case 0:
        iw_assumption_assume(&gateway.assumptions, item, source);
        break;
    case 1:
        iw_assumption_confirm(&gateway.assumptions, item, source, any_i32());
        break;
    case 2:
        iw_assumption_contradict(&gateway.assumptions, item, source, any_i32());
        break;
    case 3:
        iw_gateway_set_assumption(&gateway, item, &entry);
        break;
    default:
        iw_gateway_restore_offset(&gateway, side, any_bool() ? IW_OFFSET_STORED : IW_OFFSET_OPERATOR,
                                  Frama_C_interval(-IW_FORCE_OFFSET_MAX_mN, IW_FORCE_OFFSET_MAX_mN));
        break;
    }
}

/// Functions that a program calls to show the wheels.
static void observe(iw_side_t side) {
    iw_snapshot_t seen;
    (void)iw_force_validity(&gateway.force[side], now_us);
    (void)iw_force_raw_mN(&gateway.force[side]);
    (void)iw_force_net_mN(&gateway.force[side]);
    (void)iw_force_measure(&gateway.force[side]);
    (void)iw_gateway_state(&gateway);
    (void)iw_gateway_arming(&gateway);
    (void)iw_gateway_arm_refusal(&gateway);
    (void)iw_gateway_is_sending(&gateway);
    iw_gateway_snapshot(&gateway, now_us, &seen);
    (void)iw_snapshot_force_validity(&seen, side);
    iw_observation_step(&observation, &gateway, &seen);
    (void)iw_cause_latches((iw_cause_t)Frama_C_interval(IW_CAUSE_NONE, IW_CAUSES - 1));
    (void)iw_permit_present(&gateway.permit, now_us);
}

/// Functions outside the loop of a gateway: the codec's other direction, the bit timing.
static void calculate(void) {
    iw_codec_wheel_t messages[IW_SIDES];
    iw_can_frame_t frame;
    iw_bit_timing_t timing = {any_u16(), any_u16(), any_u16()};
    const iw_bit_timing_limits_t limits = {any_u16(), any_u16(), any_u16(), any_u16(), any_u16()};
    const iw_bit_timing_achieved_t wanted = {any_u32(), any_u16()};
    (void)iw_bit_timing_achieved(any_u32(), &timing);
    (void)iw_bit_timing_solve(&limits, any_u32(), &wanted, &timing);
    (void)iw_codec_find(any_u32());
    const iw_codec_kind_t kind = (iw_codec_kind_t)Frama_C_interval(IW_CODEC_SPEED, IW_CODEC_POSE);
    const iw_side_t side = (iw_side_t)Frama_C_interval(IW_LEFT, IW_RIGHT);
    Frama_C_make_unknown((char *)messages, sizeof messages);
    (void)iw_codec_name(kind);
    (void)iw_codec_encode(kind, side, &messages[side], &frame);
    (void)receive_frame(NULL, &frame);
    (void)iw_codec_decode(&frame, messages);
}

static void event(void) {
    now_us = later();
    switch (Frama_C_interval(0, 3)) {
    case 0:
        (void)iw_gateway_step(&gateway, now_us);
        break;
    case 1:
        request();
        break;
    case 2:
        operate(any_bool() ? IW_LEFT : IW_RIGHT);
        break;
    default:
        observe(any_bool() ? IW_LEFT : IW_RIGHT);
        break;
    }
}

/// Endless loop. States are joined here, after every event: see `-eva-slevel-function` in test/eva/run.
static void live(void) {
    //@ loop widen_hints HINTS;
    while (any_bool()) {
        event();
    }
}

int main(void) {
    iw_config_t config;
    calculate();
    any_config(&config);
    (void)iw_config_stop_budget(&config);
    now_us = any_time();
    iw_estop_pair_init(&contacts, any_u32());
    if (iw_gateway_init(&gateway, &config, &hal, now_us, any_bool()) != IW_CONFIG_OK) {
        return 1;
    }
    iw_observation_init(&observation);
    //@ slevel merge;
    live();
    return 0;
}
