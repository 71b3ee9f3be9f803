// SPDX-License-Identifier: MIT
/// Reports for people: the log lines at the start, and `--check`.
#ifndef START_REPORT_H
#define START_REPORT_H

#include "sockets/listener.h"

#include "inspect.h"

struct gateway_config;
struct sock_log;

/// Logs version, bus, e-stop, stop budget and missing configuration. `simulated`: the e-stop is simulated. `watched`:
/// there is a socket for watchers.
void gw_report_start(const struct gateway_config *config, bool simulated, bool watched, struct sock_log *log);

/// Returns the configured bus, e-stop and socket for the checks of lib/inspect.
inspect_config_t gw_report_config(const struct gateway_config *config);
iwl_estop_config_t gw_report_estop(const struct gateway_config *config);
sock_listener_config_t gw_report_socket(const struct gateway_config *config, sock_right_t right);

/// Logs a bus or e-stop that cannot be opened, with cause and fix.
void gw_report_unopened(const struct gateway_config *config, const char *cause, int error, FILE *err);

/// Prints lines "ok", "warn", "fail" or "skip" to `out`, each with its fix. It receives from the bus for half a second,
/// and neither sends nor creates anything. Returns 1 if something failed, EX_UNAVAILABLE if something could not be
/// checked on this machine, otherwise 0, also if the gateway would start and only refuse arm because setpoint type or
/// current role are not configured.
int gw_report_check(const struct gateway_config *config, FILE *out);

#endif
