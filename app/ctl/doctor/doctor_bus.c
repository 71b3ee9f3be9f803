// SPDX-License-Identifier: MIT
// Findings from the gateway's status and from the bus.
#include "doctor.h"
#include "inspect/assumption.h"
#include "status/advice.h"
#include "text/ctl_text.h"

#include "iwheel_northbound/words.h"

#include <grp.h>
#include <string.h>
#include <sys/stat.h>

static bool forces_known(const json_t *status) {
    return json_is_integer(json_object_get(json_object_get(status, "left"), "force_net_mN")) &&
           json_is_integer(json_object_get(json_object_get(status, "right"), "force_net_mN"));
}

static void add_contradicted(doctor_t *self, const char *name, const json_t *entry) {
    iw_assumption_item_t item = IW_ASSUMPTION_ITEMS; // Item of a gateway that is newer than this program.
    const bool known = iwn_assumption_item_of(name, &item);
    const bool tared = known && item == IW_ASSUMPTION_OFFSET_INCLUDED && forces_known(self->gateway.status);
    const bool harmless = known && item == IW_ASSUMPTION_DLC;
    inspect_add(&self->findings, "ledger",
                tared      ? INSPECT_OK
                : harmless ? INSPECT_WARN
                           : INSPECT_FAIL,
                "assumption %s is contradicted: %s%s", name, text_word(entry, "reason"),
                tared ? "; the tare has resolved it" : "");
    if (!tared) {
        inspect_fix(&self->findings, "%s", inspect_assumption_fix(item));
    }
}

static void list_contradicted(doctor_t *self, json_t *assumptions) {
    const char *name = NULL;
    json_t *entry = NULL;
    unsigned assumed = 0;
    unsigned confirmed = 0;
    json_object_foreach(assumptions, name, entry) {
        const char *state = text_word(entry, "state");
        assumed += (strcmp(state, "assumed") == 0) ? 1U : 0U;
        confirmed += (strcmp(state, "confirmed") == 0) ? 1U : 0U;
        if (strcmp(state, "contradicted") == 0) {
            add_contradicted(self, name, entry);
        }
    }
    if (assumed + confirmed > 0U) {
        inspect_add(&self->findings, "ledger", INSPECT_OK,
                    "assumptions about the wheels: %u confirmed, %u never verified (iwheelctl status lists them)",
                    confirmed, assumed);
    }
}

/// Reports the settings that arm needs and that are not configured, in the words of the gateway's --check.
static void list_unset(doctor_t *self) {
    static const struct {
        const char *item;
        const char *key;
    } needed[] = {{"setpoint_type", "setpoint_type"}, {"current_role", "current_role"}, {"track", "track_mm"}};
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++) {
        if (advice_is_unset(self->gateway.status, needed[i].item)) {
            inspect_add(&self->findings, "config", INSPECT_WARN, "%s not configured: the gateway refuses arm",
                        needed[i].key);
            inspect_fix(&self->findings,
                        "set it under [wheels] in the configuration; if it is unknown: iwheelctl bringup finds it");
        }
    }
}

/// Reports a setpoint that no node acknowledges: arm is refused because of it, and it may be sent late.
static void judge_sending(doctor_t *self) {
    char fix[ADVICE_SIZE];
    if (advice_is_present(self->gateway.status, "send_stalled")) {
        inspect_add(&self->findings, "send_stalled", INSPECT_FAIL,
                    "a setpoint of the gateway is not acknowledged on the bus");
        (void)advice_fix(self->gateway.status, "send_stalled", fix);
        inspect_fix(&self->findings, "%s", fix);
    }
}

static void check_status(doctor_t *self) {
    inspect_findings_t *findings = &self->findings;
    const json_t *status = self->gateway.status;
    const char *state = text_word(status, "state");
    const bool latched = strcmp(state, "latched") == 0;
    inspect_add(findings, "gateway", latched ? INSPECT_WARN : INSPECT_OK, "gateway %s at %s serves %s: %s%s%s",
                text_word(status, "version"), self->gateway.path, self->gateway.bus, state, latched ? ", " : "",
                latched ? text_word(status, "cause") : "");
    if (latched) {
        inspect_fix(findings, "iwheelctl why prints the cause; when it is gone: iwheelctl reset");
    }
    judge_sending(self);
    if (advice_is_present(status, "second_master")) {
        inspect_add(findings, "second_master", INSPECT_FAIL,
                    "the gateway receives setpoints of another sender, id 266 (0x10A) or 298 (0x12A)");
        inspect_fix(findings, "switch off the other program or device that sends them");
    }
    if (!json_is_true(json_object_get(status, "listen_only"))) {
        list_unset(self);
    }
    list_contradicted(self, json_object_get(status, "ledger"));
}

/// Suggests the group whose members may use the socket (or its directory).
static void fix_denied(doctor_t *self) {
    struct stat status;
    const struct group *group = (stat(self->gateway.path, &status) == 0) ? getgrgid(status.st_gid) : NULL;
    inspect_fix(&self->findings, "sudo usermod -aG %s $USER, then log in again",
                (group != NULL) ? group->gr_name : "iwheel");
}

void doctor_check_gateway(doctor_t *self) {
    inspect_findings_t *findings = &self->findings;
    const char *path = self->gateway.path;
    switch (self->gateway.result) {
    case NEAR_FOUND:
        check_status(self);
        break;
    case NEAR_OTHER:
        inspect_add(findings, "gateway", INSPECT_OK, "gateway at %s: it serves %s, not this bus", path,
                    self->gateway.bus);
        break;
    case NEAR_DENIED:
        inspect_add(findings, "gateway", INSPECT_FAIL, "gateway at %s: you may not use it", path);
        fix_denied(self);
        break;
    case NEAR_MUTE:
        inspect_add(findings, "gateway", INSPECT_FAIL, "gateway at %s: it accepts the connection and does not answer",
                    path);
        inspect_fix(findings, "see its log: journalctl -u iwheel-gateway; then: systemctl restart iwheel-gateway");
        break;
    case NEAR_SEVERAL:
        inspect_add(findings, "gateway", INSPECT_OK, "several gateways are running: %s", path);
        break;
    case NEAR_NONE:
        inspect_add(findings, "gateway", INSPECT_OK, "gateway: none is running; doctor reads the bus itself");
        break;
    }
}

static bool has_gateway(const doctor_t *self) {
    return self->gateway.result == NEAR_FOUND;
}

/// Returns true if a gateway runs, even one that denies access or does not answer: it holds the e-stop's line and may
/// send.
static bool is_occupied(const doctor_t *self) {
    const near_t result = self->gateway.result;
    return result == NEAR_FOUND || result == NEAR_DENIED || result == NEAR_MUTE;
}

/// Opens bus and e-stop. Returns false if there is no bus to listen to.
static bool open_hal(doctor_t *self) {
    const iwl_estop_config_t line = {.name = is_occupied(self) ? "none" : self->config.estop.line,
                                     .active_high = self->config.estop.active_high,
                                     .debounce_ms = self->config.estop.debounce_ms,
                                     .chip = self->config.estop.chip,
                                     .chip_line = self->config.estop.chip_line,
                                     .name2 = is_occupied(self) ? NULL : self->config.estop.line2,
                                     .active_high2 = self->config.estop.active2_high,
                                     .chip2 = self->config.estop.chip2,
                                     .chip2_line = self->config.estop.chip2_line,
                                     .discrepancy_ms = self->config.estop.discrepancy_ms};
    const inspect_opened_t opened = inspect_open(&self->hal, self->bus, &line, &self->findings);
    self->open = opened.hal;
    return opened.hal && opened.bus;
}

/// Adds the bus state that the gateway knows from before: a controller reports error passive only when it begins.
static void read_gateway(doctor_t *self) {
    if (!has_gateway(self)) {
        return;
    }
    json_t *const status = near_ask(self->ctl, json_pack("{s:s}", "cmd", "status"));
    const char *name = text_word(json_object_get(status, "bus"), "state");
    for (unsigned i = IW_BUS_OFF; i <= (unsigned)IW_BUS_PASSIVE; i++) {
        const iw_bus_state_t state = (iw_bus_state_t)i;
        if (strcmp(name, iwn_bus_state_name(state)) == 0) {
            if (state < self->traffic.worst) {
                self->traffic.worst = state;
            }
            if (state < self->traffic.last) {
                self->traffic.last = state;
            }
        }
    }
    json_decref(status);
}

inspect_estop_t doctor_estop(doctor_t *self) {
    if (!has_gateway(self)) {
        iwl_hal_poll(&self->hal, (iw_time_us_t)client_now_us());
        (void)iwl_hal_pressed(&self->hal);
        return inspect_estop_of(&self->hal, self->config.estop.line);
    }
    const json_t *estop = json_object_get(self->gateway.status, "estop");
    const char *state = text_word(estop, "state");
    return (inspect_estop_t){
        .line = text_word(estop, "line"),
        .present = strcmp(state, "none") != 0,
        .simulated = json_is_true(json_object_get(estop, "simulated")),
        .pressed_at = json_string_value(json_object_get(estop, "pressed_at")),
        .level = (strcmp(state, "released") == 0)    ? 0
                 : (strcmp(state, "pressed") == 0)   ? 1
                 : (strcmp(state, "disagrees") == 0) ? IW_ESTOP_DISAGREES
                                                     : -1,
        .trouble = "the gateway's log has the reason: journalctl -u iwheel-gateway",
    };
}

void doctor_check_bus(doctor_t *self) {
    const inspect_config_t config = {
        .name = self->bus,
        .bitrate_hz = self->config.bus.bitrate,
        .sample_point_permille = self->config.bus.sample_point_permille,
        .refuses = self->config.bus.on_mismatch == GATEWAY_MISMATCH_REFUSE,
        .others_may_send = is_occupied(self),
    };
    if (!open_hal(self)) {
        return;
    }
    inspect_listen(&self->hal, (iw_time_us_t)self->listen_ms * IW_US_PER_MS, &self->traffic);
    read_gateway(self);
    inspect_link(iwl_hal_link(&self->hal), &config, &self->findings);
    inspect_bus(iwl_hal_link(&self->hal), &self->traffic, &config, &self->findings);
    if (has_gateway(self) ||
        (!is_occupied(self) && (strcmp(self->config.estop.line, "none") == 0 || self->hal.estop_ops->present))) {
        const inspect_estop_t estop = doctor_estop(self);
        inspect_estop(&estop, &self->findings);
    }
}

void doctor_close(doctor_t *self) {
    if (self->open) {
        iwl_hal_close(&self->hal);
    }
    self->open = false;
    json_decref(self->gateway.status);
    self->gateway.status = NULL;
}
