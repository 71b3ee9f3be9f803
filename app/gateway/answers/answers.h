// SPDX-License-Identifier: MIT
/// Connects the northbound server to the daemon: its clients, the wheels, what is known of them, the recorder and the log. It defines
/// the functions of iwheel_server/target.h.
#ifndef GATEWAY_ANSWERS_H
#define GATEWAY_ANSWERS_H

#include "sockets/sock_clients.h"

#include "iwheel_linux/bus_link.h"
#include "iwheel_server/server.h"

struct gw_box;
struct gw_assumptions;
struct sock_log;
struct gw_wheels;

/// So many watch each frame as it comes. More than these get them together, this often: telling costs a system call for each of them.
#define GW_FRAMES_ONE_BY_ONE  8U
#define GW_FRAMES_TOGETHER_US 5000U

#define GW_STOPPER_SIZE     48U
#define GW_CLIENT_TEXT_SIZE 112U

/// What the server knows of a connection, and what the daemon adds. It belongs to the connection in the same slot.
typedef struct {
    iwn_client_t client;
    iwn_id_t arm_id;                  ///< Of the arm that waits for its answer.
    iwn_id_t read_id;                 ///< Of the question about recordings that waits for its answer.
    char key[IWN_LEASE_KEY_MAX + 1U]; ///< Of its lease, drawn at each arm that is granted; empty: there was none.
} gw_served_t;

/// Who asked for a stop, or an e-stop, last.
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
    char bus_cure[256];
    char stalled_cure[320];
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
    const char *socket; ///< By which one may drive, and its group, for messages.
    const char *group;
    gw_stopper_t stopped_by;
    gw_stopper_t estopped_by;
    iwl_link_purge_t purge;           ///< As told to the log.
    iw_time_us_t frames_us;           ///< Frames that are told together wait until then.
    char key[IWN_LEASE_KEY_MAX + 1U]; ///< Drawn for the arm that is being carried out.
    char text[GW_CLIENT_TEXT_SIZE];   ///< Of iwn_target_name.
    gw_refuse_texts_t texts;
    iwn_work_t work; ///< For reading requests.
    gw_served_t served[SOCK_CLIENTS_MAX];
} gw_answers_t;

/// Before anything else; wheels, knowledge, box, log, clients, socket, group and the first group of the server are set.
void gw_answers_begin(gw_answers_t *self);

/// What `clients` is to be served by: welcomes with `hello`, carries out each line whole or not at all, and answers it (the reply to
/// `arm` may come later). `self` must outlive it.
sock_handler_t gw_answers_handler(gw_answers_t *self);

/// Answers the arms that have been decided by the last step.
void gw_answers_arming(gw_answers_t *self, const iw_snapshot_t *seen);

/// Looks at the core and tells what is new, to the log and to watchers. After every step (`seen` is what has come of it).
void gw_answers_observe(gw_answers_t *self, const iw_snapshot_t *seen);

/// Sends the periodic events that are due.
void gw_answers_periodic(gw_answers_t *self);

/// When there is one; IW_NEVER if nobody watches.
iw_time_us_t gw_answers_next_us(gw_answers_t *self);

/// How many watch frames.
uint32_t gw_answers_watching_frames(gw_answers_t *self);

/// Sends the frames that the tape has tapped to the watchers of the topic `frame`, or leaves them there for a while.
void gw_answers_frames(gw_answers_t *self);

/// When it has something to do though no frame comes; IW_NEVER if none is left there.
iw_time_us_t gw_answers_frames_us(const gw_answers_t *self);

/// Passes on what has been read of recordings, if anything has. False: the process that reads has ended; who waited for it is told.
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

/// Sets the times and the e-stop of the server to what they are now.
void gw_answers_refresh(gw_answers_t *self);

/// What the daemon looks at beside the server: faults of health, the queue of the bus, what is known of the wheels.
void gw_answers_look_further(gw_answers_t *self, const iw_snapshot_t *seen);

/// "joystick" (client 3, pid 4711); one that is gone has no name.
void gw_answers_describe(gw_answers_t *self, iw_client_t id, char out_text[GW_CLIENT_TEXT_SIZE]);

/// A new key for a lease, of the kernel's random numbers. False: it has none yet, as in the first seconds of some machines.
bool gw_grant_draw_key(char out_key[IWN_LEASE_KEY_MAX + 1U]);

/// Takes the same time wherever they differ.
bool gw_grant_is_same_key(const char a[IWN_LEASE_KEY_MAX + 1U], const char b[IWN_LEASE_KEY_MAX + 1U]);

/// Recordings for clients: passed on to the process that reads them (disk/box_files.h), answered when it answers.
///
/// Nothing waits for it, not even later requests of the same client: a stop behind a slow disk is carried out at once. So a client has
/// one question at a time, and a cycle takes one answer.
///
/// Carries out `recordings` or `recording`: refuses it, or leaves its reply to gw_recordings_take.
void gw_recordings_ask(gw_answers_t *self, iwn_client_t *client);

#endif
