// SPDX-License-Identifier: MIT
#include "serial_settings.h"

#include "serial_port.h"

#include "iwheel_northbound/line.h"

#define FIELD(member)             SETTINGS_FIELD(serial_settings_t, member)
#define NUMBER(member, low, high) .kind = SETTINGS_NUMBER, .min = (low), .max = (high), FIELD(member)
#define TEXT(member, judge)       .kind = SETTINGS_TEXT, .wrong = (judge), FIELD(member)
#define MODE(member)              .kind = SETTINGS_MODE, FIELD(member)

static const char *wrong_port(const char *text) {
    return (text[0] == '/') ? NULL : "no path of a port; write it from / on, as ls /dev/serial/by-id/* tells it";
}

static const settings_key_t keys[] = {
    {"board", "port", "",
     "The serial port. /dev/iwheel-board is the first board of a known kind: 61-iwheel-serial.rules.",
     TEXT(board.port, wrong_port)},
    {"board", "baud", " bit/s",
     "As the image was built: 115200, 230400, 460800, 500000, 576000, 921600, 1000000, 1152000, 1500000\n"
     "or 2000000. Below 460800 a status on the line delays a command noticeably.",
     NUMBER(board.baud, 115200, 2000000)},
    {"northbound", "socket", "", "Where clients connect: in place of a gateway's.",
     TEXT(northbound.socket, settings_wrong_socket)},
    {"northbound", "mode", "", "Permissions of the socket, octal: who may connect may move the wheels.",
     MODE(northbound.mode)},
    {"northbound", "group", "", "Group of the socket; none: the relay's own.",
     TEXT(northbound.group, settings_wrong_group)},
    {"northbound", "max_clients", " clients", "Connections at the same time; with max_watchers at most 8.",
     NUMBER(northbound.max_clients, 1, 8)},
    {"northbound", "watch_socket", "",
     "Where clients connect that may look, stop and e-stop, but never drive; none: there is no such socket. Tools "
     "find\n"
     "it as watch/NAME.sock in the directory of socket NAME.sock; the unit gives it by --watch-socket.",
     TEXT(northbound.watch_socket, settings_wrong_socket)},
    {"northbound", "watch_mode", "", "Permissions of that socket, octal: who may connect may stop the wheels.",
     MODE(northbound.watch_mode)},
    {"northbound", "watch_group", "", "Group of that socket; none: the relay's own.",
     TEXT(northbound.watch_group, settings_wrong_group)},
    {"northbound", "max_watchers", " clients", "Connections to it at the same time; they take none of max_clients.",
     NUMBER(northbound.max_watchers, 1, 7)},
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
            "baud = %u is no rate that ports have; write 115200, 921600, 1000000 or 2000000, as the image "
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
    .count = sizeof keys / sizeof keys[0],
    .program = "iwheel-serial",
    .missing = "create it from share/serial.conf",
    .relate = relate,
};
