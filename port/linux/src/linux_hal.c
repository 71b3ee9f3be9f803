// SPDX-License-Identifier: MIT
#include "iwheel_linux/linux_hal.h"

#include <errno.h>

/// Whatever is opened first is closed again if the second fails: nothing stays open on failure.
int iw_linux_hal_open(iw_linux_hal_t *self, const char *bus_name, const iw_estop_wish_t *estop,
                      const char **out_culprit) {
    *self = (iw_linux_hal_t){
        .bus_ops = iw_bus_backend(bus_name), .estop_ops = iw_estop_backend(estop->name), .estop_last = -1};
    *out_culprit = bus_name;
    if (self->bus_ops == NULL) {
        return ENOTSUP;
    }
    if (self->estop_ops == NULL) {
        *out_culprit = estop->name;
        return ENOTSUP;
    }
    int error = self->bus_ops->open(&self->bus, bus_name);
    if (error != 0) {
        return error;
    }
    error = self->estop_ops->open(&self->estop, estop);
    if (error != 0) {
        *out_culprit = estop->name;
        self->bus_ops->close(&self->bus);
    }
    return error;
}

void iw_linux_hal_close(iw_linux_hal_t *self) {
    self->bus_ops->close(&self->bus);
    self->estop_ops->close(&self->estop);
}

static int hal_send(void *context, const iw_can_frame_t *frame) {
    iw_linux_hal_t *self = (iw_linux_hal_t *)context;
    return self->bus_ops->send(&self->bus, frame);
}

/// The tap sees a frame before the core does: a recording has the frame before the decision that it caused.
static int hal_receive(void *context, iw_can_frame_t *out_frame) {
    iw_linux_hal_t *self = (iw_linux_hal_t *)context;
    const int result = self->bus_ops->receive(&self->bus, out_frame);
    if (result > 0 && self->tap != NULL) {
        self->tap(self->tap_context, out_frame);
    }
    return result;
}

static iw_bus_state_t hal_bus_state(void *context) {
    iw_linux_hal_t *self = (iw_linux_hal_t *)context;
    return self->bus_ops->state(&self->bus);
}

static int hal_purge(void *context) {
    iw_linux_hal_t *self = (iw_linux_hal_t *)context;
    return self->bus_ops->purge(&self->bus);
}

/// `estop_quiet` holds for one look only: the next step without a wait in between must read the edges again.
static int hal_estop_pressed(void *context) {
    iw_linux_hal_t *self = (iw_linux_hal_t *)context;
    self->estop_last = self->estop_ops->pressed(&self->estop, self->estop_quiet);
    self->estop_quiet = false;
    return self->estop_last;
}

iw_hal_t iw_linux_hal_functions(iw_linux_hal_t *self) {
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
    return self->bus_ops->watch_fd(&self->bus);
}

int iw_linux_hal_estop_fd(const iw_linux_hal_t *self) {
    return self->estop_ops->watch_fd(&self->estop);
}

void iw_linux_hal_waited(iw_linux_hal_t *self, bool estop_told) {
    self->estop_quiet = !estop_told;
}

void iw_linux_hal_tend(iw_linux_hal_t *self, iw_time_us_t now_us) {
    self->bus_ops->tend(&self->bus, now_us);
    self->estop_ops->tend(&self->estop, now_us);
}

/// The sooner of both backends' times.
iw_time_us_t iw_linux_hal_next_us(const iw_linux_hal_t *self) {
    const iw_time_us_t bus_us = self->bus_ops->next_us(&self->bus);
    const iw_time_us_t estop_us = self->estop_ops->next_us(&self->estop);
    return (bus_us < estop_us) ? bus_us : estop_us;
}

const iw_bus_link_t *iw_linux_hal_link(const iw_linux_hal_t *self) {
    return self->bus_ops->link(&self->bus);
}

int iw_linux_hal_estop_trouble(const iw_linux_hal_t *self) {
    return self->estop_ops->trouble(&self->estop);
}
