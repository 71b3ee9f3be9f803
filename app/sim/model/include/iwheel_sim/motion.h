// SPDX-License-Identifier: MIT
/// Motion of one wheel: its last setpoint, the time for which the setpoint is valid, and the response of the wheel.
///
/// The wheel approaches a commanded speed as a first-order system with the time constant `response_us`, never faster
/// than the torque of the current allows: 2000 mA result in `accel_mm_s2`. Speeds are those of the wheel's firmware, which
/// assumes a radius of 192 mm. A wheel with another radius really moves faster or slower (`sim_motion_true_mm_s`).
///
/// Choices of this model where the document has no rule:
/// - 1 s after its last setpoint the wheel coasts: friction alone (`coast_mm_s2`) brings it to standstill.
/// - Current as a limit: 0 mA means no torque, and the wheel coasts.
/// - Current as a setpoint: with a speed, the absolute value of the current bounds the torque. Speed 0 with a current
///   is torque without a speed to hold, so the wheel runs. 0/0 coasts.
/// - The unit of the acceleration field is rpm/s.
/// - The controller holds the wheel on a slope as far as the torque suffices. A slope moves a wheel that coasts. The
///   droop is the loss of speed by a load.
/// - A kerb reduces the speed by a share for its whole duration, which includes the recovery of the wheel.
/// - The yaw inertia of the machine passes a share of one wheel's motor to the other wheel (pair.h). Straight driving
///   is the same as without it; turning is slower by (1 + share) / (1 - share).
///
/// Integers only. The owner advances the model to exact instants, so the result does not depend on how often it is
/// called.
#ifndef IWHEEL_SIM_MOTION_H
#define IWHEEL_SIM_MOTION_H

#include "iwheel/codec.h"
#include "iwheel_sim/random.h"

/// Value of `accepted_type`: the wheel accepts every setpoint type.
#define SIM_TYPE_ANY (-1)
/// Radius that the wheel's firmware assumes.
#define SIM_FIRMWARE_RADIUS_MM 192

typedef struct {
    uint32_t accel_mm_s2;  ///< Acceleration with 2000 mA.
    uint32_t coast_mm_s2;  ///< Deceleration by friction.
    uint32_t response_us;  ///< Time constant of the speed controller.
    uint16_t radius_mm;    ///< Real radius.
    uint16_t gear_turns;   ///< Turns of the rotor in `gear_per` turns of the wheel.
    uint16_t gear_per;     ///< Not 0.
    int16_t accepted_type; ///< 0..255: the wheel ignores other setpoint types; or SIM_TYPE_ANY.
    int16_t yaw_permille;  ///< Share of the other wheel's motor that reaches this one, -900..900; 0: not coupled.
    bool rpm_of_rotor;     ///< Telemetry reports the rpm of the rotor, not of the wheel.
    bool current_is_setpoint;
} sim_motion_config_t;

typedef struct {
    sim_motion_config_t config;
    iw_time_us_t now_us;      ///< Time to which the model has advanced.
    iw_time_us_t received_us; ///< Time of the last accepted setpoint; IW_NEVER: none.
    int64_t position_nm;      ///< Distance at the firmware's radius since the start of the simulation.
    int64_t tick_rest;        ///< Distance that is not counted as a tick yet.
    int64_t push_nm;          ///< Distance by hand that is left, at the firmware's radius; it overrides setpoints.
    int32_t speed_um_s;       ///< Speed at the firmware's radius, in the wheel's own sense of rotation.
    int32_t accel_mm_s2;
    int32_t motor_mm_s2;       ///< Acceleration by its own motor.
    int32_t other_motor_mm_s2; ///< `motor_mm_s2` of the other wheel; the pair writes it.
    int32_t slope_mm_s2;       ///< Gravity along the path of this wheel.
    uint32_t ticks;
    uint32_t setpoints; ///< Number of accepted setpoints.
    iw_codec_setpoint_t setpoint;
    int16_t runaway_mm_s;    ///< Fault: a driven wheel is faster than its setpoint by this; 0: no fault.
    uint16_t droop_permille; ///< Share of the setpoint that the settled wheel lacks; up to 1000.
    uint16_t kerb_permille;  ///< Share of the speed that is lost at a kerb; up to 1000.
    bool driven;             ///< The last setpoint is still valid.
    bool freewheels;         ///< Fault: the motor does not act on the wheel.
    bool blocked;            ///< Fault: the wheel cannot turn.
    bool swapped;            ///< Fault: rpm and ticks have the wrong sign.
} sim_motion_t;

/// Sets a wheel with about 1 kg at the shaft: 4000 mm/s2, friction 700 mm/s2, 60 ms, gear 1, current as a limit.
void sim_motion_default(sim_motion_config_t *out_config);

void sim_motion_init(sim_motion_t *self, const sim_motion_config_t *config, iw_time_us_t now_us);

/// Advances the model to `to_us`; an earlier time changes nothing.
void sim_motion_advance(sim_motion_t *self, iw_time_us_t to_us);

/// Accepts a setpoint at `now_us`. Returns false if the setpoint does not have the accepted type; then it is ignored.
bool sim_motion_receive(sim_motion_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint);

/// Ends the setpoint because the wheel loses power or its firmware starts again. The wheel coasts.
void sim_motion_release(sim_motion_t *self, iw_time_us_t now_us);

/// Turns the wheel by hand by `way_mm` at the real radius, in the wheel's own direction of rotation. The distance is added
/// to the distance that is left.
void sim_motion_push(sim_motion_t *self, iw_time_us_t now_us, int32_t way_mm);

/// Returns the speed in thousandths of rpm as telemetry reports it: of wheel or rotor, with the reported sign.
int64_t sim_motion_milli_rpm(const sim_motion_t *self);

/// Return speed and position at the real radius.
int32_t sim_motion_true_mm_s(const sim_motion_t *self);
int64_t sim_motion_true_mm(const sim_motion_t *self);

/// Returns the current that the motor draws.
uint32_t sim_motion_draw_mA(const sim_motion_t *self);

/// Returns the speed in um/s at the firmware's radius for a telemetry value in thousandths of rpm, of rotor or wheel.
int32_t sim_motion_um_s_of_milli_rpm(const sim_motion_config_t *config, int64_t milli_rpm);

#endif
