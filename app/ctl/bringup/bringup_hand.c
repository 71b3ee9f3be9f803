// SPDX-License-Identifier: MIT
// What wheels count while hands turn or push them. Nothing is sent.
#include "bringup.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define LOOK_NS 20000000L
/// The ticks go on counting while a wheel is not heard; but for longer it may have been switched off.
#define SILENT_US 500000
/// So much back and forth is a hand that aims at a mark: ticks, or a share of the way.
#define BACK_TICKS 6
#define BACK_SHARE 20

typedef struct {
    long long ticks[IW_SIDES];
    int rpm[IW_SIDES];
    bool heard;
} look_t;

static look_t look(bringup_t *self) {
    look_t seen = {.heard = true};
    json_t *status = trial_status(self);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const json_t *wheel = json_object_get(status, text_side(side));
        const json_t *ticks = json_object_get(wheel, "ticks");
        const json_t *rpm = json_object_get(wheel, "speed_rpm");
        seen.heard = seen.heard && json_is_integer(ticks) && json_is_integer(rpm);
        seen.ticks[side] = json_integer_value(ticks);
        seen.rpm[side] = (int)json_integer_value(rpm);
    }
    json_decref(status);
    return seen;
}

/// The first one at which both are heard; a moment's silence is none.
static look_t first_look(bringup_t *self) {
    const struct timespec pause = {0, LOOK_NS};
    look_t seen = look(self);
    for (unsigned i = 0; i < SILENT_US / (LOOK_NS / 1000L) && !seen.heard; i++) {
        (void)nanosleep(&pause, NULL);
        seen = look(self);
    }
    return seen;
}

/// From one look at which both were heard to the next.
static void add(hand_t *hand, const look_t *before, const look_t *now, int64_t us) {
    hand->heard = hand->heard && us <= SILENT_US;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const long long step = now->ticks[side] - before->ticks[side];
        hand->ticks[side] += step;
        hand->way[side] += llabs(step);
        hand->rpm_turns[side] += abs(now->rpm[side]) * (double)us / 60e6;
    }
}

/// A line is there, or the end of input; false on a signal.
static bool wait_for_line(bringup_t *self, const look_t *first, hand_t *hand) {
    const unsigned before = signals_count();
    const struct timespec pause = {0, LOOK_NS};
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    look_t last = *first;
    int64_t last_us = client_now_us();
    int ready = 0;
    while (ready == 0 && signals_count() == before) {
        ready = ppoll(&input, 1, &pause, signals_let_in());
        const look_t now = look(self);
        const int64_t now_us = client_now_us();
        if (now.heard) {
            add(hand, &last, &now, now_us - last_us);
            last = now;
            last_us = now_us;
        }
    }
    hand->heard = hand->heard && client_now_us() - last_us <= SILENT_US;
    return signals_count() == before;
}

void hand_follow(bringup_t *self, const char *prompt, hand_t *out_hand) {
    char line[16] = "";
    if (!trial_wait_ready(self)) {
        bringup_fail(self);
    }
    const look_t first = first_look(self);
    memset(out_hand, 0, sizeof(*out_hand));
    out_hand->heard = first.heard;
    talk_forget();
    (void)printf("%s ", prompt);
    (void)fflush(stdout);
    const bool typed = wait_for_line(self, &first, out_hand);
    if (!typed) {
        (void)puts("");
    }
    if (!typed || read(STDIN_FILENO, line, sizeof line) <= 0 || line[0] == 'q') {
        bringup_quit(self);
    }
}

bool hand_went_one_way(const hand_t *hand, iw_side_t side) {
    const long long back = hand->way[side] - llabs(hand->ticks[side]);
    return back <= BACK_TICKS || back <= hand->way[side] / BACK_SHARE;
}
