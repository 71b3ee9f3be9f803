// SPDX-License-Identifier: MIT
/// What people read about the gateway: what it tells of itself at start, and `--check`.
#ifndef GATEWAY_REPORT_H
#define GATEWAY_REPORT_H

#include "clients/listener.h"
#include "config/gateway_config.h"
#include "process/log.h"

#include "inspect.h"

/// Version, bus, e-stop, stop budget, what is not configured: to the log. `simulated`: the e-stop is; `watched`: there is a socket to
/// watch by.
void gw_report_start(const gateway_config_t *config, bool simulated, bool watched, gw_log_t *log);

/// What the bus is to be, and a socket, by the configuration.
inspect_wish_t gw_report_wish(const gateway_config_t *config);
gw_listener_wish_t gw_report_socket(const gateway_config_t *config, gw_right_t right);

/// A bus or e-stop that cannot be opened: cause and cure.
void gw_report_unopened(const gateway_config_t *config, const char *culprit, int error, FILE *err);

/// Lines "ok", "warn", "fail" or "skip" on `out`, each with what mends it; listens to the bus for half a second, sends and makes
/// nothing. 1 if something failed; else EX_UNAVAILABLE if something could not be looked at on this machine; else 0, also if
/// the gateway would start and only refuse arm: setpoint type or current role are not known yet.
int gw_report_check(const gateway_config_t *config, FILE *out);

#endif
