// SPDX-License-Identifier: MIT
/// One simulated wheel: motion, force sensor, supply, and telemetry at its documented periods.
///
///     OFF --power--> BOOTING --boot_us--> RUNNING --reboot--> BOOTING
///      ^                |                    |
///      +---- power off -+--------------------+
///
/// OFF and BOOTING: the wheel coasts; it sends, receives and acknowledges nothing. RUNNING begins with ticks 0. The
/// wheel sends offset frames for 60 s, or for the configured time. It sends the first one after the two seconds of
/// learning (choice of this model; the document has only the period). "Muted" stops telemetry only: the wheel still
/// follows and acknowledges setpoints.
///
/// Pure: no I/O, no clock, no heap. Used through pair.h; visible so that tests and tools can read it and set faults in
/// it.
#ifndef IWHEEL_SIM_WHEEL_H
#define IWHEEL_SIM_WHEEL_H

#include "iwheel_sim/force.h"
#include "iwheel_sim/motion.h"
#include "iwheel_sim/pose.h"

/// Time for which a wheel sends offset frames (document).
#define SIM_WHEEL_OFFSET_US 60000000U

typedef enum { SIM_WHEEL_OFF = 0, SIM_WHEEL_BOOTING, SIM_WHEEL_RUNNING } sim_wheel_state_t;

/// Telemetry frames, in the order in which frames that are due at the same instant are sent.
typedef enum {
    SIM_TELEMETRY_SPEED = 0,
    SIM_TELEMETRY_STATUS,
    SIM_TELEMETRY_POSE, ///< Sent by the right wheel only.
    SIM_TELEMETRY_FORCE,
    SIM_TELEMETRY_OFFSET,
    SIM_TELEMETRY_KINDS,
} sim_telemetry_t;

/// Maximum number of setpoints that a late wheel has received and not followed yet: 400 ms at the shortest period.
#define SIM_WHEEL_LATE_MAX 96U

typedef struct {
    iw_time_us_t at_us;
    iw_codec_setpoint_t setpoint;
} sim_late_t;

typedef struct {
    sim_motion_t motion;
    sim_force_t force;
    sim_random_t random;
    iw_time_us_t due_us[SIM_TELEMETRY_KINDS]; ///< Time of the next frame; IW_NEVER: not sent.
    iw_time_us_t next_us;                     ///< Earliest time in `due_us`, or the end of booting.
    iw_time_us_t learn_until_us;
    iw_time_us_t offset_until_us;
    iw_time_us_t offset_us; ///< Duration of the offset frames from RUNNING on; IW_NEVER: without end.
    iw_time_us_t phase_us;
    uint32_t boot_us;
    uint32_t sent[SIM_TELEMETRY_KINDS];
    uint32_t lost; ///< Frames and setpoints that the loss fault dropped.
    uint32_t boots;
    uint32_t slow_permille; ///< Factor for all periods except that of offset frames; 1000: as documented.
    uint16_t loss_permille; ///< Fault: share of telemetry and of setpoints that is lost.
    int32_t heat_mdegC;     ///< Temperature above ambient.
    int32_t ambient_degC;
    iw_side_t side;
    sim_wheel_state_t state;
    bool muted;       ///< Fault: no telemetry.
    bool truncates;   ///< Rpm are truncated; otherwise rounded at random, so that their mean is exact.
    uint32_t late_us; ///< Fault: delay of each setpoint; up to 400000.
    uint32_t late_first, late_count;
    sim_late_t late[SIM_WHEEL_LATE_MAX];
} sim_wheel_t;

typedef struct {
    sim_motion_config_t motion;
    int32_t sensor_zero_mN;
    uint32_t boot_us;
    iw_time_us_t offset_us; ///< Duration of offset frames; documented: SIM_WHEEL_OFFSET_US; IW_NEVER: without end.
    iw_force_unit_t unit;
} sim_wheel_config_t;

/// Initialises a wheel without power.
void sim_wheel_init(sim_wheel_t *self, const sim_wheel_config_t *config, iw_side_t side, uint64_t seed);

/// Switches the power on (the wheel boots) or off. The same value again changes nothing.
void sim_wheel_power(sim_wheel_t *self, iw_time_us_t now_us, bool on);

/// Starts the firmware again if the wheel has power.
void sim_wheel_reboot(sim_wheel_t *self, iw_time_us_t now_us);

/// Sets the state of a wheel that has been running for `age_us`: the boot is skipped; learning and offset frames may be
/// over.
void sim_wheel_age(sim_wheel_t *self, iw_time_us_t now_us, uint64_t age_us);

/// Sets a new factor for all periods except that of offset frames, 100..1000000 permille. (The period of offset frames
/// stays one second, because their end and return have a meaning.) The new period counts from the next frame of each kind.
void sim_wheel_slow(sim_wheel_t *self, uint32_t permille);

/// Accepts a setpoint for this wheel that was on the bus.
void sim_wheel_receive(sim_wheel_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint);

/// A message that a wheel sends; `values` has its values.
typedef struct {
    iw_codec_kind_t kind;
    iw_codec_wheel_t values;
} sim_message_t;

/// Performs the action that is due at `self->next_us`. The caller has checked that it is due. Returns true
/// with a telemetry frame in `*out_message`, or false if there is none to send. `battery_dV` is the voltage that the
/// wheel measures, `pose` is the pose of the pair.
bool sim_wheel_step(sim_wheel_t *self, uint8_t battery_dV, sim_pose_t *pose, sim_message_t *out_message);

#endif
