// SPDX-License-Identifier: MIT
// Commands that concern the wheels.
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

/// A speed belongs to `on` only.
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

/// On the spot: each wheel rolls along a circle as wide as the track; 355 / 113 is pi.
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

#define SIDE  "left|right|both"
#define SIDES .kind = SIM_SIDES
#define FORCE MILLI(-4000000, 4000000)
#define RAW   .kind = SIM_WHOLE, .range = {INT16_MIN, INT16_MAX}, .also = "auto", .value = SIM_FORCE_AUTO
#define TYPE  .kind = SIM_WHOLE, .range = {0, 255}, .also = "any", .value = SIM_TYPE_ANY
#define SHARE MILLI(0, 100000)
#define MORE  .kind = SIM_WHOLE, .range = {1, 3000}, .optional = true
#define PER   .kind = SIM_WHOLE, .range = {1, 1000}, .optional = true, .value = 1

const sim_command_t sim_wheel_commands[] = {
    {ONCE("power", "on|off", "both wheels; off: silent, nobody acknowledges, they coast", set_power, {ON_OFF})},
    {EACH("reboot", SIDE, "firmware starts anew: silent 0.4 s, ticks 0, offsets again", reboot, {SIDES}),
     .run = needs_power},
    {EACH("mute", SIDE, "no telemetry; setpoints are still followed", set_muted, {SIDES})},
    {EACH("unmute", SIDE, "telemetry again", set_muted, {SIDES})},
    {EACH("block", SIDE, "the wheel cannot turn", set_blocked, {SIDES})},
    {EACH("unblock", SIDE, "it can again", set_blocked, {SIDES})},
    {EACH("runaway", SIDE " on|off [MM_S]", "faster than told by MM_S (1000)", set_runaway, {SIDES}, {ON_OFF}, {MORE}),
     .run = check_runaway},
    {EACH("free", SIDE " on|off", "the motor has no hold of the wheel: it coasts whatever it is told", set_free,
          {SIDES}, {ON_OFF})},
    {EACH("droop", SIDE " PERCENT", "stays so much below its setpoint, 0..100", set_droop, {SIDES}, {SHARE})},
    {EACH("kerb", SIDE " PERCENT", "a kerb takes so much of its speed, 0..100, until 0", set_kerb, {SIDES}, {SHARE})},
    {EACH("late", SIDE " MS", "obeys each setpoint so much later, 0..400", set_late, {SIDES}, {WHOLE(0, 400)})},
    {EACH("lag", SIDE " MS", "time constant of its speed controller, 1..1000 (60)", set_lag, {SIDES},
          {WHOLE(1, 1000)})},
    {EACH("slope", "PERCENT", "gravity along the way, forwards; -50..50", set_slope, {MILLI(-50000, 50000)})},
    {EACH("yaw", "PERCENT", "share of one wheel's motor that turns the other, -90..90 (0)", set_yaw,
          {MILLI(-90000, 90000)})},
    {EACH("rounding", SIDE " chance|truncated", "how rpm become whole numbers", set_rounding, {SIDES},
          {CHOICE("truncated", "chance")})},
    {EACH("sign", SIDE " normal|swapped", "sign of rpm and ticks", set_sign, {SIDES}, {CHOICE("swapped", "normal")})},
    {EACH("load", SIDE " NEWTON", "force on the shaft, sways 5 %; -4000..4000", set_load, {SIDES}, {FORCE})},
    {EACH("unit", SIDE " cN|dN", "unit of the force frame; document: left cN, right dN", set_unit, {SIDES},
          {CHOICE("cN", "dN")})},
    {EACH("removed", SIDE " on|off", "the force frame has the sensor's zero taken out", set_removed, {SIDES},
          {ON_OFF})},
    {EACH("zero", SIDE " NEWTON", "the sensor's zero; learnt at the next reboot", set_zero, {SIDES}, {FORCE})},
    {EACH("raw", SIDE " VALUE|auto", "the force frame carries this; -32768..32767", set_raw, {SIDES}, {RAW})},
    {EACH("ticks", SIDE " N", "odometry jumps to N", set_ticks, {SIDES}, {WHOLE(INT32_MIN, INT32_MAX)})},
    {EACH("gear", SIDE " TURNS [PER]", "rotor turns in PER (1) wheel turns", set_gear, {SIDES}, {WHOLE(1, 1000)},
          {PER})},
    {EACH("rpm", SIDE " wheel|rotor", "whose rpm telemetry tells", set_rpm, {SIDES}, {CHOICE("rotor", "wheel")})},
    {EACH("radius", SIDE " MM", "the real one; the firmware believes 192", set_radius, {SIDES}, {WHOLE(20, 500)})},
    {EACH("push", SIDE " METRES", "a hand turns the wheel that far, in its own sense; -100..100", push, {SIDES},
          {MILLI(-100000, 100000)})},
    {EACH("turn", "TURNS", "hands turn the machine on the spot, to the left; -20..20", turn, {MILLI(-20000, 20000)})},
    {ONCE("track", "MM", "the real distance between the wheels, 50..5000 (540)", set_track, {WHOLE(50, 5000)})},
    {EACH("mirror", SIDE " on|off", "mounted mirrored; matters to pose and turn only", set_mirror, {SIDES}, {ON_OFF})},
    {ONCE("pose", "normal|reversed", "the pose comes least significant byte first", set_pose,
          {CHOICE("reversed", "normal")})},
    {ONCE("padding", "on|off", "all telemetry is 8 bytes long", set_padding, {ON_OFF})},
    {EACH("role", "limit|setpoint", "what the current beside the speed means", set_role,
          {CHOICE("setpoint", "limit")})},
    {EACH("type", "any|N", "setpoints of other types are ignored", set_type, {TYPE})},
    {ONCE("battery", "DECIVOLT", "supply without load, 0..255 (248)", set_battery, {WHOLE(0, 255)})},
    {EACH("ambient", "DEGC", "temperature around, -40..255 (28)", set_ambient, {WHOLE(-40, 255)})},
    {EACH("loss", "PERCENT", "of telemetry and setpoints is lost", set_loss, {MILLI(0, 100000)})},
    {EACH("slow", "FACTOR", "telemetry periods (not offset frames) times 0.1..1000", set_slow, {MILLI(100, 1000000)})},
    {.name = NULL},
};
