// SPDX-License-Identifier: MIT
/// One simulated wheel: motion, force sensor, supply, and the telemetry that is due, at its documented periods.
///
///     OFF --power--> BOOTING --boot_us--> RUNNING --reboot--> BOOTING
///      ^                |                    |
///      +---- power off -+--------------------+
///
/// OFF and BOOTING: silent, deaf, acknowledges nothing; the wheel coasts. RUNNING begins with ticks 0 and sends offset
/// frames for 60 s, or as long as configured. The first comes when the two seconds of learning are over (choice of this model; the document tells
/// only the period).
/// "Muted" silences telemetry only: setpoints are still followed and acknowledged.
///
/// Pure: no I/O, no clock, no heap. Used through pair.h; visible so that tests and tools can read it and plant faults
/// in it.
#ifndef IWHEEL_SIM_WHEEL_H
#define IWHEEL_SIM_WHEEL_H

#include "iwheel_sim/force.h"
#include "iwheel_sim/motion.h"
#include "iwheel_sim/pose.h"

/// A wheel sends offset frames this long (document).
#define SIM_WHEEL_OFFSET_US 60000000U

typedef enum { SIM_WHEEL_OFF = 0, SIM_WHEEL_BOOTING, SIM_WHEEL_RUNNING } sim_wheel_state_t;

/// The telemetry frames, in the order in which frames due at the same instant are sent.
typedef enum {
    SIM_TELEMETRY_SPEED = 0,
    SIM_TELEMETRY_STATUS,
    SIM_TELEMETRY_POSE, ///< Of the right wheel only.
    SIM_TELEMETRY_FORCE,
    SIM_TELEMETRY_OFFSET,
    SIM_TELEMETRY_KINDS,
} sim_telemetry_t;

/// Setpoints that a late wheel has received and not obeyed yet: 400 ms of them, at the shortest period.
#define SIM_WHEEL_LATE_MAX 96U

typedef struct {
    iw_time_us_t at_us;
    iw_codec_setpoint_t setpoint;
} sim_late_t;

typedef struct {
    sim_motion_t motion;
    sim_force_t force;
    sim_random_t random;
    iw_time_us_t due_us[SIM_TELEMETRY_KINDS]; ///< IW_NEVER: not sent.
    iw_time_us_t next_us;                     ///< The earliest of them, or the end of booting.
    iw_time_us_t learn_until_us;
    iw_time_us_t offset_until_us;
    iw_time_us_t offset_us; ///< From RUNNING on; IW_NEVER: they never stop.
    iw_time_us_t phase_us;
    uint32_t boot_us;
    uint32_t sent[SIM_TELEMETRY_KINDS];
    uint32_t lost; ///< Frames and setpoints that the loss fault swallowed.
    uint32_t boots;
    uint32_t slow_permille; ///< All periods but the offset frames' are multiplied by this; 1000: as documented.
    uint16_t loss_permille; ///< Fault: this share of telemetry and of setpoints is lost.
    int32_t heat_mdegC;     ///< Above ambient.
    int32_t ambient_degC;
    iw_side_t side;
    sim_wheel_state_t state;
    bool muted;       ///< Fault: no telemetry.
    bool truncates;   ///< The rpm are cut off; else rounded by chance, so that their mean is exact.
    uint32_t late_us; ///< Fault: each setpoint is obeyed so much later; up to 400000.
    uint32_t late_first, late_count;
    sim_late_t late[SIM_WHEEL_LATE_MAX];
} sim_wheel_t;

typedef struct {
    sim_motion_config_t motion;
    int32_t sensor_zero_mN;
    uint32_t boot_us;
    iw_time_us_t offset_us; ///< How long offset frames are sent; SIM_WHEEL_OFFSET_US as documented, IW_NEVER: for ever.
    iw_force_unit_t unit;
} sim_wheel_config_t;

/// A wheel without power.
void sim_wheel_init(sim_wheel_t *self, const sim_wheel_config_t *config, iw_side_t side, uint64_t seed);

/// Power comes (the wheel boots) or goes. The same again changes nothing.
void sim_wheel_power(sim_wheel_t *self, iw_time_us_t now_us, bool on);

/// The firmware starts anew, if there is power.
void sim_wheel_reboot(sim_wheel_t *self, iw_time_us_t now_us);

/// As if it had been running for `age_us` already: the boot is skipped, the offset is known, offset frames may be over.
void sim_wheel_age(sim_wheel_t *self, iw_time_us_t now_us, uint64_t age_us);

/// New factor for all periods but the offset frames' (one a second, whose end and return mean something), 100..1000000
/// permille. Takes effect with each frame's next turn.
void sim_wheel_slow(sim_wheel_t *self, uint32_t permille);

/// A setpoint for this wheel was on the bus.
void sim_wheel_receive(sim_wheel_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint);

/// A message that a wheel sends: `told` has its values.
typedef struct {
    iw_codec_kind_t kind;
    iw_codec_wheel_t told;
} sim_message_t;

/// Does what is due first, which must be due by now (`self->next_us`): true with a telemetry frame in `*out_message`,
/// or false if there is none to send. `battery_dV` is what the wheel measures, `pose` the pair's pose.
bool sim_wheel_step(sim_wheel_t *self, uint8_t battery_dV, sim_pose_t *pose, sim_message_t *out_message);

#endif
