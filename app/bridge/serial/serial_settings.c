// SPDX-License-Identifier: MIT
#include "serial_settings.h"

#include "serial_port.h"

#include "iwheel_northbound/line.h"

#include "serial_keys.h"

#define FIELD(member)             SETTINGS_FIELD(serial_settings_t, member)
#define NUMBER(member, low, high) .kind = SETTINGS_NUMBER, .min = (low), .max = (high), FIELD(member)
#define TEXT(member, judge)       .kind = SETTINGS_TEXT, .wrong = (judge), FIELD(member)
#define MODE(member)              .kind = SETTINGS_MODE, FIELD(member)

static const char *wrong_port(const char *text) {
    return (text[0] == '/') ? NULL
                            : "is not the path of a port; write an absolute path, as ls /dev/serial/by-id/* shows it";
}

static const settings_key_t keys[] = {
    {"board", "port", "", TEXT(board.port, wrong_port)},
    {"board", "baud", " bit/s", NUMBER(board.baud, 115200, 2000000)},
    {"northbound", "socket", "", TEXT(northbound.socket, settings_wrong_socket)},
    {"northbound", "mode", "", MODE(northbound.mode)},
    {"northbound", "group", "", TEXT(northbound.group, settings_wrong_group)},
    {"northbound", "max_clients", " clients", NUMBER(northbound.max_clients, 1, 8)},
    {"northbound", "watch_socket", "", TEXT(northbound.watch_socket, settings_wrong_socket)},
    {"northbound", "watch_mode", "", MODE(northbound.watch_mode)},
    {"northbound", "watch_group", "", TEXT(northbound.watch_group, settings_wrong_group)},
    {"northbound", "max_watchers", " clients", NUMBER(northbound.max_watchers, 1, 7)},
};

const serial_settings_t serial_settings_standard = {
    .board = {"/dev/iwheel-board", 1000000},
    .northbound = {.socket = "/run/iwheel/gateway.sock",
                   .mode = 0660,
                   .group = "iwheel",
                   .max_clients = 5,
                   .watch_socket = "none",
                   .watch_mode = 0660,
                   .watch_group = "iwheel-watch",
                   .max_watchers = 3},
};

static unsigned line_of(const char *key, const unsigned *lines) {
    return lines[settings_find(&serial_settings_form, NULL, key) - keys];
}

static void relate(settings_report_t *report, const void *values, const unsigned *lines) {
    const serial_settings_t *settings = values;
    if (!serial_port_has_baud(settings->board.baud)) {
        settings_complain(
            report, line_of("baud", lines),
            "baud = %u is not a rate of serial ports; write 115200, 921600, 1000000 or 2000000, as the image "
            "was built",
            (unsigned)settings->board.baud);
    }
    if (settings->northbound.max_clients + settings->northbound.max_watchers > IWN_LINE_CHANNELS) {
        settings_complain(
            report, line_of("max_clients", lines),
            "max_clients %u and max_watchers %u are more than the %u channels of the line; lower one of them",
            (unsigned)settings->northbound.max_clients, (unsigned)settings->northbound.max_watchers, IWN_LINE_CHANNELS);
    }
}

const settings_form_t serial_settings_form = {
    .keys = keys,
    .help = serial_keys,
    .count = sizeof keys / sizeof keys[0],
    .program = "iwheel-serial",
    .missing = "create it from share/serial.conf",
    .relate = relate,
};
