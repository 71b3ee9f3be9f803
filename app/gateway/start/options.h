// SPDX-License-Identifier: MIT
/// The command line.
#ifndef GATEWAY_OPTIONS_H
#define GATEWAY_OPTIONS_H

#include "config/gateway_config.h"
#include "sockets/log.h"

typedef enum { GW_RUN = 0, GW_CHECK, GW_PRINT_CONFIG, GW_VERSION, GW_HELP } gw_action_t;

/// Texts point into the arguments; NULL: not given.
typedef struct {
    gw_action_t action;
    const char *config_path;
    const char *can;
    const char *socket;
    const char *watch_socket;
    const char *estop;
    sock_log_level_t log_level;
    bool listen_only;
} gw_options_t;

/// 0, or EX_USAGE after cause and cure have been printed on `err`.
int gw_options_parse(int count, char **arguments, gw_options_t *out_options, FILE *err);

/// The configuration in force: file (the default one only if it exists), then command line. 0, or a sysexits code
/// after cause and cure have been printed on `err`.
int gw_options_configure(const gw_options_t *options, gateway_config_t *out_config, FILE *err);

#endif
