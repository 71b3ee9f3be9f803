// SPDX-License-Identifier: MIT
#include "daemon.h"

#include "start/start_report.h"

_Static_assert(SOCK_PATH_SIZE >= GATEWAY_PATH_SIZE && SOCK_ADDRESS_SIZE >= GATEWAY_ADDRESS_SIZE,
               "every configurable text fits");

void gw_daemon_compose(gw_daemon_t *self) {
    const gateway_config_t *config = &self->config;
    gw_wheels_t *wheels = &self->wheels;
    sock_clients_t *clients = &self->clients;
    wheels->bus = gw_report_config(config);
    wheels->estop = config->estop.line;
    wheels->estop2 = config->estop.line2;
    wheels->health.limits = (gw_health_limits_t){config->health.battery_low_dV, config->health.temperature_high_degC};
    self->assumptions.wheels = wheels;
    self->assumptions.log = &self->log;
    self->assumptions.server = &self->answers.server;
    self->assumptions.configured = (inspect_configured_t){&config->core, config->core.track_mm};
    self->assumptions.button = (gw_button_t){
        .contact = {{config->estop.line, config->estop.active_high}, {config->estop.line2, config->estop.active2_high}},
        .debounce_us = config->estop.debounce_ms * IW_US_PER_MS};
    self->assumptions.bus = config->bus.interface;
    self->answers.wheels = wheels;
    self->answers.assumptions = &self->assumptions;
    self->answers.box = &self->box;
    self->answers.log = &self->log;
    self->answers.clients = clients;
    self->answers.socket = config->northbound.socket;
    self->answers.group = config->northbound.group;
    self->answers.server.bus = wheels->bus.name;
    self->answers.server.max_age_ms = config->northbound.max_age_ms;
    clients->handler = gw_answers_handler(&self->answers);
    clients->log = &self->log;
    clients->most[SOCK_DRIVE] = config->northbound.max_clients;
    clients->most[SOCK_WATCH] = config->northbound.max_watchers;
    gw_answers_begin(&self->answers);
}
