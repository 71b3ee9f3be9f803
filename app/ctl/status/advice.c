// SPDX-License-Identifier: MIT
#include "advice.h"

#include "text/ctl_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    const char *cause;
    const char *fix;
} fix_t;

static const fix_t fixes[] = {
    {"estop_line", "release the e-stop button (or fix its wire)"},
    {"estop_disagrees", "fix the e-stop's contact or wire, press and release its button"},
    {"estop_software", "check that no person is in the way"},
    {"wheel_lost", "switch the wheels on; check their cable and the termination"},
    {"wheel_rebooted", "find out why a wheel lost power; wait until both are online"},
    {"send_stalled", "no node acknowledges the gateway's frames: check the wheels' power and the cable"},
    {"bus_down", "bring the bus up (or start the simulator)"},
    {"second_master", "switch off the other program or device that sends setpoints"},
    {"feedback_sign", "check `invert` and the wheels' wiring before anything else"},
    {"overspeed", "check the wheel: it ran faster than commanded"},
    {"loop_hung", "the gateway did not get the processor; reduce the machine's load"},
    {"internal", "a fault of the gateway itself: save its log and report it"},
    {"loop_late", "the gateway got the processor late; reduce the machine's load"},
    {"wheel_blocked", "free the wheel"},
    {"pair_diverges", "check that the wheel turns freely and drives"},
    {"lease_lost", "the client must send drive commands more often, or raise lease_ms"},
};

static bool is_online(const json_t *status, const char *side) {
    return json_is_true(json_object_get(json_object_get(status, side), "heard"));
}

/// Returns true if both wheels are online: wheels that send also acknowledge, so power and cable are not the cause. The
/// fault lasts until the link is restarted.
static bool has_lost_an_echo(const json_t *status, const char *bus) {
    return strncmp(bus, "unix:", 5U) != 0 && is_online(status, "left") && is_online(status, "right");
}

bool advice_fix(const json_t *status, const char *cause, char out_fix[ADVICE_SIZE]) {
    const char *bus = text_word(json_object_get(status, "bus"), "name");
    out_fix[0] = '\0';
    if (strcmp(cause, "send_stalled") == 0 && has_lost_an_echo(status, bus)) {
        (void)snprintf(out_fix, ADVICE_SIZE,
                       "the wheels are online, so an echo was lost (or the bus is full): ip link set %.32s down; ip "
                       "link set %.32s up (permanently: systemctl enable --now iwheel-can-restart@%.32s.path)",
                       bus, bus, bus);
        return true;
    }
    for (size_t i = 0; i < sizeof fixes / sizeof fixes[0]; i++) {
        if (strcmp(fixes[i].cause, cause) == 0) {
            (void)snprintf(out_fix, ADVICE_SIZE, "%s", fixes[i].fix);
        }
    }
    return out_fix[0] != '\0';
}

bool advice_is_present(const json_t *status, const char *cause) {
    size_t index = 0;
    const json_t *present = NULL;
    json_array_foreach(json_object_get(status, "present"), index, present) {
        if (json_is_string(present) && strcmp(json_string_value(present), cause) == 0) {
            return true;
        }
    }
    return false;
}

__attribute__((format(printf, 2, 3))) static void add(advice_t *self, const char *format, ...) {
    va_list list;
    if (self->lines < ADVICE_LINES) {
        va_start(list, format);
        (void)vsnprintf(self->line[self->lines], ADVICE_SIZE, format, list);
        va_end(list);
        self->lines++;
    }
}

bool advice_is_unset(const json_t *status, const char *item) {
    const json_t *entry = json_object_get(json_object_get(status, "ledger"), item);
    // A gateway before 0.3 also reported a configured track with evidence "none".
    return strcmp(text_word(entry, "evidence"), "none") == 0 && !json_is_string(json_object_get(entry, "value"));
}

/// Adds contradictions that refuse arm. The gateway marks them by the beginning of the text of `disabled`.
static void add_contradictions(const json_t *status, advice_t *self) {
    static const char refuses[] = "arm is refused; ";
    const char *name = NULL;
    json_t *entry = NULL;
    json_object_foreach(json_object_get(status, "ledger"), name, entry) {
        const char *cost = text_word(entry, "disabled");
        if (strncmp(cost, refuses, sizeof refuses - 1U) == 0) {
            add(self, "cannot arm, %.32s is contradicted: %.96s", name, cost + sizeof refuses - 1U);
        }
    }
}

static void add_present(const json_t *status, advice_t *self) {
    size_t index = 0;
    const json_t *present = NULL;
    json_array_foreach(json_object_get(status, "present"), index, present) {
        const char *cause = json_is_string(present) ? json_string_value(present) : "--";
        char fix[ADVICE_SIZE];
        if (strcmp(cause, text_word(status, "cause")) != 0) {
            add(self, "%.32s: %s", cause, advice_fix(status, cause, fix) ? fix : "see: iwheelctl why");
        }
    }
}

/// Returns true if a wheel that is online is not at standstill.
static bool turns(const json_t *status, const char *side) {
    return is_online(status, side) && !json_is_true(json_object_get(json_object_get(status, side), "at_rest"));
}

static void advise_listening(const json_t *status, advice_t *self) {
    add_present(status, self);
    if (json_is_true(json_object_get(status, "listen_only"))) {
        add(self, "this gateway only listens; to drive, start it without --listen-only");
        return;
    }
    if (advice_is_unset(status, "setpoint_type")) {
        add(self, "cannot arm: set setpoint_type under [wheels] in the configuration");
    }
    if (advice_is_unset(status, "current_role")) {
        add(self, "cannot arm: set current_role (limit or setpoint) under [wheels]");
    }
    if (advice_is_unset(status, "track")) {
        add(self, "cannot arm: set track_mm under [wheels]; iwheelctl bringup measures it");
    }
    add_contradictions(status, self);
    if (self->lines == 0 && (turns(status, "left") || turns(status, "right"))) {
        add(self, "cannot arm: a wheel turns; wait until both wheels are at standstill");
    }
    if (self->lines == 0) {
        add(self, "ready: iwheelctl drive LEFT RIGHT (mm/s) arms and MOVES the wheels");
    }
}

void advice_collect(const json_t *status, advice_t *out_advice) {
    const char *state = text_word(status, "state");
    const char *cause = text_word(status, "cause");
    char fix[ADVICE_SIZE];
    memset(out_advice, 0, sizeof(*out_advice));
    const bool known = advice_fix(status, cause, fix);
    if (json_is_true(json_object_get(status, "rolling"))) {
        add(out_advice,
            "a wheel turns although the gateway sends nothing to it: hold the machine, or use its parking brake");
    }
    if (strcmp(state, "listening") == 0) {
        advise_listening(status, out_advice);
    } else if (strcmp(state, "armed") == 0) {
        add(out_advice, "the wheels follow the lease holder; iwheelctl stop ends that");
    } else if (strcmp(state, "stopping") == 0 && json_is_true(json_object_get(status, "holding"))) {
        add(out_advice,
            "zeros hold the wheels; to end that: iwheelctl release, and the machine may roll; or arm again");
    } else if (strcmp(state, "stopping") == 0) {
        add(out_advice, "%.290s, then arm again", known ? fix : "wait until both wheels are at standstill");
    } else if (strcmp(state, "latched") == 0) {
        add(out_advice, "%.290s, then: iwheelctl reset", known ? fix : "remove the cause");
        add_present(status, out_advice);
    } else {
        add(out_advice, "this gateway reports an unknown state; use the iwheelctl of its version");
    }
}
