// SPDX-License-Identifier: MIT
#include "iwheel_northbound/why.h"

#include "iwheel_northbound/text.h"
#include "iwheel_northbound/words.h"

static const char *wheels(uint8_t sides) {
    static const char *const names[] = {"a wheel", "left wheel", "right wheel", "both wheels"};
    return names[sides & IW_SIDES_BOTH];
}

static const char *reboot_evidence(uint32_t detail) {
    return (detail == IW_REBOOT_SILENCE)    ? "it was silent for a second"
           : (detail == IW_REBOOT_ODOMETRY) ? "its odometry jumped"
                                            : "its start-up offset frames came back";
}

static void add_number(iwn_text_t *text, int64_t number, const char *unit) {
    iwn_text_int(text, number);
    IWN_TEXT_JOIN(text, unit);
}

/// How many it takes.
static unsigned hex_digits(uint32_t number) {
    unsigned digits = 1;
    while (number >= 16U) {
        number >>= 4;
        digits++;
    }
    return digits;
}

static void add_lost_wheel(const iw_stop_t *stop, iwn_text_t *text) {
    if (stop->detail == UINT32_MAX) {
        IWN_TEXT_JOIN(text, wheels(stop->sides), " never heard");
    } else {
        IWN_TEXT_JOIN(text, wheels(stop->sides), " not heard for ");
        add_number(text, stop->detail, " ms");
    }
}

/// Causes in the machine: bus and wheels.
static void add_machine_clause(const iw_stop_t *stop, const iwn_why_context_t *context, iwn_text_t *text) {
    const char *const sides = wheels(stop->sides);
    switch (stop->cause) {
    case IW_CAUSE_WHEEL_LOST:
        add_lost_wheel(stop, text);
        break;
    case IW_CAUSE_WHEEL_REBOOTED:
        IWN_TEXT_JOIN(text, sides, " rebooted (", reboot_evidence(stop->detail), ")");
        break;
    case IW_CAUSE_SEND_STALLED:
        IWN_TEXT_JOIN(text, "setpoint not acknowledged on the bus for ");
        add_number(text, stop->detail, " ms");
        break;
    case IW_CAUSE_BUS_DOWN:
        IWN_TEXT_JOIN(text, "bus ", context->bus, (stop->detail == IW_BUS_OFF) ? " is bus-off" : " is down or gone");
        break;
    case IW_CAUSE_SECOND_MASTER:
        IWN_TEXT_JOIN(text, "somebody else sent a setpoint, id ");
        add_number(text, stop->detail, " (0x");
        iwn_text_hex(text, stop->detail, hex_digits(stop->detail));
        IWN_TEXT_JOIN(text, ")");
        break;
    case IW_CAUSE_FEEDBACK_SIGN:
        IWN_TEXT_JOIN(text, sides, " turns against its command at ");
        add_number(text, stop->detail, " mm/s");
        break;
    case IW_CAUSE_OVERSPEED:
        IWN_TEXT_JOIN(text, sides, " turns faster than told, at ");
        add_number(text, stop->detail, " mm/s");
        break;
    case IW_CAUSE_WHEEL_BLOCKED:
        IWN_TEXT_JOIN(text, sides, " blocked: only ");
        add_number(text, stop->detail, " mm/s");
        break;
    default:
        IWN_TEXT_JOIN(text, iwn_cause_name(stop->cause));
        break;
    }
}

/// Causes that a person or a client is behind; the rest by `add_machine_clause`.
static void add_client_clause(const iw_stop_t *stop, const iwn_why_context_t *context, iwn_text_t *text) {
    const char *const client = (context->client != NULL) ? context->client : "a client";
    const char *const reason = (context->reason != NULL) ? context->reason : "";
    switch (stop->cause) {
    case IW_CAUSE_ESTOP_SOFTWARE:
        IWN_TEXT_JOIN(text, "software e-stop by ", client, (*reason != '\0') ? " (\"" : "", reason,
                      (*reason != '\0') ? "\")" : "");
        break;
    case IW_CAUSE_LEASE_LOST:
        IWN_TEXT_JOIN(text, client, " sent no drive command for ");
        add_number(text, stop->detail, " ms");
        break;
    case IW_CAUSE_CLIENT_GONE:
        IWN_TEXT_JOIN(text, client, " disconnected");
        break;
    case IW_CAUSE_CLIENT_STOP:
        IWN_TEXT_JOIN(text, client, " said stop");
        break;
    default:
        add_machine_clause(stop, context, text);
        break;
    }
}

/// Causes on our side; the rest by `add_client_clause`.
static void add_clause(const iw_stop_t *stop, const iwn_why_context_t *context, iwn_text_t *text) {
    switch (stop->cause) {
    case IW_CAUSE_ESTOP_LINE:
        IWN_TEXT_JOIN(text, "e-stop ", context->estop, (stop->detail == 2U) ? " unreadable or gone" : " pressed");
        break;
    case IW_CAUSE_LOOP_HUNG:
    case IW_CAUSE_LOOP_LATE:
        IWN_TEXT_JOIN(text, "the gateway itself was held up for ");
        add_number(text, stop->detail, " ms");
        break;
    case IW_CAUSE_INTERNAL:
        IWN_TEXT_JOIN(text, "an internal check failed (");
        add_number(text, stop->detail, ")");
        break;
    case IW_CAUSE_SHUTDOWN:
        IWN_TEXT_JOIN(text, "the gateway was told to end");
        break;
    case IW_CAUSE_RESTART:
        IWN_TEXT_JOIN(text, "the gateway before this one died while the wheels were armed");
        break;
    default:
        add_client_clause(stop, context, text);
        break;
    }
}

static const char *manner(const iw_stop_t *stop) {
    if (stop->from == IW_STATE_LISTENING && stop->cause != IW_CAUSE_RESTART) {
        return "nothing was being sent; latched";
    }
    if (stop->latched) {
        return "zero at once, latched";
    }
    return (stop->cause == IW_CAUSE_LOOP_LATE || stop->cause == IW_CAUSE_RESTART) ? "zero at once" : "ramped to zero";
}

/// What was going on.
static void add_doing(const iw_stop_t *stop, iwn_text_t *text) {
    if (stop->from == IW_STATE_ARMED || stop->from == IW_STATE_STOPPING) {
        IWN_TEXT_JOIN(text, (stop->from == IW_STATE_ARMED) ? " while driving " : " while stopping from ");
        add_number(text, stop->applied.wheel[IW_LEFT].speed_mm_s, "/");
        add_number(text, stop->applied.wheel[IW_RIGHT].speed_mm_s, " mm/s");
    } else if (stop->cause != IW_CAUSE_RESTART) { // Then nobody here knows.
        IWN_TEXT_JOIN(text, " while ", iwn_state_name(stop->from));
    }
}

/// In seconds, with three decimals.
static void add_time(iw_time_us_t at_us, iwn_text_t *text) {
    const iw_time_us_t ms = at_us / IW_US_PER_MS;
    const unsigned decimals = (unsigned)(ms % 1000U);
    add_number(text, (int64_t)(ms / 1000U), (decimals < 10U) ? ".00" : (decimals < 100U) ? ".0" : ".");
    add_number(text, decimals, " s");
}

void iwn_why_sentence(const iw_stop_t *stop, const iwn_why_context_t *context, char *out_sentence, size_t size) {
    iwn_text_t text = iwn_text_begin(out_sentence, size);
    if (stop->number == 0U) {
        IWN_TEXT_JOIN(&text, "no stop since the gateway started");
        return;
    }
    add_clause(stop, context, &text);
    add_doing(stop, &text);
    IWN_TEXT_JOIN(&text, "; ", manner(stop), " at ");
    add_time(stop->at_us, &text);
    IWN_TEXT_JOIN(&text, "; ", iwn_why_cure(stop->cause));
}

const char *iwn_why_cure(iw_cause_t cause) {
    static const char *const cures[IW_CAUSES] = {
        [IW_CAUSE_NONE] = "nothing to do",
        [IW_CAUSE_ESTOP_LINE] = "release the button, then: iwheelctl reset",
        [IW_CAUSE_ESTOP_SOFTWARE] = "when it is safe: iwheelctl reset",
        [IW_CAUSE_WHEEL_LOST] = "check the wheel's power and cable, then: iwheelctl reset",
        [IW_CAUSE_WHEEL_REBOOTED] = "check the wheel's power, then: iwheelctl reset",
        [IW_CAUSE_SEND_STALLED] = "check that the wheels have power and the bus is terminated, then: iwheelctl reset",
        [IW_CAUSE_BUS_DOWN] = "bring the bus up, then: iwheelctl reset",
        [IW_CAUSE_SECOND_MASTER] = "switch the other sender off, then: iwheelctl reset",
        [IW_CAUSE_FEEDBACK_SIGN] = "check invert in the configuration, then: iwheelctl reset",
        [IW_CAUSE_OVERSPEED] = "check radius, gear ratio and slope, then: iwheelctl reset",
        [IW_CAUSE_LOOP_HUNG] = "see what else runs on this machine, then: iwheelctl reset",
        [IW_CAUSE_INTERNAL] = "report this with the log, then: iwheelctl reset",
        [IW_CAUSE_LOOP_LATE] = "see what else runs on this machine, then arm again",
        [IW_CAUSE_WHEEL_BLOCKED] = "remove what blocks the wheel, then arm again",
        [IW_CAUSE_LEASE_LOST] = "send drive commands more often or raise lease_ms, then arm again",
        [IW_CAUSE_CLIENT_GONE] = "arm again to go on",
        [IW_CAUSE_CLIENT_STOP] = "arm again to go on",
        [IW_CAUSE_SHUTDOWN] = "start it again to go on",
        [IW_CAUSE_RESTART] = "look for the crash in the log, then arm again",
    };
    return ((unsigned)cause < IW_CAUSES) ? cures[cause] : cures[IW_CAUSE_INTERNAL];
}
