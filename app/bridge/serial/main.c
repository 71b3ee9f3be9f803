// SPDX-License-Identifier: MIT
#include "relay.h"

#include "common/program.h"

#include "serial_texts.h"

#include <stdlib.h>
#include <sysexits.h>
#include <unistd.h>

/// Asks the board for its identity for two seconds.
static int check(const serial_settings_t *settings, relay_t *relay) {
    serial_port_t port;
    serial_link_t *link = &relay->link;
    char words[512];
    char ask[64] = "\n"; // Ends an incomplete line.
    const iwn_line_t question = {.json = RELAY_ASK, .length = sizeof RELAY_ASK - 1U};
    const size_t length = 1U + iwn_line_write(&question, &ask[1], sizeof ask - 1U);
    (void)puts("ok    configuration");
    if (serial_port_open(&port, settings->board.port, settings->board.baud, words, sizeof words) != 0) {
        (void)printf("fail  %s\n", words);
        return 1;
    }
    serial_link_init(link, bridge_now_us());
    for (unsigned i = 0; i < 200U && link->state == SERIAL_SILENT; i++) {
        char bytes[512];
        iwn_line_t line;
        if (i % 30U == 0U) {
            (void)serial_port_write(&port, ask, length);
        }
        (void)usleep(10000);
        const ssize_t count = serial_port_read(&port, bytes, sizeof bytes);
        for (ssize_t n = 0; n < count; n++) {
            (void)serial_link_put(link, bytes[n], bridge_now_us(), &line);
        }
    }
    serial_port_close(&port);
    if (link->state == SERIAL_SILENT) {
        serial_trouble_write(&link->noise, &(serial_place_t){settings->board.port, settings->board.baud}, words,
                             sizeof words);
        (void)printf("fail  %s\n", words);
        return 1;
    }
    (void)printf("ok    board on %s: version %s\n", settings->board.port, link->version);
    return 0;
}

static int act(int action, const serial_settings_t *settings) {
    relay_t *relay = calloc(1, sizeof *relay);
    if (relay == NULL) {
        (void)fputs("iwheel-serial: not enough memory to start\n", stderr);
        return EX_UNAVAILABLE;
    }
    const int code = (action == BRIDGE_CHECK) ? check(settings, relay) : relay_run(relay, settings);
    free(relay);
    return code;
}

int main(int count, char **arguments) {
    static serial_settings_t settings;
    const bridge_program_t program = {
        .form = &serial_settings_form,
        .path = SERIAL_SETTINGS_PATH,
        .help = serial_help,
        .own = {{"port", "board.port"},
                {"baud", "board.baud"},
                {"socket", "northbound.socket"},
                {"watch-socket", "northbound.watch_socket"}},
        .settings = &settings,
        .standard = &serial_settings_standard,
    };
    int action = BRIDGE_RUN;
    settings = serial_settings_standard;
    const int code = bridge_program_begin(&program, count, arguments, &action);
    return (code == BRIDGE_GO) ? act(action, &settings) : code;
}
