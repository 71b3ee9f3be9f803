// SPDX-License-Identifier: MIT
#include "cause.h"

#include "arithmetic.h"

IW_STATIC_ASSERT(IW_CAUSES <= 32, one_bit_per_cause);

/// One row per cause: effect, level or event, with or without a ramp, and refusal while present. R2, R7 and R13 define
/// which causes latch.
const iw_cause_row_t iw_cause_rows[IW_CAUSES] = {
    [IW_CAUSE_NONE] = {IW_STOPS, false, false, IW_REFUSE_NONE},
    [IW_CAUSE_ESTOP_LINE] = {IW_ALWAYS_LATCHES, true, true, IW_REFUSE_ESTOP_PRESSED},
    [IW_CAUSE_ESTOP_DISAGREES] = {IW_ALWAYS_LATCHES, true, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_ESTOP_SOFTWARE] = {IW_ALWAYS_LATCHES, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_BUS_DOWN] = {IW_LATCHES, true, true, IW_REFUSE_BUS_DOWN},
    [IW_CAUSE_SECOND_MASTER] = {IW_LATCHES, false, true, IW_REFUSE_SECOND_MASTER},
    [IW_CAUSE_SEND_STALLED] = {IW_LATCHES, true, true, IW_REFUSE_SEND_STALLED},
    [IW_CAUSE_WHEEL_REBOOTED] = {IW_LATCHES, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_WHEEL_LOST] = {IW_LATCHES, true, true, IW_REFUSE_WHEEL_LOST},
    [IW_CAUSE_FEEDBACK_SIGN] = {IW_LATCHES, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_OVERSPEED] = {IW_LATCHES, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_LOOP_HUNG] = {IW_LATCHES, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_INTERNAL] = {IW_ALWAYS_LATCHES, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_LOOP_LATE] = {IW_STOPS, false, true, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_WHEEL_BLOCKED] = {IW_STOPS, false, false, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_PAIR_DIVERGES] = {IW_STOPS, false, false, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_LEASE_LOST] = {IW_STOPS, false, false, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_CLIENT_GONE] = {IW_STOPS, false, false, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_CLIENT_STOP] = {IW_STOPS, false, false, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_SHUTDOWN] = {IW_STOPS, false, false, IW_REFUSE_CAUSE_PRESENT},
    [IW_CAUSE_RESTART] = {IW_STOPS, false, true, IW_REFUSE_CAUSE_PRESENT},
};

/// The latching causes come first in iw_cause_t.
#define FIRST IW_CAUSE_ESTOP_LINE
#define LAST  IW_CAUSE_INTERNAL

bool iw_cause_latches(iw_cause_t cause) {
    return iw_cause_rows[cause].effect != IW_STOPS;
}

uint32_t iw_cause_present(uint32_t reported, const iw_time_us_t seen_us[IW_CAUSES], iw_time_us_t now_us) {
    uint32_t present = 0;
    for (uint32_t cause = FIRST; cause <= LAST; cause++) {
        const uint32_t bit = IW_CAUSE_BIT(cause);
        const bool is = iw_cause_rows[cause].level ? (reported & bit) != 0U
                                                   : iw_age_us(seen_us[cause], now_us) < IW_PERMIT_EVENT_US;
        present |= is ? bit : 0U;
    }
    return present;
}

bool iw_cause_is_new_estop(iw_cause_t cause, const iw_time_us_t seen_us[IW_CAUSES], iw_time_us_t now_us) {
    return (cause == IW_CAUSE_ESTOP_LINE || cause == IW_CAUSE_ESTOP_SOFTWARE) &&
           iw_age_us(seen_us[cause], now_us) >= IW_PERMIT_EVENT_US;
}

/// The first of several causes determines the refusal. The order of iw_cause_t puts a cause before its consequences:
/// for example, a bus that is down also loses echoes and wheels.
iw_refusal_t iw_cause_refusal(uint32_t present) {
    for (uint32_t cause = FIRST; cause <= LAST; cause++) {
        if ((present & IW_CAUSE_BIT(cause)) != 0U) {
            return (iw_refusal_t)iw_cause_rows[cause].refusal;
        }
    }
    return IW_REFUSE_NONE;
}
