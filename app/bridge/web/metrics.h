// SPDX-License-Identifier: MIT
/// The newest state as OpenMetrics text. What is not known is left out: no invented zero. Pure but for the stream.
#ifndef WEB_METRICS_H
#define WEB_METRICS_H

#include "tally.h"

#include <stdio.h>

typedef struct {
    uint64_t watchers;    ///< Event streams open now.
    uint64_t refused;     ///< Requests refused since the bridge's start.
    uint64_t dropped;     ///< Drive commands dropped since then.
    uint64_t connections; ///< To the gateway, made since then.
    uint64_t crowded_out; ///< Connections closed since then to make room for others.
} web_own_t;

/// `state`: the event `state`; NULL: the gateway is not there, and only that and the bridge's own figures are told.
void web_metrics_write(const iwc_message_t *state, const web_own_t *own, const web_tally_t *stops, FILE *out);

#endif
