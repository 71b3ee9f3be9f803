// SPDX-License-Identifier: MIT
#include "iwheel_northbound/why.h"

#include "iwheel_northbound/words.h"

#include <stdio.h>
#include <string.h>

static const char *wheels(uint8_t sides) {
    static const char *const names[] = {"a wheel", "left wheel", "right wheel", "both wheels"};
    return names[sides & IW_SIDES_BOTH];
}

static const char *reboot_evidence(uint32_t detail) {
    return detail == IW_REBOOT_SILENCE    ? "it was silent for a second"
           : detail == IW_REBOOT_ODOMETRY ? "its odometry jumped"
                                          : "its start-up offset frames came back";
}

static void lost_wheel(const iw_stop_t *stop, char *out, size_t size) {
    if (stop->detail == UINT32_MAX) {
        (void)snprintf(out, size, "%s never heard", wheels(stop->sides));
    } else {
        (void)snprintf(out, size, "%s not heard for %u ms", wheels(stop->sides), (unsigned)stop->detail);
    }
}

static void software_estop(const char *client, const iwn_why_context_t *context, char *out, size_t size) {
    const char *reason = context->reason == NULL ? "" : context->reason;
    (void)snprintf(out, size, "software e-stop by %s%s%s%s", client, *reason == '\0' ? "" : " (\"", reason,
                   *reason == '\0' ? "" : "\")");
}

/// Causes in the machine: bus and wheels.
static void machine_clause(const iw_stop_t *stop, const iwn_why_context_t *context, char *out, size_t size) {
    const unsigned detail = stop->detail;
    switch (stop->cause) {
    case IW_CAUSE_WHEEL_LOST:
        lost_wheel(stop, out, size);
        break;
    case IW_CAUSE_WHEEL_REBOOTED:
        (void)snprintf(out, size, "%s rebooted (%s)", wheels(stop->sides), reboot_evidence(detail));
        break;
    case IW_CAUSE_SEND_STALLED:
        (void)snprintf(out, size, "setpoint not acknowledged on the bus for %u ms", detail);
        break;
    case IW_CAUSE_BUS_DOWN:
        (void)snprintf(out, size, "bus %s %s", context->bus, detail == IW_BUS_OFF ? "is bus-off" : "is down or gone");
        break;
    case IW_CAUSE_SECOND_MASTER:
        (void)snprintf(out, size, "somebody else sent a setpoint, id %u (0x%X)", detail, detail);
        break;
    case IW_CAUSE_FEEDBACK_SIGN:
        (void)snprintf(out, size, "%s turns against its command at %u mm/s", wheels(stop->sides), detail);
        break;
    case IW_CAUSE_OVERSPEED:
        (void)snprintf(out, size, "%s turns faster than told, at %u mm/s", wheels(stop->sides), detail);
        break;
    case IW_CAUSE_WHEEL_BLOCKED:
        (void)snprintf(out, size, "%s blocked: only %u mm/s", wheels(stop->sides), detail);
        break;
    default:
        (void)snprintf(out, size, "%s", iwn_cause_name(stop->cause));
        break;
    }
}

/// Causes on our side: people, clients, ourselves; the rest by `machine_clause`.
static void clause(const iw_stop_t *stop, const iwn_why_context_t *context, char *out, size_t size) {
    const char *client = context->client == NULL ? "a client" : context->client;
    const unsigned detail = stop->detail;
    switch (stop->cause) {
    case IW_CAUSE_ESTOP_LINE:
        (void)snprintf(out, size, "e-stop %s %s", context->estop, detail == 2U ? "unreadable or gone" : "pressed");
        break;
    case IW_CAUSE_ESTOP_SOFTWARE:
        software_estop(client, context, out, size);
        break;
    case IW_CAUSE_LOOP_HUNG:
    case IW_CAUSE_LOOP_LATE:
        (void)snprintf(out, size, "the gateway itself was held up for %u ms", detail);
        break;
    case IW_CAUSE_INTERNAL:
        (void)snprintf(out, size, "an internal check failed (%u)", detail);
        break;
    case IW_CAUSE_LEASE_LOST:
        (void)snprintf(out, size, "%s sent no drive command for %u ms", client, detail);
        break;
    case IW_CAUSE_CLIENT_GONE:
        (void)snprintf(out, size, "%s disconnected", client);
        break;
    case IW_CAUSE_CLIENT_STOP:
        (void)snprintf(out, size, "%s said stop", client);
        break;
    case IW_CAUSE_SHUTDOWN:
        (void)snprintf(out, size, "the gateway was told to end");
        break;
    case IW_CAUSE_RESTART:
        (void)snprintf(out, size, "the gateway before this one died while the wheels were armed");
        break;
    default:
        machine_clause(stop, context, out, size);
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
    return stop->cause == IW_CAUSE_LOOP_LATE || stop->cause == IW_CAUSE_RESTART ? "zero at once" : "ramped to zero";
}

void iwn_why_sentence(const iw_stop_t *stop, const iwn_why_context_t *context, char *out_sentence, size_t size) {
    char what[384];
    char doing[64];
    if (stop->number == 0U) {
        (void)snprintf(out_sentence, size, "no stop since the gateway started");
        return;
    }
    clause(stop, context, what, sizeof what);
    const bool ours = stop->cause != IW_CAUSE_RESTART; // Else nobody here knows what was going on.
    (void)snprintf(doing, sizeof doing, "%s%s", ours ? " while " : "", ours ? iwn_state_name(stop->from) : "");
    if (stop->from == IW_STATE_ARMED || stop->from == IW_STATE_STOPPING) {
        (void)snprintf(doing, sizeof doing, " while %s %d/%d mm/s",
                       stop->from == IW_STATE_ARMED ? "driving" : "stopping from",
                       stop->applied.wheel[IW_LEFT].speed_mm_s, stop->applied.wheel[IW_RIGHT].speed_mm_s);
    }
    const unsigned long long ms = (unsigned long long)(stop->at_us / IW_US_PER_MS);
    (void)snprintf(out_sentence, size, "%s%s; %s at %llu.%03llu s; %s", what, doing, manner(stop), ms / 1000U,
                   ms % 1000U, iwn_why_cure(stop->cause));
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
    return (unsigned)cause < IW_CAUSES ? cures[cause] : cures[IW_CAUSE_INTERNAL];
}
