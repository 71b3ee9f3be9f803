// SPDX-License-Identifier: MIT
#include "iwheel_northbound/why.h"

#include "iwheel_northbound/text.h"
#include "iwheel_northbound/words.h"

static const char *wheels(uint8_t sides) {
    static const char *const names[] = {"a wheel", "left wheel", "right wheel", "both wheels"};
    return names[sides & IW_SIDES_BOTH];
}

static const char *reboot_sign(uint32_t detail) {
    return (detail == IW_REBOOT_SILENCE)    ? "it sent nothing for a second"
           : (detail == IW_REBOOT_ODOMETRY) ? "its odometry jumped"
                                            : "it sent its start-up offset frames again";
}

static void add_number(iwn_text_t *text, int64_t number, const char *unit) {
    iwn_text_int(text, number);
    iwn_text_add(text, unit);
}

/// Returns the number of digits.
static unsigned hex_digits(uint32_t number) {
    unsigned digits = 1;
    while (number >= 16U) {
        number >>= 4;
        digits++;
    }
    return digits;
}

/// A cause as a clause, and the fix before `then`. In a clause, $w is the wheels, $n the detail as a number, $x the
/// detail in hexadecimal, $d the detail as text, $c the client, $r its reason, $b the bus, $e the e-stop.
typedef struct {
    const char *clause;
    const char *fix;
} row_t;

static const row_t rows[IW_CAUSES] = {
    [IW_CAUSE_NONE] = {"none", "nothing to do"},
    // Causes in the gateway.
    [IW_CAUSE_ESTOP_LINE] = {"e-stop $e $d", "release the button"},
    [IW_CAUSE_ESTOP_DISAGREES] = {"the two contacts of e-stop $e disagree",
                                  "fix contact or wire, press and release the button"},
    [IW_CAUSE_LOOP_HUNG] = {"the gateway itself was held up for $n ms", "see what else runs on this machine"},
    [IW_CAUSE_LOOP_LATE] = {"the gateway itself was held up for $n ms", "see what else runs on this machine"},
    [IW_CAUSE_INTERNAL] = {"an internal check failed ($n)", "report this with the log"},
    [IW_CAUSE_SHUTDOWN] = {"the gateway was shut down", "start it again to go on"},
    [IW_CAUSE_RESTART] = {"the gateway before this one died while the wheels were armed",
                          "find the crash in the log, then arm again"},
    // Causes by a person or a client.
    [IW_CAUSE_ESTOP_SOFTWARE] = {"software e-stop by $c$r", "make sure that it is safe"},
    [IW_CAUSE_LEASE_LOST] = {"$c sent no drive command for $n ms", "send drive commands more often or raise lease_ms"},
    [IW_CAUSE_CLIENT_GONE] = {"$c disconnected", "arm again to go on"},
    [IW_CAUSE_CLIENT_STOP] = {"$c requested a stop", "arm again to go on"},
    // Causes in the machine: bus and wheels.
    [IW_CAUSE_WHEEL_LOST] = {"$w sent no telemetry for $n ms", "check the wheel's power and cable"},
    [IW_CAUSE_WHEEL_REBOOTED] = {"$w rebooted ($d)", "check the wheel's power and cable"},
    [IW_CAUSE_SEND_STALLED] = {"setpoint not acknowledged on the bus for $n ms",
                               "check that the wheels have power and the bus is terminated"},
    [IW_CAUSE_BUS_DOWN] = {"bus $b is $d", "bring the bus up"},
    [IW_CAUSE_SECOND_MASTER] = {"another device sent a setpoint, id $n (0x$x)", "switch the other sender off"},
    [IW_CAUSE_FEEDBACK_SIGN] = {"$w turns against its command at $n mm/s", "check invert in the configuration"},
    [IW_CAUSE_OVERSPEED] = {"$w turns faster than commanded, at $n mm/s", "check radius, gear ratio and slope"},
    [IW_CAUSE_WHEEL_BLOCKED] = {"$w blocked: only $n mm/s", "remove what blocks the wheel"},
    [IW_CAUSE_PAIR_DIVERGES] =
        {"$w does not follow its command: the machine left its path by $n mm, right against left",
         "check that the wheel turns freely and drives"},
};

/// What a clause is about: the cause of a stop, or the first cause of its latch.
typedef struct {
    uint32_t detail;
    iw_cause_t cause;
    uint8_t sides;
} event_t;

static const char *detail_words(const event_t *event) {
    if (event->cause == IW_CAUSE_ESTOP_LINE) {
        return (event->detail == 2U) ? "unreadable or gone" : "pressed";
    }
    if (event->cause == IW_CAUSE_BUS_DOWN) {
        return (event->detail == IW_BUS_OFF) ? "bus-off" : "down or gone";
    }
    return reboot_sign(event->detail);
}

static const char *word_for(char part, const event_t *event, const iwn_why_context_t *context) {
    switch (part) {
    case 'w':
        return wheels(event->sides);
    case 'c':
        return (context->client != NULL) ? context->client : "a client";
    case 'b':
        return context->bus;
    case 'e':
        return context->estop;
    default:
        return detail_words(event);
    }
}

static void add_part(char part, const event_t *event, const iwn_why_context_t *context, iwn_text_t *text) {
    if (part == 'n') {
        iwn_text_int(text, event->detail);
    } else if (part == 'x') {
        iwn_text_hex(text, event->detail, hex_digits(event->detail));
    } else if (part != 'r') {
        iwn_text_add(text, word_for(part, event, context));
    } else if (context->reason != NULL && context->reason[0] != '\0') {
        IWN_TEXT_JOIN(text, " (\"", context->reason, "\")");
    }
}

static void add_clause(const event_t *event, const iwn_why_context_t *context, iwn_text_t *text) {
    const bool known = (unsigned)event->cause < IW_CAUSES;
    const char *clause = known ? rows[event->cause].clause : iwn_cause_name(event->cause);
    if (event->cause == IW_CAUSE_WHEEL_LOST && event->detail == UINT32_MAX) {
        clause = "$w never sent telemetry";
    }
    for (; *clause != '\0'; clause++) {
        if (*clause == '$') {
            clause++;
            add_part(*clause, event, context, text);
        } else {
            iwn_text_span(text, clause, 1U);
        }
    }
}

static const char *manner(const iw_stop_t *stop) {
    if (stop->from == IW_STATE_LATCHED) {
        return "still latched";
    }
    if (stop->from == IW_STATE_LISTENING && stop->cause != IW_CAUSE_RESTART) {
        return "nothing was being sent; latched";
    }
    if (stop->latched) {
        return stop->at_once ? "set to zero immediately, latched" : "ramped to zero, latched";
    }
    return stop->at_once ? "set to zero immediately" : "ramped to zero";
}

/// Appends the activity at the time of the stop.
static void add_doing(const iw_stop_t *stop, iwn_text_t *text) {
    if (stop->from == IW_STATE_ARMED || stop->from == IW_STATE_STOPPING) {
        iwn_text_add(text, (stop->from == IW_STATE_ARMED) ? " while driving " : " while stopping from ");
        add_number(text, stop->applied.wheel[IW_LEFT].speed_mm_s, "/");
        add_number(text, stop->applied.wheel[IW_RIGHT].speed_mm_s, " mm/s");
    } else if (stop->cause != IW_CAUSE_RESTART) { // Otherwise the gateway does not know it.
        IWN_TEXT_JOIN(text, " while ", iwn_state_name(stop->from));
    }
}

/// Appends seconds with three decimals.
static void add_time(iw_time_us_t at_us, iwn_text_t *text) {
    const iw_time_us_t ms = at_us / IW_US_PER_MS;
    const unsigned decimals = (unsigned)(ms % 1000U);
    add_number(text, (int64_t)(ms / 1000U), (decimals < 10U) ? ".00" : (decimals < 100U) ? ".0" : ".");
    add_number(text, decimals, " s");
}

void iwn_why_sentence(const iw_stop_t *stop, const iwn_why_context_t *context, char *out_sentence, size_t size) {
    iwn_text_t text = iwn_text_begin(out_sentence, size);
    if (stop->number == 0U) {
        iwn_text_add(&text, "no stop since the gateway started");
        return;
    }
    const event_t last = {stop->detail, stop->cause, stop->sides};
    const event_t first = {stop->first_detail, stop->first, stop->first_sides};
    // The client of the first stop may be another.
    const iwn_why_context_t bare = {.estop = context->estop, .bus = context->bus};
    add_clause(&last, context, &text);
    add_doing(stop, &text);
    if (stop->from == IW_STATE_LATCHED) {
        iwn_text_add(&text, ": ");
        add_clause(&first, &bare, &text);
    }
    IWN_TEXT_JOIN(&text, "; ", manner(stop), " at ");
    add_time(stop->at_us, &text);
    IWN_TEXT_JOIN(&text, "; ", iwn_why_fix(stop->cause));
    if (stop->first != stop->cause) {
        IWN_TEXT_JOIN(&text, ", ", iwn_why_fix(stop->first));
    }
    iwn_text_add(&text, iwn_why_then(stop->cause, stop->latched));
}

const char *iwn_why_fix(iw_cause_t cause) {
    return rows[((unsigned)cause < IW_CAUSES) ? cause : IW_CAUSE_INTERNAL].fix;
}

const char *iwn_why_then(iw_cause_t cause, bool latched) {
    if (latched) {
        return ", then: iwheelctl reset";
    }
    return (cause <= IW_CAUSE_LEASE_LOST) ? ", then arm again" : "";
}
