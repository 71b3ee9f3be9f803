// SPDX-License-Identifier: MIT
// Counts of the wheels while hands turn or push them. Nothing is sent.
#include "bringup.h"

#include <poll.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#define POLL_NS 20000000L

static void nap(void) {
    const struct timespec pause = {0, POLL_NS};
    (void)nanosleep(&pause, NULL);
}

static hand_sample_t read_hand(bringup_t *self) {
    hand_sample_t seen = {.heard = true};
    json_t *status = trial_status(self);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const json_t *wheel = json_object_get(status, text_side(side));
        const json_t *ticks = json_object_get(wheel, "ticks");
        const json_t *rpm = json_object_get(wheel, "speed_rpm");
        seen.heard = seen.heard && json_is_integer(ticks) && json_is_integer(rpm);
        seen.ticks[side] = json_integer_value(ticks);
        seen.rpm[side] = (int)json_integer_value(rpm);
        seen.reboots += json_integer_value(json_object_get(wheel, "reboots"));
    }
    json_decref(status);
    return seen;
}

/// Polls until both wheels are online, for HAND_OFFLINE_US at most. Returns the last answer.
static hand_sample_t read_first(bringup_t *self) {
    hand_sample_t seen = read_hand(self);
    for (unsigned i = 0; i < HAND_OFFLINE_US / (POLL_NS / 1000L) && !seen.heard; i++) {
        nap();
        seen = read_hand(self);
    }
    return seen;
}

/// Waits for a line or the end of input, and until everything is counted up to it. Returns false on a signal.
static bool wait_for_line(bringup_t *self, hand_t *hand) {
    const unsigned before = signals_count();
    const struct timespec pause = {0, POLL_NS};
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    bool counted = false;
    while (!counted && signals_count() == before) {
        const int ready = ppoll(&input, 1, &pause, signals_let_in());
        const hand_sample_t now = read_hand(self);
        hand_add(hand, &now, client_now_us());
        if (ready > 0 && !now.heard) {
            nap();
        }
        counted = ready > 0 && (now.heard || hand->gap != HAND_COMPLETE);
    }
    return signals_count() == before;
}

void hand_follow(bringup_t *self, const char *prompt, hand_t *out_hand) {
    char line[16] = "";
    ready_by_hand(self);
    const hand_sample_t first = read_first(self);
    hand_begin(out_hand, &first, client_now_us());
    talk_forget();
    (void)printf("%s ", prompt);
    (void)fflush(stdout);
    const bool typed = wait_for_line(self, out_hand);
    if (!typed) {
        (void)puts("");
    }
    if (!typed || read(STDIN_FILENO, line, sizeof line) <= 0 || line[0] == 'q') {
        bringup_quit(self);
    }
}
