// SPDX-License-Identifier: MIT
#include "keys.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

typedef struct {
    char key;
    const char *what; ///< Description of the key.
    const char *set;
    const char *undo; ///< NULL: the command cannot be undone.
} sim_key_t;

#define NORMAL "normal"

static const sim_key_t keys[] = {
    {'e', "press the e-stop", "estop press", "estop release"},
    {'w', "cut the e-stop's wire", "estop unplug", "estop plug"},
    {'p', "power off", "power off", "power on"},
    {'c', "unplug the CAN cable", "stall on", "stall off"},
    {'a', "no acknowledge", "ack off", "ack on"},
    {'o', "bus-off", "busoff on", "busoff off"},
    {'x', "error passive", "passive on", "passive off"},
    {'i', "interface down", "bus down", "bus up"},
    {'n', "noise: 20 % lost", "loss 20", "loss 0"},
    {'f', "second master", "foreign on", "foreign off"},
    {'m', "mute left wheel", "mute left", "unmute left"},
    {'b', "block left wheel", "block left", "unblock left"},
    {'r', "reboot right wheel", "reboot right", NULL},
    {'l', "lean on it, 60 N", "load both 60", "load both 0"},
    {'0', "all normal again", NORMAL, NULL},
    {'?', "these keys", NULL, NULL},
    {'q', "quit", "quit", NULL},
};
#define KEYS    (sizeof keys / sizeof keys[0])
#define COLUMNS 3U

_Static_assert(KEYS <= 32U, "one bit each");

/// Prints the table; a star marks each key whose fault is on.
static void show(const sim_keys_t *self) {
    for (size_t i = 0U; i < KEYS; i++) {
        bool const last = i % COLUMNS == COLUMNS - 1U || i == KEYS - 1U;
        (void)printf(" %c%c %-22s%s", ((self->on & (1U << i)) != 0U) ? '*' : ' ', keys[i].key, keys[i].what,
                     last ? "\n" : "");
    }
    (void)fflush(stdout);
}

static void press(sim_keys_t *self, char letter) {
    for (size_t i = 0U; i < KEYS; i++) {
        const sim_key_t *const key = &keys[i];
        unsigned const bit = 1U << i;
        bool const is_on = (self->on & bit) != 0U;
        if (key->key != letter) {
            continue;
        }
        if (key->set == NULL) {
            show(self);
            return;
        }
        const char *const answer = self->execute(self->context, is_on ? key->undo : key->set);
        if (strncmp(answer, "error", 5U) == 0) {
            (void)printf("%s: %s", key->what, answer);
            (void)fflush(stdout);
        } else if (key->undo != NULL) {
            self->on ^= bit;
        } else if (strcmp(key->set, NORMAL) == 0) {
            self->on = 0U;
        }
        return;
    }
}

static void let_go(sim_keys_t *self) {
    sim_loop_remove(self->loop, &self->watch);
    self->watch.fd = -1;
}

static bool is_ours(int fd) {
    return tcgetpgrp(fd) == getpgrp();
}

static void typed(sim_watch_t *watch) {
    sim_keys_t *const self = watch->owner;
    char letters[16];
    // A read in the background would stop the whole process.
    ssize_t const length = (watch->fd >= 0 && is_ours(watch->fd)) ? read(watch->fd, letters, sizeof letters) : 0;
    if (length <= 0 && watch->fd >= 0) {
        let_go(self);
    }
    for (ssize_t i = 0; i < length; i++) {
        press(self, letters[i]);
    }
}

void sim_keys_open(sim_keys_t *self) {
    self->watch = (sim_watch_t){typed, self, STDIN_FILENO};
    if (isatty(STDIN_FILENO) != 1 || isatty(STDOUT_FILENO) != 1 || !is_ours(STDIN_FILENO) ||
        tcgetattr(STDIN_FILENO, &self->before) != 0 || !sim_loop_add(self->loop, &self->watch)) {
        self->watch.fd = -1;
        return;
    }
    struct termios single = self->before;
    single.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    single.c_cc[VMIN] = 0;
    single.c_cc[VTIME] = 0;
    (void)tcsetattr(STDIN_FILENO, TCSANOW, &single);
    show(self);
}

void sim_keys_close(sim_keys_t *self) {
    if (self->watch.fd >= 0 && is_ours(self->watch.fd)) {
        (void)tcsetattr(self->watch.fd, TCSANOW, &self->before);
    }
    self->watch.fd = -1;
}
