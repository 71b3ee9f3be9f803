// SPDX-License-Identifier: MIT
// Questions and answers at the terminal.
#include "bringup.h"

#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

// The terminal has one state for all processes; bringup must restore it.
static struct termios normal_keys;
static bool keys_are_raw;

void talk_print(const char *format, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    const char *rest = text;
    while (*rest != '\0') {
        const size_t cut = text_cut(rest, PAPER_WIDTH);
        (void)printf("%.*s\n", (int)cut, rest);
        rest += cut;
        rest += strspn(rest, " ");
    }
    (void)fflush(stdout);
}

void talk_step(unsigned number, const char *title) {
    const paper_t paper = {.out = stdout, .colour = text_wants_colour(stdout)};
    paper_print(&paper, TONE_PLAIN, "%s", "");
    paper_end(&paper);
    paper_print(&paper, TONE_TITLE, "Step %u of %u: %s", number, BRINGUP_STEPS, title);
    paper_end(&paper);
}

/// Reads a line byte by byte, so that no byte of the next line is consumed. Returns false at the end of the input or on
/// a signal.
static bool read_line(char *out_line, size_t size) {
    size_t used = 0;
    const unsigned before = signals_count();
    for (;;) {
        struct pollfd entry = {.fd = STDIN_FILENO, .events = POLLIN};
        char byte = '\0';
        const int ready = ppoll(&entry, 1, NULL, signals_let_in());
        if (signals_count() != before) {
            return false;
        }
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        if (read(STDIN_FILENO, &byte, 1) != 1) {
            return false;
        }
        if (byte == '\n') {
            out_line[used] = '\0';
            return true;
        }
        if (used + 1U < size && byte != '\r') {
            out_line[used++] = byte;
        }
    }
}

static void trim(char *text) {
    const size_t lead = strspn(text, " \t");
    memmove(text, text + lead, strlen(text + lead) + 1U);
    for (size_t length = strlen(text); length > 0 && strchr(" \t", text[length - 1U]) != NULL; length--) {
        text[length - 1U] = '\0';
    }
}

void talk_forget(void) {
    (void)tcflush(STDIN_FILENO, TCIFLUSH); // Input from before the question is not an answer to it.
}

void talk_ask(bringup_t *self, const char *question, const char *otherwise, char out_answer[BRINGUP_ANSWER_SIZE]) {
    talk_forget();
    (void)printf("%s [%s] ", question, otherwise);
    (void)fflush(stdout);
    if (!read_line(out_answer, BRINGUP_ANSWER_SIZE)) {
        (void)puts("");
        bringup_abandon(self);
    }
    self->known_us = client_now_us();
    trim(out_answer);
    if (out_answer[0] == '\0') {
        (void)snprintf(out_answer, BRINGUP_ANSWER_SIZE, "%s", otherwise);
    }
    if (strcmp(out_answer, "q") == 0) {
        bringup_quit(self);
    }
}

bool talk_yes(bringup_t *self, const char *question, bool otherwise) {
    char answer[BRINGUP_ANSWER_SIZE];
    for (;;) {
        talk_ask(self, question, otherwise ? "y" : "n", answer);
        const bool yes = strcmp(answer, "y") == 0 || strcmp(answer, "yes") == 0;
        if (yes || strcmp(answer, "n") == 0 || strcmp(answer, "no") == 0) {
            return yes;
        }
        talk_print("Please write y or n (q ends bringup).");
    }
}

bool talk_number(bringup_t *self, const char *question, double low, double high, double *out_number) {
    char answer[BRINGUP_ANSWER_SIZE];
    for (;;) {
        talk_ask(self, question, "skip", answer);
        if (strcmp(answer, "skip") == 0) {
            return false;
        }
        char *end = NULL;
        for (char *comma = strchr(answer, ','); comma != NULL; comma = strchr(comma, ',')) {
            *comma = '.';
        }
        *out_number = strtod(answer, &end);
        if (end != answer && *end == '\0' && *out_number >= low && *out_number <= high) {
            return true;
        }
        talk_print("Please write a number from %g to %g, without its unit.", low, high);
    }
}

void talk_keys_begin(void) {
    struct termios raw;
    if (keys_are_raw || tcgetattr(STDIN_FILENO, &normal_keys) != 0) {
        return;
    }
    raw = normal_keys;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    keys_are_raw = tcsetattr(STDIN_FILENO, TCSANOW, &raw) == 0; // TCSAFLUSH would discard a key that stops the wheels.
}

void talk_keys_end(void) {
    if (keys_are_raw) {
        (void)tcsetattr(STDIN_FILENO, TCSANOW, &normal_keys);
    }
    keys_are_raw = false;
}

bool talk_key_pressed(void) {
    struct pollfd entry = {.fd = STDIN_FILENO, .events = POLLIN};
    return poll(&entry, 1, 0) > 0;
}
