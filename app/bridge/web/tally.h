// SPDX-License-Identifier: MIT
/// Counts the stops by cause, for /metrics. Pure: no clock, no I/O. One thread.
///
/// The gateway numbers its stops from 1 in each run. A stop that the bridge received neither as an event nor as the
/// last one after a reconnection is counted without a cause. The last stop before the first connection of the bridge is
/// not counted.
#ifndef WEB_TALLY_H
#define WEB_TALLY_H

#include "iwheel_client/client.h"

#include <stdbool.h>
#include <stdint.h>

/// Upper bound of the number of causes of the protocol.
#define WEB_CAUSES 32U

typedef struct {
    uint64_t by_cause[WEB_CAUSES]; ///< By iw_cause_t; 0: unknown.
    bool begun;                    ///< The last stop before the first connection is known, or there was none.
    int64_t number;                ///< Number of the last stop; 0: none.
    int64_t at_us;                 ///< Its time by the clock of the gateway.
    int64_t wall_us;               ///< Its wall clock; 0: unknown.
} web_tally_t;

/// Counts an event `stop`, or a reply to `why`. The same stop is counted once.
void web_tally_take(web_tally_t *self, const iwc_message_t *stop, bool is_event);

#endif
