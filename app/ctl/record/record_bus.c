// SPDX-License-Identifier: MIT
// Recording from the bus itself. The port's backend is opened as the gateway opens it, and only its receiving half is used.
#include "recorder.h"
#include "talk/signals.h"

#include "iwheel_linux/backend.h"

#include <errno.h>
#include <poll.h>
#include <string.h>

/// How long an interface may take to be seen as up.
#define UP_US   1000000
#define WAIT_MS 50

typedef struct {
    iw_backend_store_t bus;
    unsigned signals;
} source_t;

static int tell_unopened(const char *bus, int error) {
    if (error == ENOTSUP) {
        return ctl_fail(CTL_UNAVAILABLE,
                        "%s: libmnl was missing when this was built, so it reads the simulator's bus only (unix:PATH)",
                        bus);
    }
    if (error == EAFNOSUPPORT) {
        return ctl_fail(CTL_UNAVAILABLE, "%s: this kernel has no CAN sockets; modprobe can_raw, or: --can unix:PATH",
                        bus);
    }
    return ctl_fail(CTL_UNAVAILABLE, "%s: cannot be opened: %s", bus, strerror(error));
}

static int tell_down(const char *bus) {
    return (strncmp(bus, "unix:", 5) == 0)
               ? ctl_fail(CTL_UNAVAILABLE, "nobody answers on %s; is the simulator running? iwheel-sim --can %s", bus,
                          bus)
               : ctl_fail(
                     CTL_UNAVAILABLE,
                     "%s is not there or not up; sudo ip link set %s up type can bitrate 1000000 sample-point 0.625",
                     bus, bus);
}

/// Waits for something to read, a signal, or a while.
static void wait_a_while(source_t *source) {
    const struct timespec while_ = {.tv_sec = 0, .tv_nsec = WAIT_MS * 1000000L};
    struct pollfd entry = {.fd = iw_bus_fd(&source->bus), .events = POLLIN};
    (void)ppoll(&entry, 1, &while_, signals_let_in());
}

/// Everything that is there. False: it could not be written.
static bool drain(source_t *source, recorder_t *self) {
    iw_can_frame_t frame;
    const int64_t now_us = client_now_us();
    bool written = true;
    iw_bus_tend(&source->bus, (iw_time_us_t)now_us);
    while (written && iw_bus_receive(&source->bus, &frame) > 0) {
        candump_t out = candump_from_core(&frame, 0, "");
        out.mark = CANDUMP_RECEIVED;
        written = recorder_put(self, &out, now_us);
    }
    return recorder_tend(self) && written;
}

static bool comes_up(source_t *source) {
    const int64_t until_us = client_now_us() + UP_US;
    for (;;) {
        iw_bus_tend(&source->bus, (iw_time_us_t)client_now_us());
        if (iw_bus_state(&source->bus) >= IW_BUS_PASSIVE) {
            return true;
        }
        if (client_now_us() > until_us || signals_count() != source->signals) {
            return false;
        }
        wait_a_while(source);
    }
}

int recorder_from_bus(const char *bus, recorder_t *self) {
    static source_t source; // Too large for a stack.
    source.signals = signals_count();
    const int error = iw_bus_open(&source.bus, bus);
    if (error != 0) {
        return tell_unopened(bus, error);
    }
    int code = comes_up(&source) ? CTL_OK : tell_down(bus);
    bool up = true;
    while (code == CTL_OK && signals_count() == source.signals && client_now_us() < self->end_us) {
        wait_a_while(&source);
        if (!drain(&source, self)) {
            break;
        }
        const bool now_up = iw_bus_state(&source.bus) >= IW_BUS_PASSIVE;
        if (now_up != up) {
            (void)ctl_fail(CTL_OK, now_up ? "%s is up again" : "%s went down; waiting for it", bus);
        }
        up = now_up;
    }
    const iw_bus_link_t *link = iw_bus_link(&source.bus);
    self->lost += link->lost;
    iw_bus_close(&source.bus);
    return code;
}
