// SPDX-License-Identifier: MIT
#include "sim_socketcan.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static void nothing_to_do(sim_watch_t *watch) {
    (void)watch; // sim_socketcan_step has read the socket: it runs before every handler.
}

static void explain(int error, const char *interface, sim_reason_t *out_reason) {
    if (error == EAFNOSUPPORT) {
        (void)snprintf(out_reason->text, sizeof out_reason->text,
                       "--can %s: this kernel has no CAN sockets; modprobe can_raw, or use --can unix:PATH", interface);
    } else {
        (void)snprintf(out_reason->text, sizeof out_reason->text, "--can %s: %s", interface, strerror(error));
    }
}

bool sim_socketcan_open(sim_socketcan_t *self, const char *interface, const sim_loop_t *loop, sim_world_t *world,
                        sim_reason_t *out_reason) {
    int const error = iwl_bus_open(&self->bus, interface);
    if (error == ENOTSUP) {
        (void)snprintf(out_reason->text, sizeof out_reason->text,
                       "--can %s: not an interface's name, or this build has no libmnl; apt-get install "
                       "libmnl-dev, configure and build again, or use --can unix:PATH",
                       interface);
        return false;
    }
    if (error != 0) {
        explain(error, interface, out_reason);
        return false;
    }
    self->is_open = true;
    self->world = world;
    self->lost = 0U;
    self->state = IW_BUS_DOWN;
    self->port = sim_world_connect(world);
    sim_world_queue(world, SIM_BUS_QUEUE_MAX); // The interface has its own queue; no more frames are lost here.
    self->watch = (sim_watch_t){nothing_to_do, self, iwl_bus_fd(&self->bus)};
    return sim_loop_add(loop, &self->watch);
}

void sim_socketcan_close(sim_socketcan_t *self) {
    if (self->is_open) {
        iwl_bus_close(&self->bus);
        self->is_open = false;
    }
}

bool sim_socketcan_step(sim_socketcan_t *self, iw_time_us_t now_us) {
    iw_can_frame_t frame;
    if (!self->is_open) {
        return false;
    }
    iwl_bus_poll(&self->bus, now_us);
    iw_bus_state_t const state = iwl_bus_state(&self->bus);
    bool const changed = state != self->state;
    self->state = state;
    while (iwl_bus_receive(&self->bus, &frame) > 0) {
        if (frame.kind == (uint8_t)IW_CAN_RECEIVED && (frame.id & IW_CAN_FD) == 0U) {
            sim_world_submit(self->world, now_us, self->port, &frame);
        }
    }
    return changed;
}

iw_time_us_t sim_socketcan_next_us(const sim_socketcan_t *self) {
    return self->is_open ? iwl_bus_next_us(&self->bus) : IW_NEVER;
}

void sim_socketcan_deliver(sim_socketcan_t *self, const sim_delivery_t *delivery) {
    if (self->is_open && delivery->port != self->port && iwl_bus_send(&self->bus, &delivery->frame, 1) <= 0) {
        self->lost += 1U;
    }
}

bool sim_socketcan_refuses(const char *command) {
    static const char *const refused[] = {"ack", "stall", "busoff", "passive", "bus", "queue"};
    size_t const length = strcspn(command, " \t");
    for (size_t i = 0U; i < sizeof refused / sizeof refused[0]; i++) {
        if (strlen(refused[i]) == length && strncmp(command, refused[i], length) == 0) {
            return true;
        }
    }
    return false;
}
