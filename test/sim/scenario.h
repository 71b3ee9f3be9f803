// SPDX-License-Identifier: MIT
/// What happens in one run: a configuration and a list of events, both drawn from a seed.
///
/// Swarm: each seed first draws which kinds of event may occur at all and how often, then the events. A run is a pure
/// function of the scenario, so a failing one is made small by leaving events out.
#ifndef SIM_TEST_SCENARIO_H
#define SIM_TEST_SCENARIO_H

#include "campaign.h"

#include "iwheel/config.h"

#include <stdio.h>

#define SCENARIO_EVENTS  CAMPAIGN_EVENTS_MAX
#define SCENARIO_CLIENTS 4U
/// The virtual time at which a run begins; events tell their time from there.
#define SCENARIO_START_US ((iw_time_us_t)1000000U)

typedef enum {
    EV_ESTOP = 0,   ///< Button pressed for `span`.
    EV_ESTOP_GONE,  ///< Line unreadable for `span`.
    EV_BUS_DOWN,    ///< Interface down for `span`.
    EV_BUS_OFF,     ///< Controller bus-off for `span`.
    EV_PASSIVE,     ///< Controller error passive for `span`.
    EV_NO_ACK,      ///< Nobody acknowledges our frames for `span`.
    EV_BUS_STALL,   ///< The bus takes no frame for `span`.
    EV_TX_FULL,     ///< The port takes no frame for `span`.
    EV_TX_RIGHT,    ///< The port takes no frame for the right wheel for `span`.
    EV_TX_HOLD,     ///< The adapter holds each frame to be sent for `a` us, for `span`.
    EV_TX_LOST,     ///< The adapter swallows the next `a` frames.
    EV_RX_HOLD,     ///< The adapter delivers `a` us late, for `span`.
    EV_ECHO_LOST,   ///< The next `a` echoes are not delivered.
    EV_FOREIGN,     ///< Another master for `span`; 0: one pair.
    EV_BABBLE,      ///< A node sends id `a` every `b` us for `span`.
    EV_ODD_FRAMES,  ///< `a` frames with known numbers and wrong formats or lengths.
    EV_MUTE,        ///< Wheel `who` silent for `span`.
    EV_REBOOT,      ///< Wheel `who` reboots, silent for `a` us.
    EV_POWER,       ///< Both wheels without power for `span`.
    EV_LOSS,        ///< Wheel `who` loses `a` permille for `span`.
    EV_SWAP,        ///< Wheel `who`, or both (2), reports the wrong sign for `span`.
    EV_BLOCK,       ///< Wheel `who`, or both, cannot turn for `span`.
    EV_RUNAWAY,     ///< Wheel `who`, or both, is faster than told by `a` mm/s for `span`.
    EV_FREE,        ///< Wheel `who`, or both, coasts whatever it is told for `span`.
    EV_DROOP,       ///< Wheel `who`, or both, stays `a` permille below its command for `span`.
    EV_LATE,        ///< Wheel `who`, or both, obeys `a` us later for `span`.
    EV_FORCE,       ///< Wheel `who` sends its force in the other unit, or just `a` raw, for `span`.
    EV_LOOP_STALL,  ///< The gateway's process does not run for `span`.
    EV_LOOP_SLOW,   ///< Each wake-up comes up to `a` us late, for `span`.
    EV_CRASH,       ///< The gateway's process dies and runs again after `span`.
    EV_TIMING,      ///< The port says that the bus timing is contradicted, for `span`.
    EV_GOOD_CLIENT, ///< Client `who` resets, arms, and drives a..b mm/s for `span`, then ends as `style` says.
    EV_BLIND,       ///< Client `who` streams a nonzero command for `span`, whatever the answers.
    EV_FIGHT,       ///< Client `who` asks for takeover again and again for `span`.
    EV_RESETS,      ///< Client `who` asks for reset again and again for `span`.
    EV_ONE_DRIVE,   ///< Client `who` sends one drive a, b, sometimes out of range.
    EV_ONE_ARM,
    EV_ONE_RESET,
    EV_ONE_STOP,
    EV_ONE_ESTOP, ///< Software e-stop.
    EV_DISCONNECT,
    EV_TARE,
    EV_ONE_RELEASE, ///< The end of a hold.
    EV_KINDS,
} event_kind_t;

typedef struct {
    uint64_t seed;
    iw_config_t config;
    iw_time_us_t chaos_us;       ///< Events lie before this; then all is healed.
    uint64_t age_us;             ///< How long the wheels have been running already.
    uint32_t slow_permille;      ///< Factor of the telemetry's periods; 1000: as documented.
    iw_time_us_t offset_us;      ///< How long wheels send offset frames; IW_NEVER: for ever.
    uint32_t wake_latency_us;    ///< How late each wake-up may be.
    uint32_t rx_depth;           ///< Frames that the port's receive queue holds.
    iw_time_us_t contact_lag_us; ///< The e-stop's second contact follows the first so much later.
    bool two_contacts;           ///< It has one.
    bool can_purge;
    bool echo_early; ///< The echo comes right after queueing and proves nothing.
    bool requests_first;
    size_t count;
    event_t event[SCENARIO_EVENTS];
} scenario_t;

void scenario_draw(scenario_t *self, uint64_t seed);

/// One readable line per event, after one that tells the configuration.
void scenario_print(const scenario_t *self, FILE *out);

const char *scenario_kind_name(unsigned kind);

#endif
