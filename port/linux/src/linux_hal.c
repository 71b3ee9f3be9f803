// SPDX-License-Identifier: MIT
#include "iwheel_linux/linux_hal.h"

#include "unix_link.h"

#include <errno.h>
#include <string.h>

/// There is nothing to open or to ask, and no function of it is called.
static const iw_estop_ops_t no_estop_ops = {.present = false};

/// The kind for a name as in the configuration, which alone decides; NULL if this build has none for it.
static const iw_estop_ops_t *estop_kind(const char *name) {
    if (iw_unix_link_is_name(name)) {
        return &iw_unix_estop_ops;
    }
    return (strcmp(name, "none") == 0) ? &no_estop_ops : iw_gpio_estop_ops;
}

static bool has_second(const iw_estop_wish_t *wish) {
    return wish->name2 != NULL && strcmp(wish->name2, "none") != 0;
}

/// A line that is read twice agrees with itself for ever: the second contact would show nothing.
static bool are_one_line(const char *name, const char *other) {
    iw_estop_seen_t seen[IW_ESTOP_CONTACTS];
    if (strcmp(name, other) == 0) {
        return true;
    }
    return iw_estop_see(name, &seen[0]) == 0 && iw_estop_see(other, &seen[1]) == 0 &&
           strcmp(seen[0].node, seen[1].node) == 0 && seen[0].offset == seen[1].offset;
}

/// The first contact is open.
static int open_second(iw_linux_hal_t *self, const iw_estop_wish_t *wish) {
    const iw_estop_wish_t second = {.name = wish->name2,
                                    .active_high = wish->active_high2,
                                    .debounce_ms = wish->debounce_ms,
                                    .chip = wish->chip2,
                                    .chip_line = wish->chip2_line};
    int error = 0;
    if (estop_kind(wish->name2) != self->estop_ops) {
        error = EXDEV;
    } else if (are_one_line(wish->name, wish->name2)) {
        error = ENOTUNIQ;
    } else {
        error = self->estop_ops->open(&self->estop2, &second);
    }
    self->two_contacts = error == 0;
    return error;
}

static int open_estop(iw_linux_hal_t *self, const iw_estop_wish_t *wish, const char **out_culprit) {
    *out_culprit = wish->name;
    if (self->estop_ops == NULL) {
        return ENOTSUP;
    }
    int error = self->estop_ops->present ? self->estop_ops->open(&self->estop, wish) : 0;
    if (error == 0 && has_second(wish)) {
        *out_culprit = wish->name2;
        error = open_second(self, wish);
        if (error != 0 && self->estop_ops->present) {
            self->estop_ops->close(&self->estop);
        }
    }
    return error;
}

/// Whatever is opened first is closed again if the second fails: nothing stays open on failure.
int iw_linux_hal_open(iw_linux_hal_t *self, const char *bus_name, const iw_estop_wish_t *estop,
                      const char **out_culprit) {
    *self = (iw_linux_hal_t){.estop_ops = estop_kind(estop->name), .estop_last = -1, .contact_last = {-1, 0}};
    iw_estop_pair_init(&self->pair, estop->discrepancy_ms * (uint32_t)IW_US_PER_MS);
    *out_culprit = bus_name;
    int error = iw_bus_open(&self->bus, bus_name);
    if (error != 0) {
        return error;
    }
    error = open_estop(self, estop, out_culprit);
    if (error != 0) {
        iw_bus_close(&self->bus);
    }
    return error;
}

void iw_linux_hal_close(iw_linux_hal_t *self) {
    iw_bus_close(&self->bus);
    if (self->estop_ops->present) {
        self->estop_ops->close(&self->estop);
    }
    if (self->two_contacts) {
        self->estop_ops->close(&self->estop2);
    }
}

/// Both are always read: an edge of one must not wait until the other is released. `estop_quiet` holds for one look
/// only: the next step without a wait in between must read the edges again.
int iw_linux_hal_pressed(iw_linux_hal_t *self) {
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
    return iw_bus_send(&((iw_linux_hal_t *)context)->bus, frames, count);
}

static int hal_receive(void *context, iw_can_frame_t *out_frame) {
    return iw_bus_receive(&((iw_linux_hal_t *)context)->bus, out_frame);
}

static iw_bus_state_t hal_bus_state(void *context) {
    return iw_bus_state(&((iw_linux_hal_t *)context)->bus);
}

static int hal_purge(void *context) {
    return iw_bus_purge(&((iw_linux_hal_t *)context)->bus);
}

static int hal_estop_pressed(void *context) {
    return iw_linux_hal_pressed((iw_linux_hal_t *)context);
}

iw_hal_t iw_linux_hal(iw_linux_hal_t *self) {
    return (iw_hal_t){
        .send = hal_send,
        .receive = hal_receive,
        .bus_state = hal_bus_state,
        .purge = hal_purge,
        .estop_pressed = hal_estop_pressed,
        .context = self,
    };
}

int iw_linux_hal_bus_fd(const iw_linux_hal_t *self) {
    return iw_bus_fd(&self->bus);
}

int iw_linux_hal_estop_fd(const iw_linux_hal_t *self) {
    return self->estop_ops->present ? self->estop_ops->watch_fd(&self->estop) : -1;
}

int iw_linux_hal_estop2_fd(const iw_linux_hal_t *self) {
    return self->two_contacts ? self->estop_ops->watch_fd(&self->estop2) : -1;
}

void iw_linux_hal_waited(iw_linux_hal_t *self, iw_linux_told_t told) {
    self->estop_quiet = !told.estop;
    iw_bus_waited(&self->bus, told.bus);
}

void iw_linux_hal_tend(iw_linux_hal_t *self, iw_time_us_t now_us) {
    self->now_us = now_us;
    iw_bus_tend(&self->bus, now_us);
    if (self->estop_ops->present) {
        self->estop_ops->tend(&self->estop, now_us);
    }
    if (self->two_contacts) {
        self->estop_ops->tend(&self->estop2, now_us);
    }
}

static iw_time_us_t sooner(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us < b_us) ? a_us : b_us;
}

/// The sooner of all backends' times.
iw_time_us_t iw_linux_hal_next_us(const iw_linux_hal_t *self) {
    const iw_time_us_t bus_us = iw_bus_next_us(&self->bus);
    const iw_time_us_t estop_us = self->estop_ops->present ? self->estop_ops->next_us(&self->estop) : IW_NEVER;
    if (!self->two_contacts) {
        return sooner(bus_us, estop_us);
    }
    const iw_time_us_t second_us = sooner(self->estop_ops->next_us(&self->estop2), iw_estop_pair_next_us(&self->pair));
    return sooner(sooner(bus_us, estop_us), second_us);
}

const iw_bus_link_t *iw_linux_hal_link(const iw_linux_hal_t *self) {
    return iw_bus_link(&self->bus);
}

/// NULL: there is no such contact.
static const iw_backend_store_t *contact_of(const iw_linux_hal_t *self, unsigned contact) {
    const iw_backend_store_t *second = self->two_contacts ? &self->estop2 : NULL;
    const iw_backend_store_t *first = self->estop_ops->present ? &self->estop : NULL;
    return (contact == 0U) ? first : second;
}

int iw_linux_hal_estop_trouble(const iw_linux_hal_t *self, unsigned contact) {
    const iw_backend_store_t *store = contact_of(self, contact);
    return (store != NULL) ? self->estop_ops->trouble(store) : 0;
}

bool iw_linux_hal_estop_seen(const iw_linux_hal_t *self, unsigned contact, iw_estop_seen_t *out_seen) {
    const iw_estop_ops_t *kind = self->estop_ops;
    const iw_backend_store_t *store = contact_of(self, contact);
    const iw_estop_seen_t *seen = (kind->seen == NULL || store == NULL) ? NULL : kind->seen(store);
    if (seen != NULL) {
        *out_seen = *seen;
    }
    return seen != NULL;
}
