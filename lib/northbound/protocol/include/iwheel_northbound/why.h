// SPDX-License-Identifier: MIT
/// @file
/// Writes the sentence about a stop, with cause, time and values. It is written at the time of the stop, because later
/// the client may be gone and the values different.
#ifndef IWHEEL_NORTHBOUND_WHY_H
#define IWHEEL_NORTHBOUND_WHY_H

#include "iwheel/gateway.h"

#ifdef __cplusplus
extern "C" {
#endif

#define IWN_SENTENCE_SIZE 640U ///< Size of the longest sentence, with its terminator.

/// Data about a stop outside the core. `client` and `reason` may be NULL.
typedef struct {
    const char *client; ///< Client as in messages: `"joystick" (client 3)` (iwn_target_name).
    const char *reason; ///< Reason in the client's e-stop request.
    const char *estop;  ///< Name of the e-stop line.
    const char *bus;    ///< Name of the bus.
} iwn_why_context_t;

/// Record of a stop for `why`.
typedef struct {
    iw_stop_t stop;       ///< `number` 0: there was none.
    int64_t wall_us;      ///< Wall clock time in us since 1970.
    char client_name[65]; ///< Name of the client that held the lease or requested the stop; empty if there is none.
    char sentence[IWN_SENTENCE_SIZE]; ///< Result of `iwn_why_sentence`.
} iwn_stop_note_t;

/// Writes the sentence for a stop. Pure function.
void iwn_why_sentence(const iw_stop_t *stop, const iwn_why_context_t *context, char *out_sentence, size_t size);

/// Returns the fix for a cause, also for refusals.
const char *iwn_why_fix(iw_cause_t cause);

/// Returns the next step after the fix: the reset if `latched`, otherwise arm. Separate, because most causes have it.
const char *iwn_why_then(iw_cause_t cause, bool latched);

#ifdef __cplusplus
}
#endif
#endif
