// SPDX-License-Identifier: MIT
#include "iwheel_linux/linux_hal.h"

#include "unix_link.h"

#include <errno.h>
#include <string.h>

/// There is no e-stop, so no function is called.
static const iwl_estop_ops_t no_estop_ops = {.present = false};

/// Returns the kind of e-stop for a configured name, which alone decides; NULL if this build has no such kind.
static const iwl_estop_ops_t *estop_kind(const char *name) {
    if (iwl_unix_link_is_name(name)) {
        return &iwl_unix_estop_ops;
    }
    return (strcmp(name, "none") == 0) ? &no_estop_ops : iwl_gpio_estop_ops;
}

static bool has_second(const iwl_estop_config_t *config) {
    return config->name2 != NULL && strcmp(config->name2, "none") != 0;
}

/// A line that is read as both contacts always agrees with itself, so the second contact would be no check.
static bool are_one_line(const char *name, const char *other) {
    iwl_estop_seen_t seen[IWL_ESTOP_CONTACTS];
    if (strcmp(name, other) == 0) {
        return true;
    }
    return iwl_estop_see(name, &seen[0]) == 0 && iwl_estop_see(other, &seen[1]) == 0 &&
           strcmp(seen[0].node, seen[1].node) == 0 && seen[0].offset == seen[1].offset;
}

/// Opens the second contact. The first one is open.
static int open_second(iwl_hal_t *self, const iwl_estop_config_t *config) {
    const iwl_estop_config_t second = {.name = config->name2,
                                       .active_high = config->active_high2,
                                       .debounce_ms = config->debounce_ms,
                                       .chip = config->chip2,
                                       .chip_line = config->chip2_line};
    int error = 0;
    if (estop_kind(config->name2) != self->estop_ops) {
        error = EXDEV;
    } else if (are_one_line(config->name, config->name2)) {
        error = ENOTUNIQ;
    } else {
        error = self->estop_ops->open(&self->estop2, &second);
    }
    self->two_contacts = error == 0;
    return error;
}

static int open_estop(iwl_hal_t *self, const iwl_estop_config_t *config, const char **out_cause) {
    *out_cause = config->name;
    if (self->estop_ops == NULL) {
        return ENOTSUP;
    }
    int error = self->estop_ops->present ? self->estop_ops->open(&self->estop, config) : 0;
    if (error == 0 && has_second(config)) {
        *out_cause = config->name2;
        error = open_second(self, config);
        if (error != 0 && self->estop_ops->present) {
            self->estop_ops->close(&self->estop);
        }
    }
    return error;
}

/// If the second part fails to open, the first is closed again.
int iwl_hal_open(iwl_hal_t *self, const char *bus_name, const iwl_estop_config_t *estop, const char **out_cause) {
    *self = (iwl_hal_t){.estop_ops = estop_kind(estop->name), .estop_last = -1, .contact_last = {-1, 0}};
    iw_estop_pair_init(&self->pair, estop->discrepancy_ms * (uint32_t)IW_US_PER_MS);
    *out_cause = bus_name;
    int error = iwl_bus_open(&self->bus, bus_name);
    if (error != 0) {
        return error;
    }
    error = open_estop(self, estop, out_cause);
    if (error != 0) {
        iwl_bus_close(&self->bus);
    }
    return error;
}

void iwl_hal_close(iwl_hal_t *self) {
    iwl_bus_close(&self->bus);
    if (self->estop_ops->present) {
        self->estop_ops->close(&self->estop);
    }
    if (self->two_contacts) {
        self->estop_ops->close(&self->estop2);
    }
}

/// Reads both contacts: an edge of one must not wait until the other is released. `estop_quiet` is valid for one
/// reading, because the next step without a wait in between must read the edges again.
int iwl_hal_pressed(iwl_hal_t *self) {
    int *said = self->contact_last;
    said[0] = self->estop_ops->present ? self->estop_ops->pressed(&self->estop, self->estop_quiet) : 0;
    self->estop_last = said[0];
    if (self->two_contacts) {
        said[1] = self->estop_ops->pressed(&self->estop2, self->estop_quiet);
        self->estop_last = iw_estop_pair_see(&self->pair, self->now_us, said[0], said[1]);
    }
    self->estop_quiet = false;
    return self->estop_last;
}

static int hal_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    return iwl_bus_send(&((iwl_hal_t *)context)->bus, frames, count);
}

static int hal_receive(void *context, iw_can_frame_t *out_frame) {
    return iwl_bus_receive(&((iwl_hal_t *)context)->bus, out_frame);
}

static iw_bus_state_t hal_bus_state(void *context) {
    return iwl_bus_state(&((iwl_hal_t *)context)->bus);
}

static int hal_purge(void *context) {
    return iwl_bus_purge(&((iwl_hal_t *)context)->bus);
}

static int hal_estop_pressed(void *context) {
    return iwl_hal_pressed((iwl_hal_t *)context);
}

iw_hal_t iwl_hal(iwl_hal_t *self) {
    return (iw_hal_t){
        .send = hal_send,
        .receive = hal_receive,
        .bus_state = hal_bus_state,
        .purge = hal_purge,
        .estop_pressed = hal_estop_pressed,
        .context = self,
    };
}

int iwl_hal_bus_fd(const iwl_hal_t *self) {
    return iwl_bus_fd(&self->bus);
}

int iwl_hal_estop_fd(const iwl_hal_t *self) {
    return self->estop_ops->present ? self->estop_ops->watch_fd(&self->estop) : -1;
}

int iwl_hal_estop2_fd(const iwl_hal_t *self) {
    return self->two_contacts ? self->estop_ops->watch_fd(&self->estop2) : -1;
}

void iwl_hal_waited(iwl_hal_t *self, iwl_reported_t woken) {
    self->estop_quiet = !woken.estop;
    iwl_bus_waited(&self->bus, woken.bus);
}

void iwl_hal_poll(iwl_hal_t *self, iw_time_us_t now_us) {
    self->now_us = now_us;
    iwl_bus_poll(&self->bus, now_us);
    if (self->estop_ops->present) {
        self->estop_ops->poll(&self->estop, now_us);
    }
    if (self->two_contacts) {
        self->estop_ops->poll(&self->estop2, now_us);
    }
}

static iw_time_us_t sooner(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us < b_us) ? a_us : b_us;
}

/// Returns the earliest time of all backends.
iw_time_us_t iwl_hal_next_us(const iwl_hal_t *self) {
    const iw_time_us_t bus_us = iwl_bus_next_us(&self->bus);
    const iw_time_us_t estop_us = self->estop_ops->present ? self->estop_ops->next_us(&self->estop) : IW_NEVER;
    if (!self->two_contacts) {
        return sooner(bus_us, estop_us);
    }
    const iw_time_us_t second_us = sooner(self->estop_ops->next_us(&self->estop2), iw_estop_pair_next_us(&self->pair));
    return sooner(sooner(bus_us, estop_us), second_us);
}

const iwl_bus_link_t *iwl_hal_link(const iwl_hal_t *self) {
    return iwl_bus_link(&self->bus);
}

/// Returns NULL if there is no such contact.
static const iwl_backend_store_t *contact_of(const iwl_hal_t *self, unsigned contact) {
    const iwl_backend_store_t *second = self->two_contacts ? &self->estop2 : NULL;
    const iwl_backend_store_t *first = self->estop_ops->present ? &self->estop : NULL;
    return (contact == 0U) ? first : second;
}

int iwl_hal_estop_trouble(const iwl_hal_t *self, unsigned contact) {
    const iwl_backend_store_t *store = contact_of(self, contact);
    return (store != NULL) ? self->estop_ops->trouble(store) : 0;
}

bool iwl_hal_estop_seen(const iwl_hal_t *self, unsigned contact, iwl_estop_seen_t *out_seen) {
    const iwl_estop_ops_t *kind = self->estop_ops;
    const iwl_backend_store_t *store = contact_of(self, contact);
    const iwl_estop_seen_t *seen = (kind->seen == NULL || store == NULL) ? NULL : kind->seen(store);
    if (seen != NULL) {
        *out_seen = *seen;
    }
    return seen != NULL;
}
