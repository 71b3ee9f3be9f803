// SPDX-License-Identifier: MIT
/// What people read about the gateway: what it tells of itself at start, and `--check`.
#ifndef GATEWAY_REPORT_H
#define GATEWAY_REPORT_H

#include "daemon.h"

/// Version, bus, e-stop, stop budget, what was never verified, warnings: to the log.
void gw_report_start(gw_daemon_t *daemon);

/// A bus or e-stop that cannot be opened: cause and cure.
void gw_report_unopened(const gateway_config_t *config, const char *culprit, int error, FILE *err);

/// Lines "ok", "warn" or "fail" on `out`, each with what mends it; listens to the bus for half a second, sends
/// nothing. 0, or 1 if something failed.
int gw_report_check(gw_daemon_t *daemon, FILE *out);

#endif
