// SPDX-License-Identifier: MIT
/// Listening socket for clients that drive, or for watchers: safe creation, accepting without a busy loop, and removal.
///
/// The owner of its folder must be a user who may run a gateway (owners.h), and no other user may write to the folder;
/// a folder like /tmp is used with a warning. The folder is opened once, and the socket is created, changed and removed
/// by its name in that folder, never by a path that another user could redirect. An existing name is replaced only if
/// it is a socket that does not answer, or that another user owns. Accepting needs a descriptor. One is reserved, so
/// that without free descriptors a connection can still be accepted, reported and closed, instead of waking the loop
/// again and again.
#ifndef GATEWAY_LISTENER_H
#define GATEWAY_LISTENER_H

#include "owners.h"

#include "iwheel/types.h"

#include <stdio.h>
#include <sys/types.h>

struct sock_log;

/// After an accept that failed for lack of resources, the next attempt waits for this time.
#define SOCK_LISTENER_PAUSE_US 200000U

/// Rights of a socket and of its clients.
typedef enum {
    SOCK_DRIVE = 0, ///< All requests.
    SOCK_WATCH,     ///< Read, stop and e-stop.
    SOCK_RIGHTS,    ///< Number of sockets, one for each right above.
    SOCK_STOP =
        SOCK_RIGHTS, ///< Stop or e-stop, once: for a client that arrives when all places of its socket are in use.
    SOCK_PARTS,
} sock_right_t;

typedef enum {
    SOCK_ACCEPT_NONE = 0, ///< No connection waits.
    SOCK_ACCEPT_ONE,      ///< `*out_fd` is the connection.
    SOCK_ACCEPT_CROWDED,  ///< `*out_fd` is one too many: report and close it. The next call restores the reserve.
    SOCK_ACCEPT_PAUSE,    ///< Out of resources: call again after SOCK_LISTENER_PAUSE_US.
} sock_accept_t;

/// Configuration of a socket. The texts must exist as long as the listener.
typedef struct {
    const char *program; ///< Name of the program for messages.
    sock_right_t right;
    const char *path;  ///< Path; "none": no socket.
    const char *group; ///< Group of the socket; "none": the group of the gateway.
    mode_t mode;
} sock_listener_config_t;

typedef struct {
    sock_listener_config_t config;
    char name[SOCK_PATH_SIZE]; ///< Name in the folder.
    sock_owners_t owners;
    sock_folder_t folder;
    dev_t device; ///< Device and inode of the created socket, so that only this socket is removed.
    ino_t inode;
    iw_time_us_t from_us; ///< Earliest time of the next accept.
    bool full_reported;   ///< A rejection was logged, until the next client is accepted.
    int fd;               ///< Descriptor; -1 if not open.
    int reserve_fd;
} sock_listener_t;

/// Creates the socket's folder if only that is missing, opens it and checks it. Returns 0, or a sysexits code after it
/// has printed cause and fix to `err`.
int sock_listener_prepare(sock_listener_t *self, const sock_listener_config_t *config, FILE *err);

/// Checks after sock_listener_prepare whether sock_listener_open would refuse the file with the socket's name. It
/// changes nothing, and does not check whether another program answers there. Returns 0, or a sysexits code after it
/// has printed cause and fix to `err`.
int sock_listener_judge(const sock_listener_t *self, FILE *err);

/// Creates the socket after sock_listener_prepare. Returns 0, or a sysexits code after it has printed cause and fix to
/// `err`. If the group does not exist or must not be set, it logs a warning, and the socket is stricter than
/// configured.
int sock_listener_open(sock_listener_t *self, struct sock_log *log, FILE *err);

/// Closes the socket, removes its file if it is the created one, and closes the folder.
void sock_listener_close(sock_listener_t *self);

/// Accepts one waiting connection. Never blocks.
sock_accept_t sock_listener_accept(sock_listener_t *self, int *out_fd);

#endif
