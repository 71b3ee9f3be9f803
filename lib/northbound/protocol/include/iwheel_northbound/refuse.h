// SPDX-License-Identifier: MIT
/// @file
/// Refusals in words: cause and cure, with the numbers of this moment. The same on every machine; what only the machine knows
/// (who a client is, how its bus is brought up) it gives as texts.
#ifndef IWHEEL_NORTHBOUND_REFUSE_H
#define IWHEEL_NORTHBOUND_REFUSE_H

#include "iwheel_northbound/request.h"

/// What a message is made of, beside the request. Texts that may be NULL say so.
typedef struct {
    const iw_snapshot_t *seen; ///< Of this moment.
    const char *holder;        ///< Who holds the lease, as shown to others.
    const char *stale_client;  ///< Who sent the command of `seen->stale_us`, as shown to others.
    const char *last_stop;     ///< The sentence of the last stop.
    const char *stopped_by;    ///< Who asked for the last stop, "user 0 (process 7)"; NULL: not known.
    const char *estopped_by;   ///< The same of the last software e-stop.
    iw_time_us_t estopped_us;  ///< When that was.
    const char *estop;         ///< Name of the e-stop line, of two the one that is meant.
    int estop_answer;          ///< Its last: 0 released, 1 pressed, negative unreadable.
    const char *bus;           ///< Name of the bus.
    const char *bus_cure;      ///< What brings it up.
    const char *stalled_cure;  ///< What more there is to do about a frame that nobody acknowledges; NULL: nothing.
    const char *timing;        ///< What is wrong with the bit timing, and the cure.
    const char *contradiction; ///< Of the assumption `seen->doubt`, with what it costs.
    const char *configure;     ///< Where what arm needs is set: "under [wheels] in the configuration".
    const char *listen_only;   ///< Why nothing is ever sent, and the cure.
    bool shutting_down;        ///< Nobody can arm any more.
} iwn_refuse_context_t;

/// The limit of the age of `arm`, `reset`, `release` and `confirm` where none is configured.
#define IWN_MAX_AGE_MS 1000U
/// A request may be ahead of the gateway's clock by so much: clocks of one machine are read one after the other.
#define IWN_AHEAD_MAX_US 100000U

/// The moment at which a request that permits motion or clears a latch is judged.
typedef struct {
    iw_time_us_t now_us;     ///< Of the gateway's clock.
    iw_time_us_t stopped_us; ///< Of the last stop, and of the last request for one; 0: there was none.
    uint32_t stop;           ///< The number of the last stop; 0: there was none.
    uint32_t max_age_ms;     ///< A request may be so old.
} iwn_moment_t;

/// True, with the refusal, if what the request says of its time (`t_us`) and of its stop (`stop`) keeps it from being carried out: it
/// is too old, ahead of the clock, older than the last stop, or means another stop than the last. False for a request that says
/// neither.
bool iwn_refuse_late(const iwn_request_t *request, const iwn_moment_t *moment, iwn_refusal_t *out_refusal);

/// The message for a refusal of the core, and its error.
void iwn_refuse_describe(const iwn_refuse_context_t *context, const iwn_request_t *request, iw_refusal_t refusal,
                         iwn_refusal_t *out_refusal);

/// The same for a tare that was refused for this wheel.
void iwn_refuse_describe_tare(iw_side_t side, iw_tare_t result, iwn_refusal_t *out_refusal);

#endif
