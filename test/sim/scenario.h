// SPDX-License-Identifier: MIT
/// The events of one run: a configuration and a list of events, both drawn from a seed.
///
/// Swarm: each seed first draws which kinds of event may occur at all and how often, then the events. The result of a run
/// depends only on the scenario, so a failing one is made small by removing events.
#ifndef SIM_TEST_SCENARIO_H
#define SIM_TEST_SCENARIO_H

#include "campaign.h"

#include "iwheel/config.h"

#include <stdio.h>

#define SCENARIO_EVENTS  CAMPAIGN_EVENTS_MAX
#define SCENARIO_CLIENTS 4U
/// The virtual time at which a run begins; times of events are relative to it.
#define SCENARIO_START_US ((iw_time_us_t)1000000U)

typedef enum {
    EV_ESTOP = 0,   ///< Button pressed for `span`.
    EV_ESTOP_GONE,  ///< Line unreadable for `span`.
    EV_BUS_DOWN,    ///< Interface down for `span`.
    EV_BUS_OFF,     ///< Controller bus-off for `span`.
    EV_PASSIVE,     ///< Controller error passive for `span`.
    EV_NO_ACK,      ///< No node acknowledges our frames for `span`.
    EV_BUS_STALL,   ///< The bus accepts no frame for `span`.
    EV_TX_FULL,     ///< The port accepts no frame for `span`.
    EV_TX_RIGHT,    ///< The port accepts no frame for the right wheel for `span`.
    EV_TX_HOLD,     ///< The adapter holds each frame to be sent for `a` us, for `span`.
    EV_TX_LOST,     ///< The adapter swallows the next `a` frames.
    EV_RX_HOLD,     ///< The adapter delivers `a` us late, for `span`.
    EV_ECHO_LOST,   ///< The next `a` echoes are not delivered.
    EV_FOREIGN,     ///< Another master for `span`; 0: one pair.
    EV_BABBLE,      ///< A node sends id `a` every `b` us for `span`.
    EV_ODD_FRAMES,  ///< `a` frames with known numbers and wrong formats or lengths.
    EV_MUTE,        ///< Wheel `who` is offline for `span`.
    EV_REBOOT,      ///< Wheel `who` reboots and is offline for `a` us.
    EV_POWER,       ///< Both wheels without power for `span`.
    EV_LOSS,        ///< Wheel `who` loses `a` permille for `span`.
    EV_SWAP,        ///< Wheel `who`, or both (2), reports the wrong sign for `span`.
    EV_BLOCK,       ///< Wheel `who`, or both, cannot turn for `span`.
    EV_RUNAWAY,     ///< Wheel `who`, or both, is `a` mm/s faster than commanded for `span`.
    EV_FREE,        ///< Wheel `who`, or both, coasts for `span`, whatever is commanded.
    EV_DROOP,       ///< Wheel `who`, or both, stays `a` permille below its command for `span`.
    EV_LATE,        ///< Wheel `who`, or both, obeys `a` us later for `span`.
    EV_FORCE,       ///< Wheel `who` sends its force in the other unit, or just `a` raw, for `span`.
    EV_LOOP_STALL,  ///< The gateway's process does not run for `span`.
    EV_LOOP_SLOW,   ///< Each wake-up comes up to `a` us late, for `span`.
    EV_CRASH,       ///< The gateway's process is killed and runs again after `span`.
    EV_TIMING,      ///< The port reports for `span` that the bus timing is contradicted.
    EV_GOOD_CLIENT, ///< Client `who` resets, arms, and drives a..b mm/s for `span`, then ends according to `style`.
    EV_BLIND,       ///< Client `who` streams a nonzero command for `span`, whatever the replies.
    EV_FIGHT,       ///< Client `who` repeatedly requests takeover for `span`.
    EV_RESETS,      ///< Client `who` repeatedly requests reset for `span`.
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
    iw_time_us_t chaos_us;       ///< All events begin before this; then all faults end.
    uint64_t age_us;             ///< Time since the wheels were switched on.
    uint32_t slow_permille;      ///< Factor of the telemetry's periods; 1000: as documented.
    iw_time_us_t offset_us;      ///< Time for which wheels send offset frames; IW_NEVER: forever.
    uint32_t wake_latency_us;    ///< Maximum delay of each wake-up.
    uint32_t rx_depth;           ///< Frames that the port's receive queue holds.
    iw_time_us_t contact_lag_us; ///< Delay of the e-stop's second contact after the first.
    bool two_contacts;           ///< The e-stop has a second contact.
    bool can_purge;
    bool echo_early; ///< The echo comes right after queueing and proves nothing.
    bool requests_first;
    size_t count;
    event_t event[SCENARIO_EVENTS];
} scenario_t;

void scenario_draw(scenario_t *self, uint64_t seed);

/// Prints the configuration in one line, then one line per event.
void scenario_print(const scenario_t *self, FILE *out);

const char *scenario_kind_name(unsigned kind);

#endif
