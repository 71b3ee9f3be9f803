// SPDX-License-Identifier: MIT
#include "doctor.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define INDENT        6U
#define LISTEN_MIN_US 200000
#define LISTEN_MAX_US 60000000
/// Maximum time to wait for a press, or a release.
#define WAIT_US 20000000
#define POLL_MS 20

typedef struct {
    const char *bus;
    const char *config;
    const char *estop;
    int64_t listen_us;
    bool no_press;
} words_t;

/// Reads the words. Returns an exit code.
static int parse_words(int count, char **words, words_t *out_words) {
    *out_words = (words_t){.listen_us = DOCTOR_LISTEN_MS * INT64_C(1000)};
    const option_t options[] = {
        {OPTION("--config", option_text, &out_words->config)},
        {OPTION("--estop", option_text, &out_words->estop)},
        {OPTION("--listen", option_time, &out_words->listen_us), .range = {LISTEN_MIN_US, LISTEN_MAX_US}},
        {OPTION("--no-press", NULL, &out_words->no_press)},
        {.name = NULL},
    };
    const words_syntax_t syntax = {"doctor", options, words_is_name, &out_words->bus};
    return words_read(&syntax, count, words);
}

int doctor_configure(gateway_config_t *config, const char *path, const doctor_named_t *bus, const char *estop) {
    const char *found = (path != NULL) ? path : GATEWAY_CONFIG_PATH;
    gateway_config_default(config);
    if ((path != NULL || access(found, F_OK) == 0) && gateway_config_load(found, config, stderr) != 0) {
        return GATEWAY_CONFIG_ERROR;
    }
    if (bus->value != NULL && gateway_config_override(config, "bus.interface", bus->value, bus->word, stderr) != 0) {
        return CTL_USAGE;
    }
    if (estop != NULL && gateway_config_override(config, "estop.line", estop, "--estop", stderr) != 0) {
        return CTL_USAGE;
    }
    return CTL_OK;
}

/// Chooses the bus: the named one, that of the gateway, the configured one, or the only one of the machine.
static void choose_bus(doctor_t *self, const words_t *words) {
    char names[256];
    if (words->bus != NULL) {
        self->bus = self->config.bus.interface;
        return;
    }
    if (self->gateway.result == NEAR_FOUND) {
        self->bus = self->gateway.bus;
        return;
    }
    if (words->config != NULL || access(GATEWAY_CONFIG_PATH, F_OK) == 0) {
        self->bus = self->config.bus.interface;
        return;
    }
    if (doctor_interfaces(names, sizeof names) == 1U) {
        (void)snprintf(self->found_bus, sizeof self->found_bus, "%.112s", names);
        self->bus = self->found_bus;
    }
}

static void add_no_bus(doctor_t *self) {
    char names[256];
    if (doctor_interfaces(names, sizeof names) > 0U) {
        inspect_add(&self->findings, "interface", INSPECT_FAIL, "bus: there are several CAN interfaces: %s", names);
        inspect_fix(&self->findings, "name one: iwheelctl doctor IFACE");
    } else {
        inspect_add(&self->findings, "interface", INSPECT_FAIL, "bus: this machine has no CAN interface");
        inspect_fix(&self->findings, "plug the adapter in and load its driver (ip -brief link show type can); without "
                                     "hardware: iwheel-sim --can unix:/tmp/bus, then: iwheelctl doctor unix:/tmp/bus");
    }
}

static void print_text(const paper_t *paper, tone_t tone, const char *text) {
    for (bool first = true; *text != '\0' || first; first = false) {
        const size_t cut = text_cut(text, PAPER_WIDTH - INDENT);
        paper_print(paper, tone, "%s%.*s", first ? "" : "      ", (int)cut, text);
        paper_end(paper);
        text += cut;
        text += strspn(text, " ");
    }
}

void doctor_print(const doctor_t *self, unsigned first) {
    static const tone_t tones[] = {TONE_GOOD, TONE_CARE, TONE_BAD, TONE_FAINT};
    const paper_t paper = {.out = stdout, .colour = text_wants_colour(stdout)};
    for (unsigned i = first; i < self->findings.count; i++) {
        const inspect_finding_t *finding = &self->findings.finding[i];
        paper_text(&paper, tones[finding->verdict], INDENT, inspect_verdict_word(finding->verdict));
        print_text(&paper, TONE_PLAIN, finding->text);
        if (finding->fix[0] != '\0') {
            // Printed in one line, so that users can copy it.
            paper_print(&paper, TONE_TITLE, "      -> %s", finding->fix);
            paper_end(&paper);
        }
    }
}

static void print_sum(const doctor_t *self) {
    const unsigned *total = self->findings.total;
    (void)printf("%u ok, %u to check, %u wrong%s\n", total[INSPECT_OK], total[INSPECT_WARN], total[INSPECT_FAIL],
                 (total[INSPECT_FAIL] > 0U) ? "; fix the first one, then run doctor again" : "");
}

static json_t *rates_of(const doctor_t *self) {
    json_t *rates = json_array();
    for (unsigned i = 0; i < IW_CODEC_ROWS && self->traffic.span_us > 0U; i++) {
        const iw_codec_row_t *row = &iw_codec_rows[i];
        (void)json_array_append_new(rates,
                                    json_pack("{s:i,s:s,s:s,s:I,s:I}", "id", (int)row->id, "name",
                                              iw_codec_name((iw_codec_kind_t)row->kind), "side", text_side(row->side),
                                              "nominal_mHz", (json_int_t)inspect_nominal_mHz(row), "measured_mHz",
                                              (json_int_t)inspect_rate_mHz(&self->traffic, i)));
    }
    return rates;
}

static void print_json(const doctor_t *self) {
    json_t *list = json_array();
    const bool listened = self->traffic.span_us > 0U;
    for (unsigned i = 0; i < self->findings.count; i++) {
        const inspect_finding_t *finding = &self->findings.finding[i];
        (void)json_array_append_new(list, json_pack("{s:s,s:s,s:s,s:s?}", "check", finding->check, "verdict",
                                                    inspect_verdict_word(finding->verdict), "text", finding->text,
                                                    "cure", (finding->fix[0] != '\0') ? finding->fix : NULL));
    }
    json_t *load =
        listened ? json_integer(inspect_load_permille(&self->traffic, self->config.bus.bitrate)) : json_null();
    json_t *root = json_pack("{s:b,s:s?,s:b,s:o,s:o,s:o}", "ok", self->findings.total[INSPECT_FAIL] == 0U, "bus",
                             self->bus, "gateway", self->gateway.result == NEAR_FOUND, "findings", list, "rates",
                             rates_of(self), "load_permille", load);
    (void)text_json_value(root, stdout);
    json_decref(root);
}

static void examine(doctor_t *self, const words_t *words) {
    inspect_begin(&self->findings);
    near_find(self->ctl, words->bus, &self->gateway);
    choose_bus(self, words);
    doctor_check_gateway(self);
    const bool able = doctor_check_machine(self);
    if (self->bus == NULL) {
        add_no_bus(self);
    } else if (able) {
        if (!self->ctl->json && text_live_columns(stderr) > 0U) {
            (void)fprintf(stderr, "listening to %s for %.1f s ...\r", self->bus, self->listen_ms / 1e3);
        }
        doctor_check_bus(self);
    }
}

/// Returns true when the e-stop is at that level; false if the time is over or a key was pressed.
static bool await_level(doctor_t *self, bool pressed, bool *out_skipped) {
    const int64_t end_us = client_now_us() + WAIT_US;
    while (client_now_us() < end_us) {
        if (self->gateway.result == NEAR_FOUND) {
            json_decref(self->gateway.status);
            self->gateway.status = near_ask(self->ctl, json_pack("{s:s}", "cmd", "status"));
        }
        const inspect_estop_t estop = doctor_estop(self);
        const char *where = (estop.pressed_at != NULL) ? estop.pressed_at : "both";
        if (estop.level >= 0 && (estop.level > 0) == pressed && (!pressed || strcmp(where, "both") == 0)) {
            return true;
        }
        struct pollfd key = {.fd = STDIN_FILENO, .events = POLLIN};
        if (poll(&key, 1, POLL_MS) > 0) {
            char line[64];
            *out_skipped = true;
            (void)!read(STDIN_FILENO, line, sizeof line);
            return false;
        }
    }
    return false;
}

static void add_unseen(doctor_t *self, bool skipped, const char *what) {
    if (skipped) {
        inspect_add(&self->findings, "estop_press", INSPECT_WARN, "e-stop: %s was not tried", what);
        inspect_fix(&self->findings, "run doctor again and press the button when asked");
    } else {
        inspect_add(&self->findings, "estop_press", INSPECT_FAIL, "e-stop: no %s was seen within 20 s", what);
        inspect_fix(&self->findings, "check the button's wire, [estop] line and [estop] active");
    }
}

/// Asks the operator at a terminal for a press and a release, and reads them from the input that will stop the wheels.
static void press(doctor_t *self) {
    bool skipped = false;
    const inspect_estop_t before = doctor_estop(self);
    const char *state = text_word(self->gateway.status, "state");
    if (!before.present || before.level != 0) {
        return;
    }
    if (self->gateway.result == NEAR_FOUND && (strcmp(state, "armed") == 0 || strcmp(state, "stopping") == 0)) {
        inspect_add(&self->findings, "estop_press", INSPECT_WARN, "e-stop: not tried, because a client drives");
        inspect_fix(&self->findings, "iwheelctl stop, then run doctor again");
        return;
    }
    (void)fputs("\nPress the e-stop button now (Enter skips this) ... ", stdout);
    (void)fflush(stdout);
    if (!await_level(self, true, &skipped)) {
        (void)fputs("\n", stdout);
        add_unseen(self, skipped, "press");
        return;
    }
    (void)fputs("seen. Release it ... ", stdout);
    (void)fflush(stdout);
    const bool released = await_level(self, false, &skipped);
    (void)fputs(released ? "seen.\n\n" : "\n\n", stdout);
    if (!released) {
        add_unseen(self, skipped, "release");
        return;
    }
    inspect_add(&self->findings, "estop_press", INSPECT_OK, "e-stop: press and release were seen%s",
                (self->gateway.result == NEAR_FOUND) ? "; the gateway is latched now, as it must be" : "");
    if (self->gateway.result == NEAR_FOUND) {
        inspect_fix(&self->findings, "iwheelctl reset");
    }
}

int verb_doctor(ctl_t *self, int count, char **words) {
    words_t parsed;
    static doctor_t doctor;
    int code = parse_words(count, words, &parsed);
    doctor = (doctor_t){.ctl = self, .listen_ms = (unsigned)(parsed.listen_us / 1000)};
    const doctor_named_t bus = {"IFACE", parsed.bus};
    if (code == CTL_OK) {
        code = doctor_configure(&doctor.config, parsed.config, &bus, parsed.estop);
    }
    if (code != CTL_OK) {
        return code;
    }
    examine(&doctor, &parsed);
    if (self->json) {
        print_json(&doctor);
    } else {
        doctor_print(&doctor, 0);
        const unsigned printed = doctor.findings.count;
        if (!parsed.no_press && doctor.open && isatty(STDIN_FILENO) == 1 && isatty(STDOUT_FILENO) == 1) {
            press(&doctor);
            doctor_print(&doctor, printed);
        }
        print_sum(&doctor);
    }
    const bool failed = doctor.findings.total[INSPECT_FAIL] > 0U;
    doctor_close(&doctor);
    return failed ? CTL_NO : CTL_OK;
}
