// SPDX-License-Identifier: MIT
/// @file
/// Messages of refusals: cause and fix, with the present values. They are the same on every machine. The caller passes
/// the parts that depend on the machine (the name of a client, how to bring its bus up) as texts.
#ifndef IWHEEL_NORTHBOUND_REFUSE_H
#define IWHEEL_NORTHBOUND_REFUSE_H

#include "iwheel_northbound/request.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Data of a message in addition to the request. The comment of a text states whether it may be NULL.
typedef struct {
    const iw_snapshot_t *seen; ///< Present snapshot.
    const char *holder;        ///< Lease holder as shown to others.
    const char *stale_client;  ///< Client of `seen->stale_us` as shown to others.
    const char *last_stop;     ///< Sentence of the last stop.
    const char *stopped_by;    ///< Client that requested the last stop, "user 0 (process 7)"; NULL if unknown.
    const char *estopped_by;   ///< Client that requested the last software e-stop.
    iw_time_us_t estopped_us;  ///< Time of that request.
    const char *estop;         ///< Name of the e-stop line; of two, the one in question.
    int estop_answer;          ///< Last result: 0 released, 1 pressed, negative unreadable.
    const char *bus;           ///< Name of the bus.
    const char *bus_fix;       ///< Fix for a bus that is down.
    const char *stalled_fix;   ///< Further fix for a frame without acknowledgement; NULL if there is none.
    const char *timing;        ///< Fault of the bit timing, and its fix.
    const char *contradiction; ///< Message about the assumption `seen->doubt`, with the consequence.
    const char *configure;     ///< Place of the configuration: "under [wheels] in the configuration".
    const char *listen_only;   ///< Reason why nothing is sent, and the fix.
    bool shutting_down;        ///< No client can arm any more.
} iwn_refuse_context_t;

/// Largest age of `arm`, `reset`, `release` and `confirm` if none is configured.
#define IWN_MAX_AGE_MS 1000U
/// A request may be this far ahead of the gateway's clock, because the clocks of one machine are read one after the
/// other.
#define IWN_AHEAD_MAX_US 100000U

/// Times by which a request that permits motion or clears a latch is judged.
typedef struct {
    iw_time_us_t now_us;     ///< Time of the gateway's clock.
    iw_time_us_t stopped_us; ///< Time of the last stop, and of the last request for one; 0 if there was none.
    uint32_t stop;           ///< Number of the last stop; 0 if there was none.
    uint32_t max_age_ms;     ///< Largest age of a request.
} iwn_moment_t;

/// Returns true and sets the refusal if `t_us` or `stop` of the request prevent its execution: it is too old, ahead of
/// the clock, older than the last stop, or refers to another stop than the last. Returns false for a request without
/// both.
bool iwn_refuse_late(const iwn_request_t *request, const iwn_moment_t *moment, iwn_refusal_t *out_refusal);

/// Writes the message and the error for a refusal of the core.
void iwn_refuse_describe(const iwn_refuse_context_t *context, const iwn_request_t *request, iw_refusal_t refusal,
                         iwn_refusal_t *out_refusal);

/// Does the same for a tare that was refused for this wheel.
void iwn_refuse_describe_tare(iw_side_t side, iw_tare_t result, iwn_refusal_t *out_refusal);

#ifdef __cplusplus
}
#endif
#endif
