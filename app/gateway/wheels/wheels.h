// SPDX-License-Identifier: MIT
/// The wheels in the daemon: the core, the port, the tape between them, and their records.
///
/// Readers use a const pointer. A function that acts on the core uses the time `now_us`, records the action on the
/// tape, and sets `requested` if the loop must step once more in this cycle.
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
/// Warning about an e-stop line, by its name, whose button was never tested.
#define GW_ESTOP_UNTRIED                                                                                               \
    "the button of the e-stop %s was never seen to work on this wiring, and a short to ground would not be "           \
    "detected; press it for a second, then release it"

/// Regularity of setpoint pairs: a histogram of the gaps between them, and the largest gap, since the gateway's start.
///
/// The wheels stop on their own after 1000 ms without a setpoint, and the safety rules allow 100 ms. Gaps count while
/// pairs are sent; a pause does not count.
#define GW_GAP_BUCKETS 10U

typedef struct {
    uint32_t
        count[GW_GAP_BUCKETS]; ///< Number of gaps up to `gw_gap_limits_ms` of the bucket. The last bucket has no limit.
    uint32_t worst_us;
    uint32_t pairs; ///< Number of pairs at the last check.
} gw_gaps_t;

/// Upper limits, inclusive, of all buckets but the last.
extern const uint16_t gw_gap_limits_ms[GW_GAP_BUCKETS - 1U];

/// Counts the gap after a step, which sends one pair at most.
void gw_gaps_note(gw_gaps_t *self, const iw_sent_t *sent);

/// Writes the fields of the object.
void gw_gaps_write(const gw_gaps_t *self, iwn_out_t *json);

typedef struct gw_wheels {
    iw_gateway_t core;
    iwl_hal_t hal;
    gw_tape_t tape;
    iw_observation_t observation;
    gw_gaps_t gaps;
    inspect_config_t bus; ///< Configured bus.
    const char *estop;    ///< Configured e-stop line.
    const char *estop2;   ///< Configured line of its second contact.
    iw_time_us_t now_us;  ///< Time of the present cycle. It never decreases.
    iw_time_us_t step_us; ///< Time of the next step, from the last one.
    bool requested;       ///< A request has changed something since the last step.
    bool time_used;       ///< A request was executed at `now_us`.
    bool shutting_down;
    bool estop_untried; ///< The button was never tested on this wiring. False until the stored assumptions are read.
    gw_health_t health; ///< The owner sets its limits.
    int64_t estop_tried_us; ///< Wall clock time of the last test; 0 if there was none.
    uint32_t warnings;      ///< Warnings that are reported at the start, in `status` and with every arm.
    char warning[GW_WARNINGS][GW_WARNING_SIZE];
} gw_wheels_t;

/// Starts the core on the open `hal`, with `ring` for the tape (NULL: no recording). `restarted`: the gateway before
/// this one died while it sent setpoints.
iw_config_fault_t gw_wheels_begin(gw_wheels_t *self, const iw_config_t *config, blackbox_ring_t *ring, bool restarted);

/// Returns a snapshot. Call it again after a step or a request.
iw_snapshot_t gw_wheels_snapshot(const gw_wheels_t *self);

/// Sets the time after a clock was read.
void gw_wheels_time(gw_wheels_t *self, iw_time_us_t now_us);

/// Prepares the time of a request: the first one after a reading of the clock is executed at that time, each other one
/// at its own time.
void gw_wheels_time_request(gw_wheels_t *self);

/// Returns the line of the contact with the most severe state: unreadable, then pressed, then the first.
const char *gw_wheels_estop(const gw_wheels_t *self);

/// Returns true while setpoints are sent, or are about to be.
bool gw_wheels_are_sent_to(const gw_wheels_t *self);

/// Runs a cycle of the core at `now_us`, and returns a snapshot.
iw_snapshot_t gw_wheels_step(gw_wheels_t *self);

/// Reports that the machine was suspended for this time since the last step.
void gw_wheels_slept(gw_wheels_t *self, iw_time_us_t for_us);

/// Stops the wheels. `client` may be IW_CLIENT_NONE.
void gw_wheels_stop(gw_wheels_t *self, iw_client_t client, iw_cause_t cause);

/// Ends the lease of a client that is gone.
void gw_wheels_leave(gw_wheels_t *self, iw_client_t client);

/// Sets an assumption in the core, which may then refuse to arm.
void gw_wheels_set_assumption(gw_wheels_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry);

/// Records an input of the core at `now_us`. `number` is the client of the request, if there is one.
void gw_wheels_note(gw_wheels_t *self, uint32_t number, const blackbox_entry_t *entry);

/// Records a stop, and retains the frames around it.
void gw_wheels_note_stop(gw_wheels_t *self, const iw_stop_t *stop);

/// Records the state and the state before.
void gw_wheels_note_state(gw_wheels_t *self, const iw_snapshot_t *seen, iw_state_t before);

/// Records the results of the port, the state and the reasons against arm, once a second.
void gw_wheels_note_again(gw_wheels_t *self);

/// Writes the frames around the last stop, for `why`, into an open object.
void gw_wheels_write_around(const gw_wheels_t *self, iwn_out_t *json);

#endif
