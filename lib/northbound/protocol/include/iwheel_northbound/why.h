// SPDX-License-Identifier: MIT
/// @file
/// Why did the wheels stop? One sentence with cause, time and numbers, made when it happened: later the client may be
/// gone and the wheels elsewhere.
#ifndef IWHEEL_NORTHBOUND_WHY_H
#define IWHEEL_NORTHBOUND_WHY_H

#include "iwheel/gateway.h"

#define IWN_SENTENCE_SIZE 640U ///< Room for any sentence, with its terminator.

/// What is known of the stop besides what the core knows. `client` and `reason` may be NULL.
typedef struct {
    const char *client; ///< As gw_client_describe writes it.
    const char *reason; ///< The client's words with a software e-stop.
    const char *estop;  ///< Name of the e-stop line.
    const char *bus;    ///< Name of the bus.
} iwn_why_context_t;

/// A stop as it is kept for `why`.
typedef struct {
    iw_stop_t stop;                   ///< number 0: there was none.
    int64_t wall_us;                  ///< When, by the wall clock: us since 1970.
    char client_name[65];             ///< Of who held the lease or asked; empty: nobody, or no name.
    char sentence[IWN_SENTENCE_SIZE]; ///< As `iwn_why_sentence` wrote it.
} iwn_stop_note_t;

/// Writes the sentence for a stop. Pure.
void iwn_why_sentence(const iw_stop_t *stop, const iwn_why_context_t *context, char *out_sentence, size_t size);

/// What to do about a cause, for refusals too.
const char *iwn_why_cure(iw_cause_t cause);

/// What follows it: the reset, where the cause latches. Apart, since most causes have it.
const char *iwn_why_then(iw_cause_t cause);

#endif
