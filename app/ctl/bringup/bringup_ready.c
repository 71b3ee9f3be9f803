// SPDX-License-Identifier: MIT
// Conditions for a movement. A stop that the operator does not know yet prevents it until the next answer: the release
// of the e-stop never turns a wheel.
#include "bringup.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#define READY_US 8000000
/// A new gateway receives both wheels within this time. A wheel that comes online later was switched on, perhaps by the
/// release of an e-stop that cuts its power: it must not turn.
#define OFFLINE_US 500000
/// Longest time for which a trial gateway sends zeros after a stop, with a margin.
#define ZEROS_US 3000000
#define POLL_NS  20000000L
/// Reason for a movement that does not start although the e-stop is released.
#define UNKNOWN_ESTOP "the e-stop was pressed after your last answer"

static void nap(void) {
    const struct timespec pause = {0, POLL_NS};
    (void)nanosleep(&pause, NULL);
}

static bool is_in(const json_t *status, const char *state) {
    return strcmp(text_word(status, "state"), state) == 0;
}

/// Returns why the e-stop prevents movements now, or NULL.
static const char *estop_prevents(const json_t *status) {
    const char *estop = text_word(json_object_get(status, "estop"), "state");
    if (status == NULL || strcmp(estop, "released") == 0 || strcmp(estop, "none") == 0) {
        return NULL;
    }
    if (strcmp(estop, "pressed") == 0) {
        return "the e-stop is pressed; release it before you answer";
    }
    return (strcmp(estop, "disagrees") == 0)
               ? "the two contacts of the e-stop disagree; press and release it before you answer"
               : "the e-stop cannot be read; check its wire before you answer";
}

/// Returns the name of an offline wheel with the likely causes, or NULL.
static const char *offline_wheel(const json_t *status) {
    if (!json_is_true(json_object_get(json_object_get(status, "left"), "heard"))) {
        return "the left wheel is offline (power, cable)";
    }
    return json_is_true(json_object_get(json_object_get(status, "right"), "heard"))
               ? NULL
               : "the right wheel is offline (power, cable)";
}

/// Returns NULL if the e-stop is released, both wheels are online and at standstill and no cause of a stop is present,
/// otherwise the missing condition.
static const char *missing(const json_t *status) {
    const json_t *left = json_object_get(status, "left");
    const json_t *right = json_object_get(status, "right");
    const char *const estop = estop_prevents(status);
    if (status == NULL || estop != NULL) {
        return (estop != NULL) ? estop : "the gateway of this session does not answer";
    }
    if (offline_wheel(status) != NULL) {
        return offline_wheel(status);
    }
    if (!json_is_true(json_object_get(left, "at_rest")) || !json_is_true(json_object_get(right, "at_rest"))) {
        return "a wheel turns";
    }
    return (json_array_size(json_object_get(status, "present")) > 0) ? "a recent fault is still present" : NULL;
}

static bool is_estop(const json_t *stop) {
    return strncmp(text_word(stop, "cause"), "estop_", 6U) == 0;
}

static json_t *last_stop(bringup_t *self) {
    return near_ask(self->ctl, json_pack("{s:s}", "cmd", "why"));
}

/// Resets the latch if the operator knows its stop. The request names this stop, so the gateway refuses it after a
/// later one. Returns false after it has written the reason if the operator must answer first.
static bool reset(bringup_t *self, char *out_why, size_t size) {
    json_t *stop = last_stop(self);
    const json_t *number = json_object_get(stop, "number");
    const bool known = json_integer_value(json_object_get(stop, "at_us")) <= self->known_us;
    if (known && json_is_integer(number)) {
        // Refused until the cause is gone.
        json_decref(near_ask(self->ctl, json_pack("{s:s,s:I}", "cmd", "reset", "stop", json_integer_value(number))));
    } else if (stop != NULL) {
        (void)snprintf(out_why, size, "%s", is_estop(stop) ? UNKNOWN_ESTOP : text_word(stop, "sentence"));
    }
    json_decref(stop);
    return known || stop == NULL;
}

bool ready_to_move(bringup_t *self, char *out_why, size_t size) {
    const int64_t end_us = client_now_us() + READY_US;
    int64_t online_us = client_now_us(); // Last time when both wheels were online.
    bool waits = true;
    if (self->estop_us > self->known_us) {
        (void)snprintf(out_why, size, "%s", UNKNOWN_ESTOP);
        return false;
    }
    while (waits && !talk_key_pressed()) {
        json_t *status = trial_status(self);
        const char *what = missing(status);
        const bool latched = is_in(status, "latched");
        const bool listening = is_in(status, "listening");
        if (offline_wheel(status) == NULL) {
            online_us = client_now_us();
        }
        waits = status != NULL && estop_prevents(status) == NULL && client_now_us() - online_us <= OFFLINE_US &&
                client_now_us() <= end_us;
        json_decref(status);
        if (what == NULL && listening) {
            return true;
        }
        if (what == NULL) {
            what = "the gateway does not return to listening";
        }
        (void)snprintf(out_why, size, "%s", what);
        if (waits && latched) {
            waits = reset(self, out_why, size);
        }
        nap();
    }
    return false;
}

void ready_by_hand(bringup_t *self) {
    const int64_t end_us = client_now_us() + READY_US;
    const unsigned signals = signals_count();
    for (;;) {
        json_t *status = trial_status(self);
        const char *const what = missing(status);
        const bool lost = status == NULL;
        json_decref(status);
        if (what == NULL) {
            return;
        }
        if (client_now_us() > end_us || lost) {
            if (signals_count() == signals) {
                talk_print("  Not ready: %s.", what);
            }
            bringup_fail(self);
        }
        nap();
    }
}

void ready_retain_estop(bringup_t *self) {
    const int64_t end_us = client_now_us() + ZEROS_US;
    json_t *status = trial_status(self);
    while (is_in(status, "stopping") && client_now_us() < end_us) {
        json_decref(status);
        nap();
        status = trial_status(self);
    }
    json_t *stop = (status != NULL) ? last_stop(self) : NULL;
    if (is_estop(stop)) {
        self->estop_us = json_integer_value(json_object_get(stop, "at_us"));
    }
    json_decref(stop);
    json_decref(status);
}
