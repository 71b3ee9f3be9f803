// SPDX-License-Identifier: MIT
#include "bus.h"

#include "unix_link.h"

#include <errno.h>
#include <net/if.h>
#include <string.h>

/// Largest number of frames with unknown ids per interval, and the interval. They come after the known ids. A full bus
/// carries fewer.
#define OTHERS_AT_ONCE  256U
#define OTHERS_EVERY_US 10000U
/// Time after a setpoint in which they may be received. Closer to the next setpoint they would delay it.
#define OTHERS_AFTER_SEND_US 3000U
/// Largest number of batches with only error frames in one step: a flood of them must not delay the loop.
#define ERROR_BATCHES_PER_STEP 8U
#define US_PER_S               1000000U
/// Bit rate of the wheels, for a kernel that reports none.
#define BITRATE_ASSUMED_HZ 1000000U

static iwl_bus_t *bus_of(iwl_backend_store_t *store) {
    return (iwl_bus_t *)(void *)store;
}

static const iwl_bus_t *seen(const iwl_backend_store_t *store) {
    return (const iwl_bus_t *)(const void *)store;
}

/// Only the name decides. A name that is too long for an interface is refused, because a truncated one could be another
/// interface.
static const iwl_bus_kind_t *kind_of(const char *name) {
    if (iwl_unix_link_is_name(name)) {
        return &iwl_local_bus_kind;
    }
    return (name[0] != '\0' && strlen(name) < IFNAMSIZ) ? iwl_socketcan_kind : NULL;
}

int iwl_bus_open(iwl_backend_store_t *store, const char *name) {
    iwl_bus_t *bus = bus_of(store);
    memset(store, 0, sizeof *store);
    bus->kind = kind_of(name);
    bus->present = IW_BUS_ACTIVE;
    bus->unhandled = IW_BUS_ACTIVE;
    bus->errors_left = ERROR_BATCHES_PER_STEP;
    bus->watch_fd = -1;
    iwl_socketcan_socket_init(&bus->ours);
    iwl_socketcan_socket_init(&bus->others);
    return (bus->kind == NULL) ? ENOTSUP : bus->kind->open(bus, name);
}

void iwl_bus_close(iwl_backend_store_t *store) {
    bus_of(store)->kind->close(bus_of(store));
}

int iwl_bus_fd(const iwl_backend_store_t *store) {
    return seen(store)->watch_fd;
}

void iwl_bus_waited(iwl_backend_store_t *store, bool woken) {
    bus_of(store)->quiet = !woken;
}

iw_time_us_t iwl_bus_next_us(const iwl_backend_store_t *store) {
    return seen(store)->poll_us;
}

const iwl_bus_link_t *iwl_bus_link(const iwl_backend_store_t *store) {
    return &seen(store)->link;
}

int iwl_bus_purge(iwl_backend_store_t *store) {
    return bus_of(store)->kind->purge(bus_of(store));
}

void iwl_bus_poll(iwl_backend_store_t *store, iw_time_us_t now_us) {
    iwl_bus_t *bus = bus_of(store);
    bus->now_us = now_us;
    bus->errors_left = ERROR_BATCHES_PER_STEP;
    if (now_us >= bus->others_us) {
        bus->others_us = now_us + OTHERS_EVERY_US;
        bus->others_left = OTHERS_AT_ONCE;
    }
    bus->kind->poll(bus);
}

void iwl_bus_lose(iwl_bus_t *bus, int error) {
    bus->up = false;
    bus->unhandled = IW_BUS_DOWN;
    bus->poll_us = bus->now_us;
    iwl_socketcan_socket_forget(&bus->ours);
    iwl_socketcan_socket_forget(&bus->others);
    bus->kind->lost(bus, error);
}

/// While bus-off the kind checks again, because after a forged or lost error frame nothing else would end it.
void iwl_bus_note(iwl_bus_t *bus, iw_bus_state_t state) {
    bus->present = state;
    if (state < IW_BUS_PASSIVE) {
        bus->unhandled = state;
    }
    bus->poll_us = (state < IW_BUS_PASSIVE) ? bus->now_us + IWL_BUS_RETRY_US : IW_NEVER;
}

/// `forged`: a process of this machine sent it, which any user may do (fault 19). A forged bus-off still stops the
/// wheels. A forged end of bus-off is ignored, and the carrier shows the end.
static void handle_error(iwl_bus_t *bus, iwl_can_error_t error, bool forged) {
    if (error == IWL_CAN_ERROR_BUS_OFF) {
        bus->unhandled = IW_BUS_OFF;
        if (!forged) {
            bus->present = IW_BUS_OFF;
        }
        bus->poll_us = bus->now_us + (forged ? 0U : IWL_BUS_RETRY_US);
    } else if (forged) {
        return;
    } else if (error == IWL_CAN_ERROR_RESTARTED) {
        bus->unhandled = IW_BUS_OFF; // Also if the bus-off was not received: the restart has emptied the queue.
        bus->present = IW_BUS_ACTIVE;
    } else if (bus->present >= IW_BUS_PASSIVE && (error == IWL_CAN_ERROR_PASSIVE || error == IWL_CAN_ERROR_ACTIVE)) {
        bus->present = (error == IWL_CAN_ERROR_PASSIVE) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
    }
}

void iwl_bus_fill(iwl_bus_t *bus) {
    iwl_socketcan_socket_t *ours = &bus->ours;
    const uint32_t lost = ours->lost;
    uint32_t errors = 0;
    const int error = iwl_socketcan_socket_fill(ours);
    if (error != 0) {
        iwl_bus_lose(bus, error);
        return;
    }
    for (uint32_t i = 0; i < ours->count; i++) {
        const struct can_frame *raw = &ours->frame[i];
        if ((raw->can_id & CAN_ERR_FLAG) != 0U) {
            handle_error(bus, iwl_can_error_of(raw), (ours->flags[i] & MSG_DONTROUTE) != 0);
            errors++;
        } else {
            bus->load.bits += iwl_socketcan_bits(raw);
        }
    }
    if (errors == ours->count && errors > 0U && bus->errors_left > 0U) {
        bus->errors_left--;
    }
    if (ours->lost != lost) {
        bus->link.lost = ours->lost;
        bus->poll_us = bus->now_us; // The batch may contain an error frame.
    }
}

/// Success proves nothing, because `send` also succeeds while bus-off. Only the echo is proof (hal.h). Between a
/// bus-off and the call that reports it nothing is sent, because the core regards everything before that call as gone.
int iwl_bus_send(iwl_backend_store_t *store, const iw_can_frame_t *frames, uint32_t count) {
    iwl_bus_t *bus = bus_of(store);
    if (bus->up && bus->unhandled < IW_BUS_PASSIVE) {
        return 0;
    }
    const int result = bus->up ? iwl_socketcan_socket_send(&bus->ours, frames, count) : -1;
    if (result < 0 && bus->up) {
        iwl_bus_lose(bus, ENETDOWN);
    }
    if (bus->others_us > bus->now_us + OTHERS_AFTER_SEND_US) {
        bus->others_us = bus->now_us + OTHERS_AFTER_SEND_US;
    }
    return result;
}

/// Removes the next frame that is not an error frame from the batch. Returns false if there is none.
static bool receive_own(iwl_socketcan_socket_t *from, iw_can_frame_t *out_frame) {
    while (!iwl_socketcan_socket_is_empty(from)) {
        const uint32_t i = from->next++;
        if ((from->frame[i].can_id & CAN_ERR_FLAG) == 0U) {
            *out_frame = iwl_socketcan_translate(&from->frame[i], from->flags[i]);
            return true;
        }
    }
    return false;
}

/// `drained` ends the loop of the step without another system call. It counts once, so that the next step receives
/// again.
static bool receive_ours(iwl_bus_t *bus, iw_can_frame_t *out_frame) {
    while (!receive_own(&bus->ours, out_frame)) {
        if (!bus->up || bus->ours.drained || bus->errors_left == 0U) {
            bus->ours.drained = false;
            return false;
        }
        iwl_bus_fill(bus);
    }
    return true;
}

static bool receive_others(iwl_bus_t *bus, iw_can_frame_t *out_frame) {
    iwl_socketcan_socket_t *others = &bus->others;
    if (!bus->up || others->fd < 0 || bus->others_left == 0U) {
        return false;
    }
    if (iwl_socketcan_socket_is_empty(others) && !others->drained) {
        (void)iwl_socketcan_socket_fill(others); // An error of the interface appears at the other socket too.
    }
    if (!receive_own(others, out_frame)) {
        others->drained = false;
        bus->others_left = 0;
        return false;
    }
    bus->load.bits += iwl_socketcan_bits(&others->frame[others->next - 1U]);
    bus->others_left--;
    return true;
}

int iwl_bus_receive(iwl_backend_store_t *store, iw_can_frame_t *out_frame) {
    iwl_bus_t *bus = bus_of(store);
    if (receive_ours(bus, out_frame) || receive_others(bus, out_frame)) {
        return 1;
    }
    return bus->up ? 0 : -1;
}

iw_bus_state_t iwl_bus_state(iwl_backend_store_t *store) {
    iwl_bus_t *bus = bus_of(store);
    const iw_bus_state_t unhandled = bus->unhandled;
    const iw_bus_state_t now = bus->up ? bus->present : IW_BUS_DOWN;
    bus->unhandled = IW_BUS_ACTIVE;
    return (unhandled != IW_BUS_ACTIVE) ? unhandled : now;
}

void iwl_bus_load_begin(iwl_bus_load_t *self, iw_time_us_t now_us) {
    *self = (iwl_bus_load_t){.since_us = now_us};
}

bool iwl_bus_load_take(iwl_bus_load_t *self, iw_time_us_t now_us, uint32_t bitrate_hz, uint32_t *out_permille) {
    const iw_time_us_t span_us = now_us - self->since_us;
    if (span_us < US_PER_S) {
        return false;
    }
    const uint64_t rate_hz = (bitrate_hz != 0U) ? bitrate_hz : BITRATE_ASSUMED_HZ;
    *out_permille = (uint32_t)(self->bits * US_PER_S / rate_hz * 1000U / span_us);
    iwl_bus_load_begin(self, now_us);
    return true;
}
