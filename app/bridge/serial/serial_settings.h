// SPDX-License-Identifier: MIT
/// Configuration of the relay: share/serial.conf.
#ifndef SERIAL_SETTINGS_H
#define SERIAL_SETTINGS_H

#include "config/settings.h"

/// Default file. If it is absent, the defaults apply.
#define SERIAL_SETTINGS_PATH "/etc/iwheel/serial.conf"

typedef struct {
    struct {
        char port[108];
        uint32_t baud;
    } board;
    struct {
        char socket[SETTINGS_PATH_SIZE];
        uint16_t mode;
        char group[33];
        uint32_t max_clients;
        char watch_socket[SETTINGS_PATH_SIZE]; ///< "none" if there is none.
        uint16_t watch_mode;
        char watch_group[33];
        uint32_t max_watchers;
    } northbound;
} serial_settings_t;

/// The defaults.
extern const serial_settings_t serial_settings_standard;

extern const settings_form_t serial_settings_form;

#endif
