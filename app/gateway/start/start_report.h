// SPDX-License-Identifier: MIT
/// What people read about the gateway: what it tells of itself at start, and `--check`.
#ifndef START_REPORT_H
#define START_REPORT_H

#include "sockets/listener.h"

#include "inspect.h"

struct gateway_config;
struct sock_log;

/// Version, bus, e-stop, stop budget, what is not configured: to the log. `simulated`: the e-stop is; `watched`: there is a socket to
/// watch by.
void gw_report_start(const struct gateway_config *config, bool simulated, bool watched, struct sock_log *log);

/// The room for frames that the kernel has granted, and its consequence: to the log.
void gw_report_room(const iwl_bus_link_t *link, struct sock_log *log);

/// What the bus, the e-stop and a socket are to be, by the configuration.
inspect_config_t gw_report_config(const struct gateway_config *config);
iwl_estop_config_t gw_report_estop(const struct gateway_config *config);
sock_listener_config_t gw_report_socket(const struct gateway_config *config, sock_right_t right);

/// A bus or e-stop that cannot be opened: cause and cure.
void gw_report_unopened(const struct gateway_config *config, const char *cause, int error, FILE *err);

/// Lines "ok", "warn", "fail" or "skip" on `out`, each with what mends it; listens to the bus for half a second, sends and makes
/// nothing. 1 if something failed; else EX_UNAVAILABLE if something could not be looked at on this machine; else 0, also if
/// the gateway would start and only refuse arm: setpoint type or current role are not known yet.
int gw_report_check(const struct gateway_config *config, FILE *out);

#endif
