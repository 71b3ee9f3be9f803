// SPDX-License-Identifier: MIT
/// What has changed since the last look, told to the log and to whoever watches; and what is due periodically.
///
/// Everything is told by its edge: a state that lasts is told once.
#ifndef GATEWAY_OBSERVE_H
#define GATEWAY_OBSERVE_H

#include "sockets/client.h"

#include "iwheel/snapshot.h"
#include "iwheel_linux/bus_link.h"
#include "iwheel_northbound/tell.h"

struct gw_box;
struct gw_clients;
struct gw_knowledge;
struct gw_log;
struct gw_wheels;

/// What was last told to the log and to watchers, so that only changes are told.
typedef struct {
    iw_state_t state;
    iw_bus_state_t bus;
    iw_link_purge_t purge;
    iw_client_t holder;
    uint32_t present; ///< Latching causes, as a bit each.
    uint32_t stop_number;
    uint32_t still_moving;
    bool left_behind;
    bool zeros_ending;
    bool holding;
    bool rolling;
    bool rolling_fault;      ///< As told, which is not every one.
    iw_time_us_t rolling_us; ///< When the last fault of that kind was told; 0: none yet.
    int estop;
    const char *pressed_at;  ///< Which contact, one of the four words; NULL: there is only one.
    bool started;            ///< The first observation only takes notes.
    iw_time_us_t started_us; ///< When that was.
    char holder_name[IWN_NAME_MAX + 1U];
    char holder_text[GW_CLIENT_TEXT_SIZE];
} gw_observed_t;

/// Who asked for a stop, or an e-stop, last. `at_us` 0: nobody yet.
typedef struct {
    iw_time_us_t at_us;
    int pid;
    uid_t uid;
} gw_stopper_t;

typedef struct gw_status {
    struct gw_wheels *wheels; ///< What it tells of; the box records stops.
    struct gw_knowledge *knowledge;
    struct gw_box *box;
    struct gw_log *log; ///< Whom it tells.
    struct gw_clients *clients;
    gw_observed_t observed;
    iwn_stop_note_t last_stop;
    gw_stopper_t stopped_by; ///< What the clients have asked for, until the stop that comes of it is told.
    gw_stopper_t estopped_by;
    iw_time_us_t frames_us;                 ///< Frames that are told together wait until then.
    char estop_reason[IWN_REASON_MAX + 1U]; ///< Of the last software e-stop.
} gw_status_t;

/// Before the first observation; what it tells of, and whom, is set already.
void gw_observe_begin(gw_status_t *self);

/// Looks at the core and tells what is new. After every step (`seen` is what has come of it), and before a client's slot is freed.
void gw_observe(gw_status_t *self, const iw_snapshot_t *seen);

/// Sends the periodic events that are due.
void gw_observe_periodic(gw_status_t *self);

/// When `gw_observe_periodic` has something to do; IW_NEVER if nobody watches.
iw_time_us_t gw_observe_next_us(const struct gw_clients *clients);

/// So many watch each frame as it comes. More than these get them together, this often: telling costs a system call for each of them.
#define GW_FRAMES_ONE_BY_ONE  8U
#define GW_FRAMES_TOGETHER_US 5000U

/// Sends the frames that the tape has tapped to the watchers of the topic `frame`, or leaves them there for a while.
void gw_observe_frames(gw_status_t *self);

/// When it has something to do though no frame comes; IW_NEVER if none is left there.
iw_time_us_t gw_observe_frames_us(const gw_status_t *self);

/// The event `hello`, to a new client.
void gw_observe_hello(gw_status_t *self, gw_client_t *client);

/// Name, version and so on, into an object that is open: event and reply of `hello`.
void gw_observe_write_hello(const struct gw_wheels *wheels, const gw_client_t *client, iwn_out_t *json);

/// What surrounds the core, for the library that writes it. It points into `status` and `seen`.
iwn_surroundings_t gw_snapshot_around(const gw_status_t *status, const iw_snapshot_t *seen);

/// Everything that is known, as fields of an object that is open: the body of `status` and of the event `state`.
void gw_snapshot_write(const gw_status_t *status, iwn_out_t *json);

/// The body of the event `force`.
void gw_snapshot_write_force(const gw_status_t *status, iwn_out_t *json);

#endif
