// SPDX-License-Identifier: MIT
/// Command line of the gateway.
#ifndef GATEWAY_OPTIONS_H
#define GATEWAY_OPTIONS_H

#include "config/gateway_config.h"
#include "sockets/log.h"

typedef enum { GW_RUN = 0, GW_CHECK, GW_PRINT_CONFIG, GW_VERSION, GW_HELP } gw_action_t;

/// Options. Texts point into the arguments; NULL if the option is absent.
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

/// Parses the command line. Returns 0, or EX_USAGE after it has printed cause and fix to `err`.
int gw_options_parse(int count, char **arguments, gw_options_t *out_options, FILE *err);

/// Reads the configuration: the file (the default file only if it exists), then the command line. Returns 0, or a
/// sysexits code after it has printed cause and fix to `err`.
int gw_options_configure(const gw_options_t *options, gateway_config_t *out_config, FILE *err);

#endif
