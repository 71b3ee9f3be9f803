// SPDX-License-Identifier: MIT
/// The wheels' side of the daemon: the core, the port below it, the tape between them, and what is noted of all three.
///
/// Whoever only looks takes it const. Whoever acts upon the core does it at `now_us`, notes it on the tape, and sets `requested`
/// if the loop shall step once more in this cycle.
#ifndef GATEWAY_WHEELS_H
#define GATEWAY_WHEELS_H

#include "health.h"
#include "tape.h"

#include "inspect.h"

#include "iwheel/gateway.h"
#include "iwheel/observation.h"
#include "iwheel_linux/linux_hal.h"
#include "iwheel_northbound/json_out.h"

#define GW_WARNINGS     8U
#define GW_WARNING_SIZE 400U
/// The warning about an e-stop line, by its name, whose button nobody has seen to work.
#define GW_ESTOP_UNTRIED                                                                                               \
    "the button of the e-stop %s was never seen to work on this wiring, and a short to ground would go unseen; press " \
    "it for a second, then release it"

/// How regularly setpoint pairs leave: a histogram of the gaps between them, and the worst, since the gateway's start.
///
/// The wheels stop by themselves after 1000 ms without a setpoint, and 100 ms are the most that safety allows. Gaps are
/// counted while pairs are being sent; silence is none.
#define GW_GAP_BUCKETS 10U

typedef struct {
    uint32_t count[GW_GAP_BUCKETS]; ///< Gaps up to `gw_gap_limits_ms` of the bucket; the last bucket has no limit.
    uint32_t worst_us;
    uint32_t pairs; ///< When last looked at.
} gw_gaps_t;

/// Upper bounds, inclusive, of all buckets but the last.
extern const uint16_t gw_gap_limits_ms[GW_GAP_BUCKETS - 1U];

/// Looks at what was sent after a step, which sends one pair at the most.
void gw_gaps_note(gw_gaps_t *self, const iw_sent_t *sent);

/// Writes the object's fields.
void gw_gaps_write(const gw_gaps_t *self, iwn_out_t *json);

typedef struct gw_wheels {
    iw_gateway_t core;
    iwl_hal_t hal;
    gw_tape_t tape;
    iw_observation_t observation;
    gw_gaps_t gaps;
    inspect_config_t bus; ///< As configured.
    const char *estop;    ///< The line, as configured.
    const char *estop2;   ///< That of its second contact.
    iw_time_us_t now_us;  ///< Of the present cycle; never goes back.
    iw_time_us_t step_us; ///< When the next step is due, as the last one wished.
    bool requested;       ///< A request has changed something since the last step.
    bool time_used;       ///< A request was carried out at `now_us` already.
    bool shutting_down;
    bool estop_untried;     ///< Its button was never seen to work on this wiring; not before what was kept is read.
    gw_health_t health;     ///< Its limits are set already.
    int64_t estop_tried_us; ///< When it was last, by the wall clock; 0: never.
    uint32_t warnings;      ///< What is wrong enough to be said at start, in `status` and with every arm.
    char warning[GW_WARNINGS][GW_WARNING_SIZE];
} gw_wheels_t;

/// Lets the core begin on an open `hal`, with `ring` for the tape (NULL: nothing is noted). `restarted`: the gateway before this one
/// died while it was sending.
iw_config_fault_t gw_wheels_begin(gw_wheels_t *self, const iw_config_t *config, blackbox_ring_t *ring, bool restarted);

/// What is known of the wheels now: after a step or a request, look again.
iw_snapshot_t gw_wheels_look(const gw_wheels_t *self);

/// A clock has just been read.
void gw_wheels_time(gw_wheels_t *self, iw_time_us_t now_us);

/// Before each request: the first one after a reading of the clock is carried out at that time, each other at a time of its own.
void gw_wheels_time_request(gw_wheels_t *self);

/// The line of the e-stop's contact that says most: one that cannot be read, else one that is pressed, else the first.
const char *gw_wheels_estop(const gw_wheels_t *self);

/// True while setpoints are sent, or about to be.
bool gw_wheels_are_sent_to(const gw_wheels_t *self);

/// The core's cycle at `now_us`, and a look at what has come of it.
iw_snapshot_t gw_wheels_step(gw_wheels_t *self);

/// The machine was suspended for so long since the last step.
void gw_wheels_slept(gw_wheels_t *self, iw_time_us_t for_us);

/// The wheels are to stop; `client` may be IW_CLIENT_NONE.
void gw_wheels_stop(gw_wheels_t *self, iw_client_t client, iw_cause_t cause);

/// The client is no longer there for the core: its lease ends now.
void gw_wheels_leave(gw_wheels_t *self, iw_client_t client);

/// The core is told of an assumption: it may refuse to arm for it.
void gw_wheels_set_assumption(gw_wheels_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry);

/// Notes what has gone into the core at `now_us`. `number` is that of the client, if one has asked for it.
void gw_wheels_note(gw_wheels_t *self, uint32_t number, const blackbox_entry_t *entry);

/// Notes a stop that has just been seen, and keeps the frames around it.
void gw_wheels_note_stop(gw_wheels_t *self, const iw_stop_t *stop);

/// Notes the state and what it was before.
void gw_wheels_note_state(gw_wheels_t *self, const iw_snapshot_t *seen, iw_state_t before);

/// Once a second: notes the port's answers, the state and what keeps from arming again.
void gw_wheels_note_again(gw_wheels_t *self);

/// The frames around the last stop, for `why`, into an object that is open.
void gw_wheels_write_around(const gw_wheels_t *self, iwn_out_t *json);

#endif
