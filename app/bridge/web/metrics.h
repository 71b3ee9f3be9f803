// SPDX-License-Identifier: MIT
/// Writes the newest state as OpenMetrics text. Unknown values are omitted, so there is no invented zero. Pure: no I/O
/// except the output stream.
#ifndef WEB_METRICS_H
#define WEB_METRICS_H

#include "tally.h"

#include <stdio.h>

typedef struct {
    uint64_t watchers;    ///< Number of open event streams.
    uint64_t refused;     ///< Refused requests since the start of the bridge.
    uint64_t dropped;     ///< Dropped drive commands since the start.
    uint64_t connections; ///< Connections to the gateway since the start.
    uint64_t crowded_out; ///< Connections that were closed for newer ones, since the start.
} web_own_t;

/// `state`: the event `state`; NULL: the gateway is away, so only this and the metrics of the bridge are written.
void web_metrics_write(const iwc_message_t *state, const web_own_t *own, const web_tally_t *stops, FILE *out);

#endif
