// SPDX-License-Identifier: MIT
// The live screen: it receives ten snapshots a second and sends keys as requests. It never arms.
#include "talk/ctl.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"
#include "top.h"

#include <curses.h>
#include <langinfo.h>
#include <locale.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <term.h>
#include <termios.h>
#include <unistd.h>

#define RATE_HZ   10
#define DRAW_US   100000
#define STALE_US  1500000
#define RETRY_US  500000
#define NOTICE_US 4000000

typedef struct {
    ctl_t *ctl;
    top_model_t model;
    top_history_t history;
    int64_t received_us;
    int64_t retry_us;
    int64_t notice_until_us;
    int64_t pending_id;  ///< Id of the last request; its answer is shown.
    const char *pending; ///< Name of the last request.
} top_t;

__attribute__((format(printf, 2, 3))) static void notice(top_t *self, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(self->model.notice, sizeof self->model.notice, format, arguments);
    va_end(arguments);
    self->notice_until_us = client_now_us() + NOTICE_US;
}

/// Returns false if the request was not sent.
static bool send_request(top_t *self, json_t *request, const char *what) {
    if (!self->model.connected) {
        json_decref(request);
        return false;
    }
    self->pending = what;
    return client_send(&self->ctl->client, request, client_now_us() + DRAW_US, &self->pending_id) == IWC_OK;
}

static void disconnect(top_t *self, const char *why) {
    client_close(&self->ctl->client);
    self->ctl->client.seen_signals = signals_count();
    self->model.connected = false;
    self->retry_us = client_now_us() + RETRY_US;
    json_decref(self->model.state);
    self->model.state = NULL;
    notice(self, "%s", why);
}

/// Sends a stop, through a connection of its own if there is none that accepts it.
static void send_stop(top_t *self, json_t *request, const ctl_stop_t *stop, const char *what) {
    if (send_request(self, request, what)) {
        return;
    }
    const iwc_result_t result = near_stop(self->ctl, stop);
    self->pending = NULL;
    disconnect(self, "");
    self->retry_us = client_now_us() + NOTICE_US / 2; // The operator can read this notice before the next one.
    if (result == IWC_OK) {
        notice(self, "%s: done", what);
    } else {
        notice(self, "%s failed: %s", what, iwc_reason(self->ctl->client.gateway));
    }
}

static void store_sentence(top_t *self, const json_t *stop) {
    const char *sentence = json_string_value(json_object_get(stop, "sentence"));
    (void)snprintf(self->model.last_stop, sizeof self->model.last_stop, "%s%s",
                   (json_integer_value(json_object_get(stop, "number")) > 0) ? "last stop: " : "",
                   (sentence != NULL) ? sentence : "");
    // The line above shows the fix for a latch, and only the rest fits into two lines.
    char *const fix = strrchr(self->model.last_stop, ';');
    if (fix != NULL && json_is_true(json_object_get(stop, "latched"))) {
        *fix = '\0';
    }
}

static void try_connect(top_t *self) {
    static const char *const reasons[] = {
        [NEAR_NONE] = "no gateway answers; start it, or name its socket with --socket PATH",
        [NEAR_FOUND] = "",
        [NEAR_OTHER] = "",
        [NEAR_SEVERAL] = "several gateways are running; choose one with --socket PATH",
        [NEAR_DENIED] = "you may not use its socket: sudo usermod -aG iwheel $USER, then log in again",
        [NEAR_MUTE] = "the gateway accepts the connection and does not answer; see its log",
    };
    near_gateway_t gateway;
    near_find(self->ctl, NULL, &gateway);
    if (gateway.result != NEAR_FOUND) {
        disconnect(self, reasons[gateway.result]);
        return;
    }
    self->model.state = gateway.status;
    self->model.connected = true;
    self->model.notice[0] = '\0';
    if (iwc_watches_only(self->ctl->client.gateway)) {
        notice(self, "this socket allows watch and stop, but not drive");
    }
    self->received_us = client_now_us();
    json_t *why = near_ask(self->ctl, json_pack("{s:s}", "cmd", "why"));
    store_sentence(self, why);
    json_decref(why);
    (void)send_request(
        self, json_pack("{s:s,s:[s,s],s:i}", "cmd", "watch", "topics", "state", "stop", "rate_hz", RATE_HZ), NULL);
}

static void take_reply(top_t *self, const json_t *line) {
    if (self->pending == NULL || json_integer_value(json_object_get(line, "id")) != self->pending_id) {
        return;
    }
    if (json_is_true(json_object_get(line, "ok"))) {
        notice(self, "%s: done, now %s", self->pending, text_word(line, "state"));
    } else {
        notice(self, "%s refused: %s", self->pending, text_word(line, "message"));
    }
    self->pending = NULL;
}

static void take_line(top_t *self, json_t *line) {
    const char *event = text_word(line, "event");
    self->received_us = client_now_us();
    if (json_object_get(line, "ok") != NULL) {
        take_reply(self, line);
    } else if (strcmp(event, "state") == 0) {
        json_decref(self->model.state);
        self->model.state = json_incref(line);
        self->model.scale_mm_s = top_scale(self->model.scale_mm_s, line);
    } else if (strcmp(event, "stop") == 0) {
        store_sentence(self, line);
    }
}

/// Reads the received lines, without waiting.
static void read_gateway(top_t *self) {
    if (self->model.connected) {
        (void)iwc_latest(self->ctl->client.gateway); // A slow terminal shows the present state, not a backlog.
    }
    while (self->model.connected) {
        json_t *line = NULL;
        const iwc_result_t result = client_receive(&self->ctl->client, 0, &line);
        if (result == IWC_OK) {
            take_line(self, line);
            json_decref(line);
        } else if (result == IWC_TIMEOUT || result == IWC_INTERRUPTED) {
            return;
        } else {
            disconnect(self, "the gateway ended the connection; waiting for a gateway");
        }
    }
}

/// Handles a key. Returns false to quit.
static bool take_key(top_t *self, int key) {
    static const char reason[] = "a key in iwheelctl top";
    switch (key) {
    case ' ':
        send_stop(self, json_pack("{s:s}", "cmd", "stop"), &(ctl_stop_t){.latches = false}, "stop");
        return true;
    case 'e':
    case 'E':
        send_stop(self, json_pack("{s:s,s:s}", "cmd", "estop", "reason", reason),
                  &(ctl_stop_t){.latches = true, .reason = reason}, "e-stop");
        return true;
    case 'r':
    case 'R':
        (void)send_request(self, json_pack("{s:s}", "cmd", "reset"), "reset");
        return true;
    case 'q':
    case 'Q':
        return false;
    default:
        return true;
    }
}

/// Waits for a key, the gateway, a signal or the time to draw again. Returns false to quit.
static bool wait_and_take(top_t *self) {
    const int64_t now_us = client_now_us();
    struct pollfd entries[2] = {{.fd = STDIN_FILENO, .events = POLLIN},
                                {.fd = iwc_fd(self->ctl->client.gateway), .events = POLLIN}};
    const struct timespec timeout = {0, DRAW_US * 1000L};
    const int ready = ppoll(entries, 2, &timeout, signals_let_in());
    if (signals_count() != 0U || (ready > 0 && (entries[0].revents & (POLLHUP | POLLERR | POLLNVAL)) != 0)) {
        return false;
    }
    for (int key = getch(); key != ERR; key = getch()) {
        if (!take_key(self, key)) {
            return false;
        }
    }
    if (!self->model.connected && now_us >= self->retry_us) {
        try_connect(self);
    }
    read_gateway(self);
    self->model.stale = self->model.connected && client_now_us() > self->received_us + STALE_US;
    if (self->model.connected && client_now_us() > self->notice_until_us) {
        self->model.notice[0] = '\0';
    }
    return true;
}

/// Makes Ctrl-S a key without a meaning. Otherwise it would stop the output, this program would wait for that, and the
/// keys that stop the wheels would do nothing.
static void forgo_flow_control(void) {
    struct termios modes;
    if (tcgetattr(STDIN_FILENO, &modes) == 0) {
        modes.c_iflag &= ~(tcflag_t)IXON;
        (void)tcsetattr(STDIN_FILENO, TCSANOW, &modes);
        (void)def_prog_mode();
    }
}

static void prepare_terminal(top_model_t *model) {
    const char *no_color = getenv("NO_COLOR");
    (void)cbreak();
    forgo_flow_control();
    (void)noecho();
    (void)curs_set(0);
    (void)keypad(stdscr, TRUE);
    (void)nodelay(stdscr, TRUE);
    (void)leaveok(stdscr, TRUE);
    model->fine_blocks = strcmp(nl_langinfo(CODESET), "UTF-8") == 0;
    model->colour =
        has_colors() && (no_color == NULL || no_color[0] == '\0') && start_color() == OK && use_default_colors() == OK;
    if (model->colour) {
        (void)init_pair(TOP_GOOD, COLOR_GREEN, -1);
        (void)init_pair(TOP_CARE, COLOR_YELLOW, -1);
        (void)init_pair(TOP_BAD, COLOR_RED, -1);
    }
}

/// Returns true if this terminal is known and can move its cursor. Checked first, because a failed newterm leaks
/// memory.
static bool can_draw(void) {
    int error = 0;
    if (setupterm(NULL, STDOUT_FILENO, &error) != OK) {
        return false;
    }
    const bool can = cursor_address != NULL && clear_screen != NULL;
    (void)del_curterm(cur_term);
    return can;
}

int verb_top(ctl_t *self, int count, char **words) {
    static top_t top;
    top = (top_t){.ctl = self, .model = {.scale_mm_s = 200, .history = &top.history}};
    if (!words_at_most("top", count, 0, words)) {
        return CTL_USAGE;
    }
    if (isatty(STDIN_FILENO) != 1 || isatty(STDOUT_FILENO) != 1) {
        return ctl_fail(CTL_USAGE, "top needs a terminal; without one: iwheelctl status, or iwheelctl watch");
    }
    (void)setlocale(LC_ALL, "");
    SCREEN *screen = can_draw() ? newterm(NULL, stdout, stdin) : NULL;
    if (screen == NULL) {
        return ctl_fail(CTL_USAGE,
                        "this terminal cannot draw (TERM=%s); without drawing: iwheelctl status, or iwheelctl watch; "
                        "if it can: TERM=vt100 iwheelctl top",
                        (getenv("TERM") != NULL) ? getenv("TERM") : "");
    }
    signals_catch();
    prepare_terminal(&top.model);
    do {
        top_history_take(&top.history, client_now_us(),
                         (top.model.connected && !top.model.stale) ? top.model.state : NULL);
        top_draw(&top.model);
        (void)refresh();
    } while (wait_and_take(&top));
    (void)endwin();
    delscreen(screen);
    json_decref(top.model.state);
    return CTL_OK;
}
