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

/// Whatever is opened first is closed again if the second fails: nothing stays open on failure.
int iw_linux_hal_open(iw_linux_hal_t *self, const char *bus_name, const iw_estop_wish_t *estop,
                      const char **out_culprit) {
    *self = (iw_linux_hal_t){.estop_ops = estop_kind(estop->name), .estop_last = -1};
    *out_culprit = bus_name;
    int error = iw_bus_open(&self->bus, bus_name);
    if (error != 0) {
        return error;
    }
    if (self->estop_ops == NULL) {
        error = ENOTSUP;
    } else if (self->estop_ops->present) {
        error = self->estop_ops->open(&self->estop, estop);
    }
    if (error != 0) {
        *out_culprit = estop->name;
        iw_bus_close(&self->bus);
    }
    return error;
}

void iw_linux_hal_close(iw_linux_hal_t *self) {
    iw_bus_close(&self->bus);
    if (self->estop_ops->present) {
        self->estop_ops->close(&self->estop);
    }
}

/// `estop_quiet` holds for one look only: the next step without a wait in between must read the edges again.
int iw_linux_hal_pressed(iw_linux_hal_t *self) {
    self->estop_last = self->estop_ops->present ? self->estop_ops->pressed(&self->estop, self->estop_quiet) : 0;
    self->estop_quiet = false;
    return self->estop_last;
}

int iw_linux_hal_bus_fd(const iw_linux_hal_t *self) {
    return iw_bus_fd(&self->bus);
}

int iw_linux_hal_estop_fd(const iw_linux_hal_t *self) {
    return self->estop_ops->present ? self->estop_ops->watch_fd(&self->estop) : -1;
}

void iw_linux_hal_waited(iw_linux_hal_t *self, iw_linux_told_t told) {
    self->estop_quiet = !told.estop;
    iw_bus_waited(&self->bus, told.bus);
}

void iw_linux_hal_tend(iw_linux_hal_t *self, iw_time_us_t now_us) {
    iw_bus_tend(&self->bus, now_us);
    if (self->estop_ops->present) {
        self->estop_ops->tend(&self->estop, now_us);
    }
}

/// The sooner of both backends' times.
iw_time_us_t iw_linux_hal_next_us(const iw_linux_hal_t *self) {
    const iw_time_us_t bus_us = iw_bus_next_us(&self->bus);
    const iw_time_us_t estop_us = self->estop_ops->present ? self->estop_ops->next_us(&self->estop) : IW_NEVER;
    return (bus_us < estop_us) ? bus_us : estop_us;
}

const iw_bus_link_t *iw_linux_hal_link(const iw_linux_hal_t *self) {
    return iw_bus_link(&self->bus);
}

int iw_linux_hal_estop_trouble(const iw_linux_hal_t *self) {
    return self->estop_ops->present ? self->estop_ops->trouble(&self->estop) : 0;
}

bool iw_linux_hal_estop_seen(const iw_linux_hal_t *self, iw_estop_seen_t *out_seen) {
    const iw_estop_ops_t *kind = self->estop_ops;
    const iw_estop_seen_t *seen = (kind->seen == NULL) ? NULL : kind->seen(&self->estop);
    if (seen != NULL) {
        *out_seen = *seen;
    }
    return seen != NULL;
}
