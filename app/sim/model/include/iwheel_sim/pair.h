// SPDX-License-Identifier: MIT
/// A pair of simulated iWheels: frames in, frames out.
///
/// Pure and deterministic: no I/O, no clock, no heap, no floating point. Time is an argument, and random numbers come
/// from the seed: the same configuration, seed, frames and times result in the same bytes, independent of the number of
/// calls of `sim_pair_step` in between. One instance belongs to one thread; it may be copied. To read speed or position at an instant,
/// advance a copy of `wheel[side].motion`.
///
///     sim_pair_init(&pair, NULL, now_us, seed);
///     while (sim_pair_step(&pair, now_us, &sent)) { put sent.frame on the bus; }
///     for each frame that was on the bus, the pair's own frames too: sim_pair_receive(&pair, now_us, &frame);
///     sleep until sim_pair_next_us(&pair) or the next frame
///
/// The pair receives its own frames because the right wheel needs the speed of the left wheel for the pose.
///
/// The functions below and the documented fault fields of `wheel[side]` set faults, and clear them the same way. Times
/// must not go back.
#ifndef IWHEEL_SIM_PAIR_H
#define IWHEEL_SIM_PAIR_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"
#include "iwheel_sim/sim_wheel.h"

typedef struct {
    sim_wheel_config_t wheel[IW_SIDES];
    uint64_t age_us;         ///< 0: power comes at init and the wheels boot. Otherwise the time since their start.
    uint16_t track_mm;       ///< Distance between the wheels; not 0.
    uint8_t battery_dV;      ///< Voltage without load; it sags by 1 dV for each 500 mA drawn.
    bool mirrored[IW_SIDES]; ///< The wheel is mounted so that its positive speed goes backwards. Only the pose uses it.
} sim_pair_config_t;

typedef struct {
    sim_wheel_t wheel[IW_SIDES];
    sim_pose_t pose;
    uint8_t battery_dV;
    bool power;
    bool pose_reversed; ///< Fault: the pose has the least significant byte first.
    bool padded;        ///< Fault: all telemetry frames have 8 bytes, with zeros after the bytes of the table.
} sim_pair_t;

/// A telemetry frame and the time at which it was due.
typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t due_us;
    iw_side_t side;
} sim_sent_t;

/// Sets two healthy wheels as documented: left cN, right dN, boot 400 and 430 ms, sensor zeros 12.3 and 9.8 N, track
/// 540 mm, 24.8 V.
void sim_pair_default(sim_pair_config_t *out_config);

/// Initialises the pair. `config` may be NULL: then the values of sim_pair_default are used.
void sim_pair_init(sim_pair_t *self, const sim_pair_config_t *config, iw_time_us_t now_us, uint64_t seed);

/// Returns true and writes the oldest frame that is due by `now_us` to `*out_sent`; returns false if there is none.
/// Call it until it returns false.
bool sim_pair_step(sim_pair_t *self, iw_time_us_t now_us, sim_sent_t *out_sent);

/// Returns the time of the next action of `sim_pair_step`; IW_NEVER without power.
iw_time_us_t sim_pair_next_us(const sim_pair_t *self);

/// Passes a frame that was on the bus to the wheels. Before the call, `sim_pair_step` must have returned all frames that
/// are due before `now_us`. Frames without a meaning for the wheels are ignored: other ids, remote, extended, FD, error,
/// too short.
void sim_pair_receive(sim_pair_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);

/// Returns true if a running wheel can acknowledge frames.
bool sim_pair_acknowledges(const sim_pair_t *self);

/// Switches the power of both wheels off (they coast), or on (they boot, and their ticks start at 0).
void sim_pair_power(sim_pair_t *self, iw_time_us_t now_us, bool on);

/// Starts the firmware of one wheel again: no telemetry for its boot time, ticks 0, the offset is learned again. Does
/// nothing without power.
void sim_pair_reboot(sim_pair_t *self, iw_time_us_t now_us, iw_side_t side);

/// Returns the supply voltage that the wheels measure now.
uint8_t sim_pair_battery_dV(const sim_pair_t *self);

#endif
