// SPDX-License-Identifier: MIT
/// @file
/// What is known of one wheel: its last values, how old they are, whether it is there, at rest, or has rebooted.
///
/// "Heard" means its speed frame (4 ms): that is the one the safety rules judge; other frames do not keep a wheel
/// alive.
///
/// Two frames of reference: `speed_rpm` and `ticks` are the wheel's own, as on the bus; mm/s and distance are the
/// machine's, with `invert` applied, so that they can be compared with commands.
///
/// A reboot is recognised by: silence of IW_WHEEL_REBOOT_SILENCE_US; odometry that jumps further than any wheel can
/// turn; offset frames that come back. A wheel sends those in its first 60 s (document), so after a pause they mean
/// another start. For how long they come is no evidence: a wheel may send them for longer, or for ever. Nor are offset
/// frames in our own first minute: a gateway that starts late hears the rest of the wheel's.
#ifndef IW_WHEEL_H
#define IW_WHEEL_H

#include "iwheel/codec.h"
#include "iwheel/config.h"

/// Silent for this long, a wheel must be assumed to have been without power.
#define IW_WHEEL_REBOOT_SILENCE_US 1000000U
/// Of the offset frames (document).
#define IW_WHEEL_OFFSET_PERIOD_US 1000000U
#define IW_WHEEL_OFFSET_LEARN_US  2000000U ///< How long a wheel listens to its sensor before the first one.
/// Offset frames that come after this much of a run without any are back. Four may get lost in a row; and it is longer
/// than a wheel needs for its first one, so that an ordinary start is none that begins twice. Ours.
#define IW_WHEEL_OFFSET_BACK_US 5000000U
/// No odometry step is faster than this: twice the highest configurable speed. Ours, not the document's.
#define IW_WHEEL_FASTEST_MM_S 10000U
/// Odometry steps up to this many ticks are believed whatever the time between them. Ours.
#define IW_WHEEL_TICK_SLACK 30U
/// Beyond this, either way, ticks are counted no more: so a distance in nanometres fits 64 bits whatever a wheel says.
/// At the 20 mm of a tick without gear that is two million kilometres. Ours.
#define IW_WHEEL_TICKS_MAX 100000000000

/// By what a reboot was recognised.
typedef enum {
    IW_REBOOT_NONE = 0,
    IW_REBOOT_SILENCE,
    IW_REBOOT_ODOMETRY,
    IW_REBOOT_OFFSET_FRAMES,
} iw_reboot_t;

/// What is known of a wheel. What is short stands first: a Cortex-M reaches it by shorter instructions.
typedef struct {
    const iw_config_t *config;      ///< The owner's.
    iw_side_t side;                 ///< Which wheel this is.
    iw_reboot_t pending_reboot;     ///< Not yet taken.
    bool boot_seen;                 ///< This run of the wheel began while we were listening, not before.
    iw_time_us_t first_us;          ///< First heard; IW_NEVER: not yet.
    iw_time_us_t offset_us;         ///< Last offset frame of this run, or its start.
    iw_time_us_t any_us;            ///< Last frame of any kind, or the end of our own stall, or the start.
    iw_time_us_t received_us;       ///< Last speed frame that counted for liveness; IW_NEVER: none yet.
    iw_time_us_t received_until_us; ///< Without another one it is heard until here; 0: none yet.
    iw_time_us_t speed_us;          ///< Last speed frame.
    iw_time_us_t status_us;         ///< Last status frame.
    iw_time_us_t rest_since_us;     ///< Start of the unbroken run of speed frames at rest; IW_NEVER: moving.
    iw_time_us_t excused_us;        ///< Our own stall ended here: silence before it is not the wheel's.
    int64_t ticks;                  ///< Unwrapped since the first status frame, across reboots; the wheel's own sign.
    /// In the machine's frame: negative where `invert` is set. IW_WHEEL_TICKS_MAX times this fits 64 bits.
    int32_t nm_per_tick;
    uint32_t um_s_per_rpm;    ///< Speed in um/s at 1 rpm of its telemetry.
    uint32_t us_per_tick_min; ///< At IW_WHEEL_FASTEST_MM_S.
    uint32_t reboots;         ///< Recognised so far.
    int32_t speed_mm_s;       ///< Last measured, in the machine's frame, rounded towards zero; stale while not heard.
    int32_t odometry_ticks;   ///< Of the last status frame.
} iw_wheel_t;

/// `config` must be checked and outlive the wheel.
void iw_wheel_init(iw_wheel_t *self, const iw_config_t *config, iw_side_t side, iw_time_us_t now_us);

/// Takes a message from this wheel: `told` has its values. `fresh` is false in a late step, when the time of reception
/// is unknown: values are then taken, but the wheel's silence does not end and no run of rest begins.
void iw_wheel_receive(iw_wheel_t *self, iw_time_us_t now_us, iw_codec_kind_t kind, const iw_codec_wheel_t *told,
                      bool fresh);

/// Our loop was late: until `wheel_silent_ms` from now silence is not held against the wheel. Repeated without
/// a fresh speed frame in between it extends nothing.
void iw_wheel_excuse(iw_wheel_t *self, iw_time_us_t now_us);

/// True if its speed was heard less than `wheel_silent_ms` ago.
static inline bool iw_wheel_online(const iw_wheel_t *self, iw_time_us_t now_us) {
    return now_us < self->received_until_us;
}

/// True if it was never heard, or not for `wheel_silent_ms` and no stall of ours excuses that.
bool iw_wheel_lost(const iw_wheel_t *self, iw_time_us_t now_us);

/// How long it has been heard with |rpm| <= rest_rpm, without a gap, UINT32_MAX at the most; 0: it turns, or is not
/// heard.
uint32_t iw_wheel_rest_us(const iw_wheel_t *self, iw_time_us_t now_us);

/// The evidence of a reboot since the last call, then IW_REBOOT_NONE.
static inline iw_reboot_t iw_wheel_take_reboot(iw_wheel_t *self) {
    const iw_reboot_t reboot = self->pending_reboot;
    self->pending_reboot = IW_REBOOT_NONE;
    return reboot;
}

#endif
