// SPDX-License-Identifier: MIT
/// What all kinds of bus have in common: a socket that carries `struct can_frame`, the frames taken from it, and the
/// state of the bus as its error frames tell it. Frames pass here (bus.c) whatever the kind; a kind brings its socket
/// and takes it away.
///
///     DOWN --by the kind's open and tend--> UP --by the kind, or an error of the socket: iwl_bus_lose--> DOWN
///
///     within UP, by error frames: ACTIVE <--> PASSIVE --bus-off--> BUS_OFF --restarted, or carrier back--> ACTIVE
///
/// `up` is false while DOWN, `present` holds the state within UP. Every way into DOWN or BUS_OFF, and a restart whose
/// bus-off was not heard, sets `unhandled`: `iwl_bus_state` reports that loss once, even if the bus is back already,
/// because the kernel's queue is empty then and no echo is owed any more (hal.h).
#ifndef IWL_BUS_H
#define IWL_BUS_H

#include "socketcan_socket.h"

#include "iwheel_linux/backend.h"

/// An interface that is gone or down, and a controller that is bus-off, are looked at at least this often.
#define IWL_BUS_RETRY_US 200000U

/// How much of its time the bus is taken, second by second.
typedef struct {
    iw_time_us_t since_us;
    uint64_t bits; ///< Of the frames since then.
} iwl_bus_load_t;

/// Begins a new second.
void iwl_bus_load_begin(iwl_bus_load_t *self, iw_time_us_t now_us);

/// The load in thousandths, once the second is over; then the next one begins. False before, output untouched. A bit
/// rate of 0 is not known: it is taken for that of the wheels.
bool iwl_bus_load_take(iwl_bus_load_t *self, iw_time_us_t now_us, uint32_t bitrate_hz, uint32_t *out_permille);

struct iwl_bus_kind;

/// The state of any kind begins with this.
typedef struct {
    const struct iwl_bus_kind *kind;
    iwl_bus_link_t link;
    iwl_socketcan_socket_t ours;   ///< The eleven ids: what the wheels depend on.
    iwl_socketcan_socket_t others; ///< Everything else, drained last. Not watched: any step will do. May stay closed.
    iw_time_us_t now_us;           ///< Of the last `poll`.
    iw_time_us_t look_us;          ///< When the kind has to look at it again; IW_NEVER: no need.
    iw_time_us_t others_us;        ///< When to look at `others` again.
    iwl_bus_load_t load;
    iw_bus_state_t present;   ///< While up.
    iw_bus_state_t unhandled; ///< A loss that is yet to be reported: IW_BUS_DOWN or IW_BUS_OFF; else IW_BUS_ACTIVE.
    uint32_t others_left;     ///< Until `others_us`.
    uint32_t errors_left;
    int watch_fd;
    bool up;    ///< Frames can pass.
    bool quiet; ///< The last wait has found nothing at `watch_fd`.
} iwl_bus_t;

/// A kind of bus: nothing of it is on a frame's way. The functions mean what those of backend.h do.
typedef struct iwl_bus_kind {
    /// All behind `self` is zero; closes again what it has opened if it fails.
    int (*open)(iwl_bus_t *self, const char *name);
    void (*close)(iwl_bus_t *self);
    void (*poll)(iwl_bus_t *self);
    int (*purge)(iwl_bus_t *self);
    void (*lost)(iwl_bus_t *self, int error); ///< The socket has failed for this reason; the bus is DOWN already.
} iwl_bus_kind_t;

extern const iwl_bus_kind_t iwl_local_bus_kind;
extern const iwl_bus_kind_t *const iwl_socketcan_kind; ///< NULL if this build has left it out.

/// Nothing is left of what was taken, and the loss is told. The kind's `lost` follows.
void iwl_bus_lose(iwl_bus_t *self, int error);

/// Notes a state, and if it is a loss, that it is one and that it ends unseen.
void iwl_bus_note(iwl_bus_t *self, iw_bus_state_t state);

/// Takes what has come, once all that was taken before has been used, and heeds its error frames at once: the state is
/// known before anything is sent.
void iwl_bus_fill(iwl_bus_t *self);

#endif
