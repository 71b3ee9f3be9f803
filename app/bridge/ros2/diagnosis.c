// SPDX-License-Identifier: MIT
#include "diagnosis.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

__attribute__((format(printf, 3, 4))) static void set(ros_status_t *status, ros_level_t level, const char *format,
                                                      ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(status->message, sizeof status->message, format, arguments);
    va_end(arguments);
    status->level = level;
}

static void add(ros_status_t *status, const char *key, bool known, int64_t number) {
    ros_value_t *value = &status->values[status->value_count++];
    value->key = key;
    value->text[0] = '\0';
    if (known) {
        (void)snprintf(value->text, sizeof value->text, "%" PRId64, number);
    }
}

static const char *word(iwc_machine_t machine) {
    static const char *const words[] = {"unknown", "listening", "armed", "stopping", "latched"};
    return words[machine];
}

static void report_gateway(const ros_facts_t *facts, ros_status_t *status) {
    static const char rolls[] =
        "a wheel turns although the gateway sends nothing to it: hold the machine, or use its parking brake";
    const ros_machine_t *machine = &facts->machine;
    add(status, "lease_ms", true, machine->lease_ms);
    add(status, "odometry_restarts", true, facts->odometry_restarts);
    add(status, "holding", true, machine->holding ? 1 : 0);
    add(status, "rolling", true, machine->rolling ? 1 : 0);
    if (facts->link == ROS_LINK_GONE) {
        set(status, ROS_ERROR,
            "the gateway is gone: %s; the wheels that it drove stop on their own; arm again when it is back",
            facts->trouble);
    } else if (facts->link == ROS_LINK_SILENT) {
        set(status, ROS_ERROR, "the gateway does not answer; see its log (journalctl -u iwheel-gateway)");
    } else if (machine->now.machine == IWC_LATCHED && machine->rolling) {
        set(status, ROS_ERROR, "%s; stopped and latched: %s", rolls, machine->stop);
    } else if (machine->now.machine == IWC_LATCHED) {
        set(status, ROS_ERROR, "stopped and latched: %s; remove the cause, reset (iwheelctl reset), then arm again",
            machine->stop);
    } else if (machine->now.machine == IWC_STOPPING && machine->holding) {
        set(status, ROS_WARN, "holding: zeros until iwheelctl release or arm; use the parking brake; the stop: %s",
            machine->stop);
    } else if (machine->now.machine == IWC_STOPPING) {
        set(status, ROS_WARN, "stopping: %s", machine->stop);
    } else if (machine->now.machine == IWC_ARMED) {
        set(status, ROS_OK, "armed by %s", machine->now.ours ? "this bridge" : machine->holder);
    } else if (machine->rolling) {
        set(status, ROS_WARN, "%s", rolls);
    } else if (machine->stop[0] != '\0') {
        set(status, ROS_OK, "listening, call iwheel/arm to drive; the last stop: %s", machine->stop);
    } else {
        set(status, ROS_OK, "listening, call iwheel/arm to drive");
    }
}

static void report_estop(const ros_facts_t *facts, ros_status_t *status) {
    const char *state = facts->machine.estop;
    const bool untried = !facts->machine.estop_tried && !facts->machine.estop_simulated;
    if (strcmp(state, "released") == 0) {
        set(status, untried ? ROS_WARN : ROS_OK, "released%s",
            untried ? ", but the button was never tried on this wiring: press it, then release it" : "");
    } else if (strcmp(state, "none") == 0) {
        set(status, ROS_WARN,
            "there is no e-stop line: no button of this machine stops the wheels; see [estop] line in gateway.conf");
    } else if (strcmp(state, "disagrees") == 0) {
        set(status, ROS_ERROR,
            "the e-stop's two contacts disagree, pressed at %s: fix contact or wire, press and release the button, "
            "then reset and arm again",
            facts->machine.pressed_at);
    } else if (strcmp(state, "pressed") == 0 && strncmp(facts->machine.pressed_at, "line", 4U) == 0) {
        set(status, ROS_ERROR, "the e-stop is pressed at its contact %s: release the button, reset, then arm again",
            facts->machine.pressed_at);
    } else if (strcmp(state, "pressed") == 0) {
        set(status, ROS_ERROR, "the e-stop is pressed: release the button, reset (iwheelctl reset), then arm again");
    } else {
        set(status, ROS_ERROR,
            "the e-stop line is %s, which counts as pressed: check its wire, then reset and arm again", state);
    }
}

static void report_bus(const ros_facts_t *facts, ros_status_t *status) {
    const char *state = facts->machine.bus;
    if (strcmp(state, "active") == 0) {
        set(status, ROS_OK, "active");
    } else if (strcmp(state, "passive") == 0) {
        set(status, ROS_WARN, "error passive: there are errors on the bus; check cable and termination");
    } else if (strcmp(state, "bus_off") == 0) {
        set(status, ROS_ERROR,
            "bus off: the controller has left the bus; check cable and bit rate, restart the link, reset, arm again");
    } else {
        set(status, ROS_ERROR, "the bus is down: ip link set can0 up (see iwheelctl doctor), then reset and arm again");
    }
}

static void report_timing(const ros_facts_t *facts, ros_status_t *status) {
    const char *timing = facts->machine.timing;
    if (strcmp(timing, "contradicted") == 0) {
        set(status, ROS_ERROR,
            "bit rate or sample point differ from the wheels': set 1 Mbit/s, 62.5 %%; see iwheelctl doctor");
    } else if (strcmp(timing, "near") == 0) {
        set(status, ROS_WARN, "the sample point differs slightly from 62.5 %%; see iwheelctl doctor");
    } else {
        set(status, ROS_OK, "bit timing %s", timing);
    }
}

static void report_wheel(const iwc_wheel_t *wheel, ros_status_t *status) {
    add(status, "speed_mm_s", wheel->speed_mm_s.known, wheel->speed_mm_s.value);
    add(status, "applied_mm_s", wheel->applied_mm_s.known, wheel->applied_mm_s.value);
    add(status, "distance_mm", wheel->distance_mm.known, wheel->distance_mm.value);
    add(status, "force_net_mN", wheel->force_net_mN.known, wheel->force_net_mN.value);
    add(status, "battery_dV", wheel->battery_dV.known, wheel->battery_dV.value);
    add(status, "temperature_degC", wheel->temperature_degC.known, wheel->temperature_degC.value);
    if (!wheel->heard) {
        set(status, ROS_ERROR, "no telemetry: check power and cable of the wheel, then reset and arm again");
    } else if (wheel->at_rest.value != 0) {
        set(status, ROS_OK, "online, at standstill");
    } else {
        set(status, ROS_OK, "online, turning");
    }
}

static void report_assumptions(const ros_facts_t *facts, ros_status_t *status) {
    add(status, "assumed", true, facts->machine.assumed);
    if (facts->machine.contradicted[0] != '\0') {
        set(status, ROS_ERROR, "%s", facts->machine.contradicted);
    } else if (facts->machine.assumed > 0) {
        set(status, ROS_OK, "%u assumptions are not verified yet; see iwheelctl learn and bringup",
            facts->machine.assumed);
    } else {
        set(status, ROS_OK, "all assumptions are confirmed");
    }
}

/// Reports publishers that DDS does not connect to the reader of cmd_vel.
static void report_unmatched(const ros_unmatched_t *unmatched, ros_status_t *status) {
    if (unmatched->policy[0] != '\0') {
        set(status, ROS_WARN,
            "%u publishers of %s are not received: the QoS policy %s of a publisher of %s does not match; publish with "
            "ROS's default QoS",
            unmatched->count, unmatched->topic, unmatched->policy, unmatched->type);
    } else {
        set(status, ROS_WARN,
            "%u publishers of %s are not received: one sends %s; publish %s, or set [drive] command = both in "
            "ros2.conf",
            unmatched->count, unmatched->topic, unmatched->type, unmatched->wanted);
    }
}

/// Reports the commands that came, or why none come.
static void report_flow(const ros_commands_t *commands, int64_t lease_ms, ros_status_t *status) {
    if (commands->coming && commands->unusable) {
        set(status, ROS_WARN,
            "the commands have no usable numbers (NaN, infinity, or 32 m/s or rad/s and more): dropped, "
            "%" PRIu64 " so far; fix the program that publishes them",
            commands->bad);
    } else if (commands->coming && commands->refusal[0] != '\0') {
        set(status, ROS_WARN, "commands are refused: %s", commands->refusal);
    } else if (commands->coming && commands->unknown > 0 && commands->passed == 0) {
        set(status, ROS_WARN,
            "%" PRIu64
            " commands of publishers on other machines were dropped because their clocks are not known yet: publish "
            "zeros for a second first, at 2 Hz or more; a publisher for each command never becomes known",
            commands->unknown);
    } else if (commands->publishers == 0U && commands->unmatched.elsewhere[0] != '\0') {
        set(status, ROS_OK, "no publisher of %s, but %s has one: remap it if it is meant for this machine",
            commands->unmatched.topic, commands->unmatched.elsewhere);
    } else if (commands->late > 0 || commands->bad > 0) {
        set(status, ROS_WARN,
            "%" PRIu64 " commands came too late, %" PRIu64
            " had no usable numbers: dropped; check the network and the program that publishes them",
            commands->late, commands->bad);
    } else {
        set(status, ROS_OK,
            "send cmd_vel at %" PRId64 " Hz or more: a pause above %" PRId64 " ms stops the wheels, then arm again",
            (3000 + lease_ms - 1) / lease_ms, lease_ms);
    }
}

static void report_commands(const ros_facts_t *facts, ros_status_t *status) {
    const ros_commands_t *commands = &facts->commands;
    const int64_t lease_ms = (facts->machine.lease_ms > 0) ? facts->machine.lease_ms : 200;
    add(status, "publishers", true, commands->publishers);
    add(status, "passed", true, (int64_t)commands->passed);
    add(status, "dropped_late", true, (int64_t)commands->late);
    add(status, "dropped_unknown", true, (int64_t)commands->unknown);
    add(status, "dropped_others", true, (int64_t)commands->others);
    add(status, "dropped_bad", true, (int64_t)commands->bad);
    add(status, "dropped_unsent", true, (int64_t)commands->unsent);
    add(status, "refused", true, (int64_t)commands->refused);
    add(status, "not_received", true, (int64_t)commands->unmatched.count);
    add(status, "needed_hz", true, (3000 + lease_ms - 1) / lease_ms);
    if (!facts->drive) {
        set(status, ROS_OK, "watching only: [drive] enabled = no");
    } else if (facts->link != ROS_LINK_GONE && facts->machine.setpoint_current) {
        set(status, ROS_WARN,
            "current_role = setpoint: a twist carries no current, so this bridge cannot drive such a machine; it only "
            "watches");
    } else if (commands->unmatched.count > 0U) {
        report_unmatched(&commands->unmatched, status);
    } else if (commands->publishers > 1U) {
        set(status, ROS_WARN,
            "%u publishers of cmd_vel: only the one that drives first after arm is obeyed until the wheels stop; put "
            "twist_mux in between",
            commands->publishers);
    } else {
        report_flow(commands, lease_ms, status);
    }
}

void ros_diagnose(const ros_facts_t *facts, ros_report_t which, ros_status_t *out_status) {
    static const char *const names[ROS_REPORTS] = {"gateway",    "e-stop",      "bus",         "bus timing",
                                                   "left wheel", "right wheel", "assumptions", "cmd_vel"};
    out_status->name = names[which];
    out_status->value_count = 0;
    if (facts->link != ROS_LINK_UP && which != ROS_REPORT_GATEWAY && which != ROS_REPORT_COMMANDS) {
        set(out_status, ROS_STALE, "not known: the gateway %s",
            (facts->link == ROS_LINK_GONE) ? "is gone" : "does not answer");
        return;
    }
    switch (which) {
    case ROS_REPORT_GATEWAY:
        report_gateway(facts, out_status);
        break;
    case ROS_REPORT_ESTOP:
        report_estop(facts, out_status);
        break;
    case ROS_REPORT_BUS:
        report_bus(facts, out_status);
        break;
    case ROS_REPORT_TIMING:
        report_timing(facts, out_status);
        break;
    case ROS_REPORT_LEFT:
        report_wheel(&facts->machine.now.left, out_status);
        break;
    case ROS_REPORT_RIGHT:
        report_wheel(&facts->machine.now.right, out_status);
        break;
    case ROS_REPORTS_ASSUMPTIONS:
        report_assumptions(facts, out_status);
        break;
    default:
        report_commands(facts, out_status);
        break;
    }
}

/// Escapes `text` for JSON. The client leaves \uXXXX in its texts; these escapes stay unchanged.
static void quote(const char *text, char *out, size_t size) {
    size_t used = 0;
    for (; *text != '\0' && used + 3U < size; text++) {
        if (*text == '"' || (*text == '\\' && text[1] != 'u')) {
            out[used++] = '\\';
        }
        out[used++] = *text;
    }
    out[used] = '\0';
}

void ros_state_json(const ros_facts_t *facts, char *out, size_t size) {
    static const char *const links[] = {"gone", "silent", "up"};
    const ros_machine_t *machine = &facts->machine;
    char stop[2U * ROS_SENTENCE_SIZE];
    char holder[140];
    char number[24] = "null";
    if (facts->link != ROS_LINK_UP) {
        (void)snprintf(out, size, "{\"gateway\":\"%s\"}", links[facts->link]);
        return;
    }
    quote(machine->stop, stop, sizeof stop);
    quote(machine->holder, holder, sizeof holder);
    if (machine->stop_number.known) {
        (void)snprintf(number, sizeof number, "%" PRId64, machine->stop_number.value);
    }
    (void)snprintf(
        out, size,
        "{\"gateway\":\"up\",\"state\":\"%s\",\"cause\":%s%s%s,\"estop\":\"%s\",\"bus\":\"%s\","
        "\"lease\":%s,\"holder\":%s%s%s,\"left_heard\":%s,\"right_heard\":%s,\"stop\":%s,\"last_stop\":\"%s\"}",
        word(machine->now.machine), (machine->now.cause[0] != '\0') ? "\"" : "null", machine->now.cause,
        (machine->now.cause[0] != '\0') ? "\"" : "", machine->estop, machine->bus, machine->now.ours ? "true" : "false",
        machine->now.holder.known ? "\"" : "null", machine->now.holder.known ? holder : "",
        machine->now.holder.known ? "\"" : "", machine->now.left.heard ? "true" : "false",
        machine->now.right.heard ? "true" : "false", number, stop);
}
