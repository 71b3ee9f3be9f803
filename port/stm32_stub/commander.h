// SPDX-License-Identifier: MIT
/// Source of the commands. **The command source of a product belongs here**: a joystick, a serial line, a planner.
///
/// A source is one file, which CMake selects. The first one is next to this file, the others are in app/board:
///
/// | file                | selected by                                  | function                                    |
/// |---------------------|----------------------------------------------|---------------------------------------------|
/// | commander_none.c    | nothing configured                           | none: the image listens and sends nothing   |
/// | commander_zero.c    | setpoint type, current role and track        | arms when allowed, holds both wheels at 0/0 |
/// | commander_demo.c    | these and IWHEEL_DEMO                        | as zero; pressing PA1 starts a slow profile |
/// | commander_gateway.c | IWHEEL_GATEWAY                               | executes requests of a host (serial line)   |
///
/// The first three use commander.c, console.c and report.c; the last one implements the functions of these files
/// itself.
///
/// Without a host no client can reset a latch, so with the first three a press of the button at PA1 resets it. The
/// button must be released and pressed again after the event that latched. The reset is refused like any reset (safety:
/// cause gone for a second, e-stop released, both wheels online and at standstill), and it never starts motion.
/// Switching power off and on also resets the latch.
///
/// Rules for a new source: call `iw_gateway_drive` only with a value that the operator or the planner demands *now*.
/// Each accepted call feeds the lease, and the lease stops the wheels when that operator or planner is gone. Do not
/// repeat an old value, do not answer a refusal by another attempt with a nonzero value, and never wait in these
/// functions.
#ifndef BRD_COMMANDER_H
#define BRD_COMMANDER_H

#include "iwheel/gateway.h"

/// State of a command source. Must be all zero before the first call.
typedef struct {
    iw_time_us_t tried_us;   ///< Time of the last request to arm.
    iw_time_us_t change_us;  ///< Time of the last change of the button's level.
    iw_time_us_t profile_us; ///< Start time of the profile.
    bool level;              ///< Last level of the button: true is pressed.
    bool released;           ///< The button was released for long enough before.
    bool running;            ///< The profile runs.
} brd_commander_t;

/// Returns the function of this source as text, for the first line on the console.
const char *brd_commander_name(void);

/// Returns true if this source may command. The controller then takes part in the bus; otherwise it is in silent mode
/// and does not acknowledge.
bool brd_commander_sends(void);

/// Called once, directly after a start and before the watchdog runs. A source may read and write data in flash here.
/// `in_motion`: the previous run was sending, so the call must be short.
void brd_commander_open(bool power_on, bool in_motion);

/// Called once, before the gateway starts. `config` contains the defaults and the build options.
void brd_commander_configure(iw_config_t *config);

/// Called once in every cycle, directly before `iw_gateway_step`, at least every 20 ms: its command leaves in the same
/// cycle. Must return within a millisecond.
void brd_commander_step(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us);

/// For sources: requests to arm if the state allows it, at most every 100 ms. Returns true while armed and holder.
bool brd_commander_arm(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us);

/// For sources: returns true once for each press of the button, low for 20 ms after it was high for 20 ms. A held
/// button does not repeat, and one that is pressed at the start counts only after its release. Call it in every cycle.
bool brd_commander_pressed(brd_commander_t *self, iw_time_us_t now_us);

/// For sources: resets a latch if there is one and reports the result.
void brd_commander_reset(iw_gateway_t *gateway, iw_time_us_t now_us);

/// For sources: sends one drive command for both wheels. The current is the configured maximum with the role limit, and
/// 0 with the role setpoint.
iw_refusal_t brd_commander_drive(iw_gateway_t *gateway, iw_time_us_t now_us, int32_t speed_mm_s);

#endif
