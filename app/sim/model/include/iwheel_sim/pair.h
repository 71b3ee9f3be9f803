// SPDX-License-Identifier: MIT
/// A pair of simulated iWheels: frames in, frames out.
///
/// Pure and deterministic: no I/O, no clock, no heap, no floating point. Time is an argument, chance comes from the
/// seed: the same configuration, seed, frames and times give the same bytes, however often `sim_pair_step` is called in
/// between.
/// One instance belongs to one thread; it may be copied. To read speed or position at an instant, advance a copy of
/// `wheel[side].motion`.
///
///     sim_pair_init(&pair, NULL, now_us, seed);
///     while (sim_pair_step(&pair, now_us, &sent)) { put sent.frame on the bus; }
///     for each frame that was on the bus, the pair's own too: sim_pair_receive(&pair, now_us, &frame);
///     sleep until sim_pair_next_us(&pair) or the next frame
///
/// The pair hears its own frames because the right wheel needs the left one's speed for the pose.
///
/// Faults are planted with the functions below or by writing the documented fault fields of `wheel[side]`; each is
/// undone the same way. Times must not go back.
#ifndef IWHEEL_SIM_PAIR_H
#define IWHEEL_SIM_PAIR_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"
#include "iwheel_sim/sim_wheel.h"

typedef struct {
    sim_wheel_config_t wheel[IW_SIDES];
    uint64_t age_us;         ///< 0: power comes at init and the wheels boot. Else they have been running that long.
    uint16_t track_mm;       ///< Between the wheels; not 0.
    uint8_t battery_dV;      ///< Without load; it sags by 1 dV for each 500 mA drawn.
    bool mirrored[IW_SIDES]; ///< Mounted so that positive speed of this wheel goes backwards. Matters to the pose only.
} sim_pair_config_t;

typedef struct {
    sim_wheel_t wheel[IW_SIDES];
    sim_pose_t pose;
    uint8_t battery_dV;
    bool power;
    bool pose_reversed; ///< Fault: the pose comes least significant byte first.
    bool padded;        ///< Fault: all telemetry is 8 bytes long, zeros behind what the table has.
} sim_pair_t;

/// A telemetry frame and when it was due.
typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t due_us;
    iw_side_t side;
} sim_sent_t;

/// Two healthy wheels as documented: left cN, right dN, boot 400 and 430 ms, sensor zeros 12.3 and 9.8 N, track 540 mm,
/// 24.8 V.
void sim_pair_default(sim_pair_config_t *out_config);

/// `config` may be NULL for the default.
void sim_pair_init(sim_pair_t *self, const sim_pair_config_t *config, iw_time_us_t now_us, uint64_t seed);

/// True with the oldest frame that is due by `now_us`; false if there is none. Call until false.
bool sim_pair_step(sim_pair_t *self, iw_time_us_t now_us, sim_sent_t *out_sent);

/// When `step` has something to do next; IW_NEVER without power.
iw_time_us_t sim_pair_next_us(const sim_pair_t *self);

/// A frame was on the bus. All that is due before `now_us` must have been taken with `step`. Frames that mean nothing
/// to the wheels are ignored: other ids, remote, extended, FD, error, too short.
void sim_pair_receive(sim_pair_t *self, iw_time_us_t now_us, const iw_can_frame_t *frame);

/// True if a wheel is there to acknowledge frames.
bool sim_pair_acknowledges(const sim_pair_t *self);

/// Both wheels lose power, or get it back and boot. Their motion and odometry memory are as without power: coasting,
/// ticks 0.
void sim_pair_power(sim_pair_t *self, iw_time_us_t now_us, bool on);

/// Firmware of one wheel starts anew: silent for its boot time, ticks 0, offset learnt again.
void sim_pair_reboot(sim_pair_t *self, iw_time_us_t now_us, iw_side_t side);

/// What the wheels measure as supply now.
uint8_t sim_pair_battery_dV(const sim_pair_t *self);

#endif
