// SPDX-License-Identifier: MIT
/// @file
/// State of one wheel: its last values, their age, and whether it is online, at standstill, or has rebooted.
///
/// A wheel is online if its speed message (4 ms) arrives, because the safety rules judge that message. Other messages
/// do not count.
///
/// There are two frames of reference. `speed_rpm` and `ticks` are those of the wheel, as on the bus. Speeds in mm/s and
/// distances are those of the machine, with `invert` applied, so that they can be compared with commands.
///
/// The core recognises a reboot by no frame for IW_WHEEL_REBOOT_SILENCE_US, by odometry that jumps further than a wheel
/// can turn, or by offset messages after a pause. A wheel sends offset messages in the first 60 s after its start
/// (document), so after a pause they show another start. Their duration shows nothing, because a wheel may send them
/// for longer. Offset messages in the first minute of the gateway show nothing either: the wheel may have started
/// shortly before.
#ifndef IW_WHEEL_H
#define IW_WHEEL_H

#include "iwheel/codec.h"
#include "iwheel/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/// After this time without a frame the core assumes that the wheel had no power.
#define IW_WHEEL_REBOOT_SILENCE_US 1000000U
#define IW_WHEEL_SPEED_PERIOD_US   4000U ///< Period of speed messages (document).
/// Period of offset messages (document).
#define IW_WHEEL_OFFSET_PERIOD_US 1000000U
#define IW_WHEEL_OFFSET_LEARN_US  2000000U ///< Time in which a wheel measures its offset before the first message.
/// An offset message after this time without one shows a reboot. Four in a row may be lost. The time is longer than a
/// wheel needs for its first message, so that a normal start does not count twice. Chosen by us.
#define IW_WHEEL_OFFSET_BACK_US 5000000U
/// No odometry step is faster than this: twice the highest configurable speed. Chosen by us.
#define IW_WHEEL_FASTEST_MM_S 10000U
/// The core accepts odometry steps of up to this many ticks at any interval. Chosen by us.
#define IW_WHEEL_TICK_SLACK 30U
/// Limit of the tick counter in both directions, so that a distance in nanometres always fits 64 bits. With 20 mm per
/// tick (no gear) it is two million kilometres. Chosen by us.
#define IW_WHEEL_TICKS_MAX 100000000000

/// Observation that showed a reboot.
typedef enum {
    IW_REBOOT_NONE = 0,
    IW_REBOOT_SILENCE,
    IW_REBOOT_ODOMETRY,
    IW_REBOOT_OFFSET_FRAMES,
} iw_reboot_t;

/// State of a wheel. Short members come first, because a Cortex-M addresses them with shorter instructions.
typedef struct {
    const iw_config_t *config;      ///< Configuration of the owner.
    iw_side_t side;                 ///< Side of this wheel.
    iw_reboot_t pending_reboot;     ///< Reboot that `iw_wheel_next_reboot` has not returned yet.
    bool boot_seen;                 ///< The start of this run of the wheel was observed.
    iw_time_us_t first_us;          ///< Time of the first frame; IW_NEVER if there is none.
    iw_time_us_t offset_us;         ///< Time of the last offset message of this run, or of its start.
    iw_time_us_t any_us;            ///< Time of the last frame, or of the end of a stall, or of the start.
    iw_time_us_t received_us;       ///< Last speed message with a known reception time; IW_NEVER if there is none.
    iw_time_us_t received_until_us; ///< Without another speed message the wheel is online until this time; 0 if none.
    iw_time_us_t speed_us;          ///< Time of the last speed message.
    iw_time_us_t status_us;         ///< Time of the last status message.
    iw_time_us_t rest_since_us;     ///< Start of the run of speed messages at standstill; IW_NEVER if the wheel moves.
    iw_time_us_t excused_us;        ///< End of the last stall of the gateway: missing frames before it do not count.
    int64_t ticks; ///< Odometry without wraps since the first status message, in the wheel's direction.
    /// Distance of one tick in the machine's frame: negative if `invert` is set. IW_WHEEL_TICKS_MAX times this fits 64
    /// bits.
    int32_t nm_per_tick;
    uint32_t um_s_per_rpm;    ///< Speed in um/s at 1 rpm of telemetry.
    uint32_t us_per_tick_min; ///< Shortest time of a tick, at IW_WHEEL_FASTEST_MM_S.
    uint32_t reboots;         ///< Number of reboots that were recognised.
    int32_t speed_mm_s;       ///< Last speed in the machine's frame, rounded towards zero. Valid only while online.
    int32_t odometry_ticks;   ///< Odometry of the last status message.
} iw_wheel_t;

/// Initializes `self`. `config` must be checked, and must exist as long as `self`.
void iw_wheel_init(iw_wheel_t *self, const iw_config_t *config, iw_side_t side, iw_time_us_t now_us);

/// Receives a message of this wheel; `values` has its values. `fresh` is false in a late step, in which reception times
/// are unknown. The values are then stored, but the wheel does not become online and no standstill begins.
void iw_wheel_receive(iw_wheel_t *self, iw_time_us_t now_us, iw_codec_kind_t kind, const iw_codec_wheel_t *values,
                      bool fresh);

/// Reports that a step was late: until `wheel_silent_ms` from now missing frames do not count. Another call without a
/// fresh speed message in between does not extend that time.
void iw_wheel_excuse(iw_wheel_t *self, iw_time_us_t now_us);

/// Returns true if the last speed message is less than `wheel_silent_ms` old.
static inline bool iw_wheel_online(const iw_wheel_t *self, iw_time_us_t now_us) {
    return now_us < self->received_until_us;
}

/// Returns true if no speed message has ever arrived, or none for `wheel_silent_ms` without an excuse
/// (iw_wheel_excuse).
bool iw_wheel_lost(const iw_wheel_t *self, iw_time_us_t now_us);

/// Returns the time for which the wheel has been online with |rpm| <= rest_rpm without a gap, at most UINT32_MAX.
/// Returns 0 if the wheel turns or is offline.
uint32_t iw_wheel_rest_us(const iw_wheel_t *self, iw_time_us_t now_us);

/// Returns the observation that showed a reboot since the last call, or IW_REBOOT_NONE.
static inline iw_reboot_t iw_wheel_next_reboot(iw_wheel_t *self) {
    const iw_reboot_t reboot = self->pending_reboot;
    self->pending_reboot = IW_REBOOT_NONE;
    return reboot;
}

#ifdef __cplusplus
}
#endif
#endif
