// SPDX-License-Identifier: MIT
/// A northbound socket, the one to drive by or the one to watch by: made safely, accepted from without ever spinning, removed at the end.
///
/// Its folder must belong to somebody who may run a gateway (owners.h), and nobody else may write there; one like
/// /tmp is used with a warning. It is opened once, and the socket is made, changed and removed in it by name, never by a
/// path that somebody could turn elsewhere meanwhile. A name that is taken is replaced only if it is a socket on which
/// nobody answers, or a stranger's. Accepting needs a descriptor: one
/// is kept in reserve, so that with none left a newcomer can still be taken, told and closed instead of waking the
/// loop for ever.
#ifndef GATEWAY_LISTENER_H
#define GATEWAY_LISTENER_H

#include "owners.h"

#include "iwheel/types.h"

#include <stdio.h>
#include <sys/types.h>

struct sock_log;

/// After an accept that failed for want of anything, the socket is left alone this long.
#define SOCK_LISTENER_PAUSE_US 200000U

/// What a socket, and so who connects to it, may do.
typedef enum {
    SOCK_DRIVE = 0,          ///< Everything.
    SOCK_WATCH,              ///< Look, stop and e-stop.
    SOCK_RIGHTS,             ///< Sockets: one for each right before.
    SOCK_STOP = SOCK_RIGHTS, ///< Stop or e-stop, once: who comes when all places of its socket are taken.
    SOCK_PARTS,
} sock_right_t;

typedef enum {
    SOCK_ACCEPT_NONE = 0, ///< Nobody waits.
    SOCK_ACCEPT_ONE,      ///< `*out_fd` is the connection.
    SOCK_ACCEPT_CROWDED,  ///< `*out_fd` is one too many: report it, close it. The next call makes room again.
    SOCK_ACCEPT_PAUSE,    ///< Out of resources: call again after SOCK_LISTENER_PAUSE_US.
} sock_accept_t;

/// What a socket is to be, by the configuration. The texts must outlive the listener.
typedef struct {
    const char *program; ///< Whose it is, for complaints.
    sock_right_t right;
    const char *path;  ///< "none": there is none.
    const char *group; ///< Owner group; "none": the gateway's own.
    mode_t mode;
} sock_listener_config_t;

typedef struct {
    sock_listener_config_t config;
    char name[SOCK_PATH_SIZE]; ///< In the folder.
    sock_owners_t owners;
    sock_folder_t folder;
    dev_t device; ///< Of the socket as we made it, so that nobody else's is removed.
    ino_t inode;
    iw_time_us_t from_us; ///< Nobody is accepted before.
    bool full_told;       ///< That somebody was turned away, until the next is let in.
    int fd;               ///< -1: not open.
    int reserve_fd;
} sock_listener_t;

/// Makes the socket's folder if only that is missing, opens and judges it. 0, or a sysexits code after cause and cure have been
/// printed on `err`.
int sock_listener_prepare(sock_listener_t *self, const sock_listener_config_t *config, FILE *err);

/// After sock_listener_prepare: whether sock_listener_open would refuse what has the socket's name. Changes nothing, and does not ask
/// whether another program answers there. 0, or a sysexits code after cause and cure have been printed on `err`.
int sock_listener_judge(const sock_listener_t *self, FILE *err);

/// After sock_listener_prepare. 0, or a sysexits code after cause and cure have been printed on `err`. A group that does
/// not exist or may not be given is a warning in the log: the socket is then stricter than asked for.
int sock_listener_open(sock_listener_t *self, struct sock_log *log, FILE *err);

/// Closes the socket and removes its file, if it is still ours; closes the folder.
void sock_listener_close(sock_listener_t *self);

/// Takes one waiting connection. Never blocks.
sock_accept_t sock_listener_accept(sock_listener_t *self, int *out_fd);

#endif
