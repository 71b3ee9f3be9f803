// SPDX-License-Identifier: MIT
#include "options.h"

#include "begin/begin.h"

#include "iwheel_northbound/text.h"

#include <errno.h>
#include <getopt.h>
#include <sysexits.h>
#include <unistd.h>

enum {
    OPTION_CAN = 256,
    OPTION_SOCKET,
    OPTION_WATCH_SOCKET,
    OPTION_ESTOP,
    OPTION_LISTEN_ONLY,
    OPTION_CHECK,
    OPTION_PRINT,
    OPTION_LOG
};

static const struct option long_options[] = {
    {"config", required_argument, NULL, 'c'},
    {"can", required_argument, NULL, OPTION_CAN},
    {"socket", required_argument, NULL, OPTION_SOCKET},
    {"watch-socket", required_argument, NULL, OPTION_WATCH_SOCKET},
    {"estop", required_argument, NULL, OPTION_ESTOP},
    {"listen-only", no_argument, NULL, OPTION_LISTEN_ONLY},
    {"check", no_argument, NULL, OPTION_CHECK},
    {"print-config", no_argument, NULL, OPTION_PRINT},
    {"log-level", required_argument, NULL, OPTION_LOG},
    {"version", no_argument, NULL, 'V'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static int misuse(FILE *err, const char *what) {
    char plain[256];
    iwn_plain_copy(what, plain, sizeof plain);
    (void)fprintf(err, "iwheel-gateway: %s; see iwheel-gateway --help\n", plain);
    return EX_USAGE;
}

/// Returns false for an unknown option.
static bool take_option(int option, gw_options_t *options) {
    switch (option) {
    case 'c':
        options->config_path = optarg;
        return true;
    case OPTION_CAN:
        options->can = optarg;
        return true;
    case OPTION_SOCKET:
        options->socket = optarg;
        return true;
    case OPTION_WATCH_SOCKET:
        options->watch_socket = optarg;
        return true;
    case OPTION_ESTOP:
        options->estop = optarg;
        return true;
    case OPTION_LISTEN_ONLY:
        options->listen_only = true;
        return true;
    case OPTION_CHECK:
        options->action = GW_CHECK;
        return true;
    case OPTION_PRINT:
        options->action = GW_PRINT_CONFIG;
        return true;
    case 'V':
        options->action = GW_VERSION;
        return true;
    case 'h':
        options->action = GW_HELP;
        return true;
    default:
        return false;
    }
}

int gw_options_parse(int count, char **arguments, gw_options_t *out_options, FILE *err) {
    gw_options_t options = {.log_level = SOCK_LOG_INFO};
    char what[256];
    int option;
    opterr = 0;
    optind = 1;
    while ((option = getopt_long(count, arguments, ":c:hV", long_options, NULL)) != -1) {
        if (!begin_is_value("iwheel-gateway", optarg)) {
            return EX_USAGE;
        }
        if (option == OPTION_LOG) {
            if (!sock_log_level_of(optarg, &options.log_level)) {
                return misuse(err, "--log-level must be error, warning, info or debug");
            }
        } else if (!take_option(option, &options)) {
            (void)snprintf(what, sizeof what, "%s %s", arguments[optind - 1],
                           (option == ':') ? "needs a value" : "is not an option of this program");
            return misuse(err, what);
        }
    }
    if (optind < count) {
        (void)snprintf(what, sizeof what, "\"%s\" is not an option; this program has options only", arguments[optind]);
        return misuse(err, what);
    }
    *out_options = options;
    return 0;
}

int gw_options_configure(const gw_options_t *options, gateway_config_t *out_config, FILE *err) {
    const bool named = options->config_path != NULL;
    const char *path = named ? options->config_path : GATEWAY_CONFIG_PATH;
    const struct {
        const char *name;
        const char *value;
        const char *origin;
    } overrides[] = {
        {"bus.interface", options->can, "--can"},
        {"northbound.socket", options->socket, "--socket"},
        {"northbound.watch_socket", options->watch_socket, "--watch-socket"},
        {"estop.line", options->estop, "--estop"},
    };
    gateway_config_default(out_config);
    int result = 0;
    if (named || access(path, F_OK) == 0 || errno != ENOENT) {
        result = gateway_config_load(path, out_config, err);
    }
    for (size_t i = 0; i < sizeof overrides / sizeof overrides[0] && result == 0; i++) {
        const char *value = overrides[i].value;
        if (value != NULL &&
            gateway_config_override(out_config, overrides[i].name, value, overrides[i].origin, err) != 0) {
            result = EX_USAGE;
        }
    }
    out_config->core.listen_only = options->listen_only;
    return result;
}
