// SPDX-License-Identifier: MIT
// Commands for the wheels.
#include "sim_command.h"

#define RUNAWAY_DEFAULT_MM_S 1000

typedef const char *result_t;

static result_t set_power(const sim_call_t *call) {
    sim_world_power(call->world, call->now_us, call->value[0] != 0);
    return NULL;
}

static result_t needs_power(const sim_call_t *call) {
    return call->world->pair.power ? NULL : "the wheels have no power; first: power on";
}

static void reboot(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_world_reboot(call->world, call->now_us, wheel->side);
}

static void set_muted(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->muted = call->words->word[0][0] == 'm';
}

static void set_blocked(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.blocked = call->words->word[0][0] == 'b';
}

static void set_free(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.freewheels = call->value[0] != 0;
}

static void set_droop(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.droop_permille = (uint16_t)(call->value[0] / 100);
}

static void set_kerb(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.kerb_permille = (uint16_t)(call->value[0] / 100);
}

static void set_late(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->late_us = (uint32_t)call->value[0] * 1000U;
}

static void set_lag(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.config.response_us = (uint32_t)call->value[0] * 1000U;
}

/// Standard gravity is 9807 mm/s2.
static void set_slope(const sim_call_t *call, sim_wheel_t *wheel) {
    const int32_t slope_mm_s2 = (int32_t)(call->value[0] * 9807 / 100000);
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.slope_mm_s2 = call->world->pair.pose.mirrored[wheel->side] ? -slope_mm_s2 : slope_mm_s2;
}

static void set_yaw(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.config.yaw_permille = (int16_t)(call->value[0] / 100);
}

static void set_rounding(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->truncates = call->value[0] != 0;
}

static void set_load(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->force.load_mN = (int32_t)call->value[0];
}

static void set_unit(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->force.unit = (call->value[0] != 0) ? IW_FORCE_CN : IW_FORCE_DN;
}

static void set_sign(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.swapped = call->value[0] != 0;
}

/// A speed is valid with `on` only.
static result_t check_runaway(const sim_call_t *call) {
    return (call->value[0] == 0 && call->value[1] != 0) ? SIM_USAGE : NULL;
}

static void set_runaway(const sim_call_t *call, sim_wheel_t *wheel) {
    const int64_t more = (call->value[1] != 0) ? call->value[1] : RUNAWAY_DEFAULT_MM_S;
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.runaway_mm_s = (call->value[0] != 0) ? (int16_t)more : 0;
}

static void set_removed(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->force.zero_removed = call->value[0] != 0;
}

static void set_raw(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->force.forced_raw = (int32_t)call->value[0];
}

static void set_zero(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->force.sensor_zero_mN = (int32_t)call->value[0];
}

static void set_ticks(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->motion.ticks = (uint32_t)(uint64_t)call->value[0];
}

static void push(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_push(&wheel->motion, call->now_us, (int32_t)call->value[0]);
}

/// Turns the machine on the spot: each wheel rolls along a circle whose diameter is the track; 355 / 113 is pi.
static void turn(const sim_call_t *call, sim_wheel_t *wheel) {
    const sim_pose_t *pose = &call->world->pair.pose;
    const int32_t way_mm = (int32_t)(call->value[0] * 355 * pose->track_mm / 113000);
    const bool back = (wheel->side == IW_LEFT) != pose->mirrored[wheel->side];
    sim_motion_push(&wheel->motion, call->now_us, back ? -way_mm : way_mm);
}

static result_t set_track(const sim_call_t *call) {
    call->world->pair.pose.track_mm = (uint16_t)call->value[0];
    return NULL;
}

static void set_radius(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->motion.config.radius_mm = (uint16_t)call->value[0];
}

static void set_gear(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.tick_rest = 0;
    wheel->motion.config.gear_turns = (uint16_t)call->value[0];
    wheel->motion.config.gear_per = (uint16_t)call->value[1];
}

static void set_rpm(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->motion.config.rpm_of_rotor = call->value[0] != 0;
}

static void set_mirror(const sim_call_t *call, sim_wheel_t *wheel) {
    call->world->pair.pose.mirrored[wheel->side] = call->value[0] != 0;
}

static void set_role(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_motion_advance(&wheel->motion, call->now_us);
    wheel->motion.config.current_is_setpoint = call->value[0] != 0;
}

static result_t set_pose(const sim_call_t *call) {
    call->world->pair.pose_reversed = call->value[0] != 0;
    return NULL;
}

static result_t set_padding(const sim_call_t *call) {
    call->world->pair.padded = call->value[0] != 0;
    return NULL;
}

static void set_type(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->motion.config.accepted_type = (int16_t)call->value[0];
    if (call->value[0] != SIM_TYPE_ANY) {
        call->world->foreign.setpoint.type = (uint8_t)call->value[0];
    }
}

static void set_loss(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->loss_permille = (uint16_t)(call->value[0] / 100);
}

static void set_slow(const sim_call_t *call, sim_wheel_t *wheel) {
    sim_wheel_slow(wheel, (uint32_t)call->value[0]);
}

static result_t set_battery(const sim_call_t *call) {
    call->world->pair.battery_dV = (uint8_t)call->value[0];
    return NULL;
}

static void set_ambient(const sim_call_t *call, sim_wheel_t *wheel) {
    wheel->ambient_degC = (int32_t)call->value[0];
}

#define SIDES .kind = SIM_SIDES
#define FORCE MILLI(-4000000, 4000000)
#define RAW   .kind = SIM_WHOLE, .range = {INT16_MIN, INT16_MAX}, .also = "auto", .value = SIM_FORCE_AUTO
#define TYPE  .kind = SIM_WHOLE, .range = {0, 255}, .also = "any", .value = SIM_TYPE_ANY
#define SHARE MILLI(0, 100000)
#define MORE  .kind = SIM_WHOLE, .range = {1, 3000}, .optional = true
#define PER   .kind = SIM_WHOLE, .range = {1, 1000}, .optional = true, .value = 1

const sim_command_t sim_wheel_commands[] = {
    {ONCE("power", set_power, {ON_OFF})},
    {EACH("reboot", reboot, {SIDES}), .run = needs_power},
    {EACH("mute", set_muted, {SIDES})},
    {EACH("unmute", set_muted, {SIDES})},
    {EACH("block", set_blocked, {SIDES})},
    {EACH("unblock", set_blocked, {SIDES})},
    {EACH("runaway", set_runaway, {SIDES}, {ON_OFF}, {MORE}), .run = check_runaway},
    {EACH("free", set_free, {SIDES}, {ON_OFF})},
    {EACH("droop", set_droop, {SIDES}, {SHARE})},
    {EACH("kerb", set_kerb, {SIDES}, {SHARE})},
    {EACH("late", set_late, {SIDES}, {WHOLE(0, 400)})},
    {EACH("lag", set_lag, {SIDES}, {WHOLE(1, 1000)})},
    {EACH("slope", set_slope, {MILLI(-50000, 50000)})},
    {EACH("yaw", set_yaw, {MILLI(-90000, 90000)})},
    {EACH("rounding", set_rounding, {SIDES}, {CHOICE("truncated", "chance")})},
    {EACH("sign", set_sign, {SIDES}, {CHOICE("swapped", "normal")})},
    {EACH("load", set_load, {SIDES}, {FORCE})},
    {EACH("unit", set_unit, {SIDES}, {CHOICE("cN", "dN")})},
    {EACH("removed", set_removed, {SIDES}, {ON_OFF})},
    {EACH("zero", set_zero, {SIDES}, {FORCE})},
    {EACH("raw", set_raw, {SIDES}, {RAW})},
    {EACH("ticks", set_ticks, {SIDES}, {WHOLE(INT32_MIN, INT32_MAX)})},
    {EACH("gear", set_gear, {SIDES}, {WHOLE(1, 1000)}, {PER})},
    {EACH("rpm", set_rpm, {SIDES}, {CHOICE("rotor", "wheel")})},
    {EACH("radius", set_radius, {SIDES}, {WHOLE(20, 500)})},
    {EACH("push", push, {SIDES}, {MILLI(-100000, 100000)})},
    {EACH("turn", turn, {MILLI(-20000, 20000)})},
    {ONCE("track", set_track, {WHOLE(50, 5000)})},
    {EACH("mirror", set_mirror, {SIDES}, {ON_OFF})},
    {ONCE("pose", set_pose, {CHOICE("reversed", "normal")})},
    {ONCE("padding", set_padding, {ON_OFF})},
    {EACH("role", set_role, {CHOICE("setpoint", "limit")})},
    {EACH("type", set_type, {TYPE})},
    {ONCE("battery", set_battery, {WHOLE(0, 255)})},
    {EACH("ambient", set_ambient, {WHOLE(-40, 255)})},
    {EACH("loss", set_loss, {MILLI(0, 100000)})},
    {EACH("slow", set_slow, {MILLI(100, 1000000)})},
    {.name = NULL},
};
