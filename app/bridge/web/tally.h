// SPDX-License-Identifier: MIT
/// Counts the stops by cause, for /metrics. Pure: no clock, no I/O. One thread.
///
/// The gateway numbers its stops from 1 in each of its runs. A stop that the bridge saw neither as an event nor as the last one after it
/// connected again is counted without a cause. The stop that was there before the bridge connected for the first time is not counted.
#ifndef WEB_TALLY_H
#define WEB_TALLY_H

#include "iwheel_client/client.h"

#include <stdbool.h>
#include <stdint.h>

/// More than the protocol has causes.
#define WEB_CAUSES 32U

typedef struct {
    uint64_t by_cause[WEB_CAUSES]; ///< By iw_cause_t; 0: not known which.
    bool begun;                    ///< The last stop before the bridge is known, or that there was none.
    int64_t number;                ///< Of the last stop; 0: none.
    int64_t at_us;                 ///< Its time by the gateway's clock.
    int64_t wall_us;               ///< By the wall clock; 0: not known.
} web_tally_t;

/// Takes in an event `stop`, or a reply to `why`. The same stop counts once.
void web_tally_take(web_tally_t *self, const iwc_message_t *stop, bool is_event);

#endif
