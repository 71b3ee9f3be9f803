// SPDX-License-Identifier: MIT
/// Where the commands come from. **This is the place for a product's own command source**: a joystick, a serial line, a
/// planner.
///
/// A source is one file, which CMake chooses. The first is beside this file, the others are in app/board:
///
/// | file                | chosen by                                    | does                                        |
/// |---------------------|----------------------------------------------|---------------------------------------------|
/// | commander_none.c    | nothing configured                           | nothing: the image listens, silently        |
/// | commander_zero.c    | setpoint type, current role and track        | arms when it may, holds both wheels at 0/0  |
/// | commander_demo.c    | these and IWHEEL_DEMO                        | as zero; pressing PA1 starts a slow profile |
/// | commander_gateway.c | IWHEEL_GATEWAY                               | what a host asks over the serial line       |
///
/// The first three have commander.c, console.c and report.c beside them; the last one brings what these do.
///
/// Without a host nobody else could reset a latch, so in these three a press of the button at PA1 does: let go and
/// pressed again after what latched, refused as any reset (safety: cause gone for a second, e-stop released, both
/// wheels heard and at rest), and never the beginning of motion. Power off and on does it too.
///
/// Rules for one's own: call `iw_gateway_drive` only with a value that somebody wants *now*, since each accepted call
/// feeds the lease and the lease is what stops the wheels when nobody is there any more. Do not repeat an old value, do
/// not answer a refusal by trying again with a nonzero value, never wait in here.
#ifndef BRD_COMMANDER_H
#define BRD_COMMANDER_H

#include "iwheel/gateway.h"

/// All state of a command source. All zero before the first call.
typedef struct {
    iw_time_us_t tried_us;   ///< When arming was last asked for.
    iw_time_us_t change_us;  ///< When the button's level last changed.
    iw_time_us_t profile_us; ///< When the profile began.
    bool level;              ///< The button's last level: pressed.
    bool released;           ///< ... and whether it was let go for long enough before.
    bool running;            ///< The profile.
} brd_commander_t;

/// What this source does, for the console's first line.
const char *brd_commander_name(void);

/// True if this source may command: the controller then takes part in the bus. False: it is silent and does not
/// acknowledge.
bool brd_commander_sends(void);

/// Called once, right after a start and before the watchdog runs: what outlives power may be read and written here.
/// `in_motion`: the run before this one was sending, so nothing may take long.
void brd_commander_open(bool power_on, bool in_motion);

/// Called once, before the gateway begins: `config` has the defaults and the options of the build.
void brd_commander_configure(iw_config_t *config);

/// Called once in every cycle, right before `iw_gateway_step`, at least every 20 ms: what it commands leaves in the
/// same cycle. Must return within a millisecond.
void brd_commander_step(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us);

/// For sources: asks to be armed when that makes sense, and not more often than every 100 ms. True while armed and
/// holder.
bool brd_commander_arm(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us);

/// For sources: true once for each press of the button: low for 20 ms after it was high for 20 ms. Held, it repeats
/// nothing, and one that is down from the start counts only after it was let go. To be asked in every cycle.
bool brd_commander_pressed(brd_commander_t *self, iw_time_us_t now_us);

/// For sources: resets a latch if there is one and tells how that went.
void brd_commander_reset(iw_gateway_t *gateway, iw_time_us_t now_us);

/// For sources: one drive command for both wheels, with the configured maximum current if that is a limit, else with
/// none.
iw_refusal_t brd_commander_drive(iw_gateway_t *gateway, iw_time_us_t now_us, int32_t speed_mm_s);

#endif
