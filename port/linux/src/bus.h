// SPDX-License-Identifier: MIT
/// Common part of all kinds of bus: a socket that carries `struct can_frame`, the frames received from it, and the
/// state of the bus by its error frames. bus.c handles the frames of every kind; a kind opens and closes the socket.
///
///     DOWN --by the kind's open and poll--> UP --by the kind, or an error of the socket: iwl_bus_lose--> DOWN
///
///     within UP, by error frames: ACTIVE <--> PASSIVE --bus-off--> BUS_OFF --restarted, or carrier back--> ACTIVE
///
/// `up` is false while DOWN. `present` is the state within UP. Every transition to DOWN or BUS_OFF, and a restart whose
/// bus-off was not received, sets `unhandled`: `iwl_bus_state` reports that loss once, even if the bus is already back,
/// because the kernel's queue is then empty and no echo will arrive (hal.h).
///
/// No function waits or allocates, except `open` of a kind. All calls come from one thread (backend.h). Errors are
/// errno values.
#ifndef IWL_BUS_H
#define IWL_BUS_H

#include "socketcan_socket.h"

#include "iwheel_linux/backend.h"

/// Longest interval between checks of an interface that is absent or down, and of a controller that is bus-off.
#define IWL_BUS_RETRY_US 200000U

/// Bus load per second.
typedef struct {
    iw_time_us_t since_us;
    uint64_t bits; ///< Bits of the frames since the second began.
} iwl_bus_load_t;

/// Begins a new second.
void iwl_bus_load_begin(iwl_bus_load_t *self, iw_time_us_t now_us);

/// Returns true when the second is over, writes the load in permille, and begins the next second. Otherwise returns
/// false and leaves the output unchanged. With a bit rate of 0 (unknown) it assumes that of the wheels.
bool iwl_bus_load_take(iwl_bus_load_t *self, iw_time_us_t now_us, uint32_t bitrate_hz, uint32_t *out_permille);

struct iwl_bus_kind;

/// Common state of all kinds. The state of each kind begins with it.
typedef struct {
    const struct iwl_bus_kind *kind;
    iwl_bus_link_t link;           ///< State that `iwl_bus_link` returns.
    iwl_socketcan_socket_t ours;   ///< Frames with the eleven ids.
    iwl_socketcan_socket_t others; ///< All other frames, received last. Not watched. It may stay closed.
    iw_time_us_t now_us;           ///< Time of the last `poll`.
    iw_time_us_t poll_us;          ///< Next time at which the kind must check; IW_NEVER if it need not.
    iw_time_us_t others_us;        ///< Next time to receive from `others`.
    iwl_bus_load_t load;
    iw_bus_state_t present; ///< State while up.
    iw_bus_state_t
        unhandled; ///< Loss that `iwl_bus_state` must report: IW_BUS_DOWN or IW_BUS_OFF; otherwise IW_BUS_ACTIVE.
    uint32_t others_left; ///< Frames that may still be received from `others` until `others_us`.
    uint32_t errors_left; ///< Batches of error frames that may still be received in this step.
    int watch_fd;         ///< Descriptor for `iwl_bus_fd`; the kind opens and closes it.
    bool up;              ///< Frames can be sent and received.
    bool quiet;           ///< The last wait found `watch_fd` not readable.
} iwl_bus_t;

/// A kind of bus. Its functions are those of backend.h. Frames do not pass through them.
typedef struct iwl_bus_kind {
    /// All of `self` after this struct is zero. If it fails, it closes every descriptor that it has opened.
    int (*open)(iwl_bus_t *self, const char *name);
    void (*close)(iwl_bus_t *self);
    void (*poll)(iwl_bus_t *self);
    int (*purge)(iwl_bus_t *self);
    void (*lost)(iwl_bus_t *self,
                 int error); ///< Reports that the socket has failed with `error`. The bus is already DOWN.
} iwl_bus_kind_t;

extern const iwl_bus_kind_t iwl_local_bus_kind;
extern const iwl_bus_kind_t *const iwl_socketcan_kind; ///< NULL if this build has no SocketCAN.

/// Sets the bus DOWN after a failure of its socket: drops all received frames, reports the loss, and calls `lost` of
/// the kind with `error`.
void iwl_bus_lose(iwl_bus_t *self, int error);

/// Sets the state. If it is a loss, the loss is reported once even if it ends before.
void iwl_bus_note(iwl_bus_t *self, iw_bus_state_t state);

/// Receives from the kernel when all frames of the last batch are used. It handles error frames immediately, so that
/// the state is known before a frame is sent. An error of the socket ends in `iwl_bus_lose`.
void iwl_bus_fill(iwl_bus_t *self);

#endif
