// SPDX-License-Identifier: MIT
/// Connects the northbound server to the daemon: clients, wheels, assumptions, recorder and log. It defines the
/// functions of iwheel_server/target.h.
#ifndef GATEWAY_ANSWERS_H
#define GATEWAY_ANSWERS_H

#include "sockets/sock_clients.h"

#include "iwheel_linux/bus_link.h"
#include "iwheel_server/server.h"

struct gw_box;
struct gw_assumptions;
struct sock_log;
struct gw_wheels;

/// Watchers of frames that receive each frame immediately. More watchers receive them together at this interval,
/// because sending costs a system call per watcher.
#define GW_FRAMES_ONE_BY_ONE  8U
#define GW_FRAMES_TOGETHER_US 5000U

#define GW_STOPPER_SIZE     48U
#define GW_CLIENT_TEXT_SIZE 112U

/// Data of the server about a connection, with that of the daemon. It belongs to the connection in the same slot.
typedef struct {
    iwn_client_t client;
    iwn_id_t arm_id;                  ///< Id of the arm request that waits for its reply.
    iwn_id_t read_id;                 ///< Id of the request for recordings that waits for its reply.
    char key[IWN_LEASE_KEY_MAX + 1U]; ///< Key of its lease, drawn for each accepted arm; empty if there was none.
} gw_served_t;

/// Client that last requested a stop, or an e-stop.
typedef struct {
    int pid;
    uid_t uid;
} gw_stopper_t;

/// Texts of one refusal.
typedef struct {
    char holder[GW_CLIENT_TEXT_SIZE];
    char stale_client[GW_CLIENT_TEXT_SIZE];
    char stopped_by[GW_STOPPER_SIZE];
    char estopped_by[GW_STOPPER_SIZE];
    char bus_fix[256];
    char stalled_fix[320];
    char timing[320];
    char contradiction[IWN_SENTENCE_SIZE];
} gw_refuse_texts_t;

typedef struct gw_answers {
    iwn_server_t server; ///< Must be the first member.
    struct gw_wheels *wheels;
    struct gw_assumptions *assumptions;
    struct gw_box *box;
    struct sock_log *log;
    sock_clients_t *clients;
    const char *socket; ///< Socket for driving and its group, for messages.
    const char *group;
    gw_stopper_t stopped_by;
    gw_stopper_t estopped_by;
    iwl_link_purge_t purge;           ///< Last value in the log.
    iw_time_us_t frames_us;           ///< Time at which the collected frames are sent.
    char key[IWN_LEASE_KEY_MAX + 1U]; ///< Key drawn for the arm request that is being executed.
    char text[GW_CLIENT_TEXT_SIZE];   ///< Buffer of iwn_target_name.
    gw_refuse_texts_t texts;
    iwn_work_t work; ///< Work area for reading requests.
    gw_served_t served[SOCK_CLIENTS_MAX];
} gw_answers_t;

/// Initializes the server. The caller sets wheels, assumptions, box, log, clients, socket, group and the first group of
/// the server before.
void gw_answers_begin(gw_answers_t *self);

/// Returns the functions that serve `clients`: they send `hello`, execute each line as a whole or not at all, and
/// answer it (the reply to `arm` may come later). `self` must exist as long as they are used.
sock_handler_t gw_answers_handler(gw_answers_t *self);

/// Answers the arm requests that the last step has decided.
void gw_answers_arming(gw_answers_t *self, const iw_snapshot_t *seen);

/// Reports changes of the core to the log and to watchers. Call it after every step with its snapshot.
void gw_answers_observe(gw_answers_t *self, const iw_snapshot_t *seen);

/// Sends the periodic events that are due.
void gw_answers_periodic(gw_answers_t *self);

/// Returns the time of the next periodic event; IW_NEVER without watchers.
iw_time_us_t gw_answers_next_us(gw_answers_t *self);

/// Returns the number of watchers of frames.
uint32_t gw_answers_watching_frames(gw_answers_t *self);

/// Sends the frames from the tape to the watchers of the topic `frame`, or leaves them there until their time.
void gw_answers_frames(gw_answers_t *self);

/// Returns the time at which frames must be sent without a new frame; IW_NEVER if none wait.
iw_time_us_t gw_answers_frames_us(const gw_answers_t *self);

/// Passes on the replies of the process that reads recordings. Returns false if that process has ended; its clients are
/// informed.
bool gw_recordings_take(gw_answers_t *self);

// For the files of this folder.

static inline gw_answers_t *gw_answers_of(iwn_server_t *server) {
    return (gw_answers_t *)server;
}

static inline sock_client_t *gw_answers_connection(const gw_answers_t *self, const iwn_client_t *client) {
    return &self->clients->client[(const gw_served_t *)client - self->served];
}

static inline gw_served_t *gw_answers_served(gw_answers_t *self, const sock_client_t *connection) {
    return &self->served[connection - self->clients->client];
}

/// Sets the times and the e-stop of the server to the present ones.
void gw_answers_refresh(gw_answers_t *self);

/// Checks the daemon's own causes of events: faults of health, the queue of the bus, changes of assumptions.
void gw_answers_check_watchers(gw_answers_t *self, const iw_snapshot_t *seen);

/// Writes "joystick" (client 3, pid 4711); a client that is gone has no name.
void gw_answers_describe(gw_answers_t *self, iw_client_t id, char out_text[GW_CLIENT_TEXT_SIZE]);

/// Draws a new lease key from the kernel's random numbers. Returns false while the kernel has none, as in the first
/// seconds of some machines.
bool gw_grant_draw_key(char out_key[IWN_LEASE_KEY_MAX + 1U]);

/// Compares two keys in constant time.
bool gw_grant_is_same_key(const char a[IWN_LEASE_KEY_MAX + 1U], const char b[IWN_LEASE_KEY_MAX + 1U]);

/// Recordings for clients: a separate process reads them (disk/box_files.h), and its answer becomes the reply.
///
/// No other request waits for it, not even later ones of the same client: a stop after a question to a slow disk is
/// executed immediately. A client therefore has one question at a time, and a cycle receives one answer.
///
/// Executes `recordings` or `recording`: refuses it, or leaves the reply to gw_recordings_take.
void gw_recordings_ask(gw_answers_t *self, iwn_client_t *client);

/// Executes `record`: begins or ends the recording on request. The reply does not wait for the disk.
void gw_recordings_record(gw_answers_t *self, iwn_client_t *client);

#endif
