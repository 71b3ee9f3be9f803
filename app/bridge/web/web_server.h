// SPDX-License-Identifier: MIT
/// The bridge as a whole: HTTP on one side, the gateway on the other, in one thread that never waits for either.
///
/// Bounded: connections, bytes of a request, seconds until it is complete, questions to the gateway, events kept.
/// Who has the token is heard beside any number of others: these make room, the oldest first.
#ifndef WEB_SERVER_H
#define WEB_SERVER_H

#include "door.h"
#include "driver.h"
#include "metrics.h"
#include "page_file.h"
#include "proof.h"
#include "token.h"
#include "web_link.h"
#include "web_settings.h"

#include <microhttpd.h>

/// A request is complete this long after its connection was made or last used, or the connection is closed.
#define WEB_HEADER_US 5000000U
/// A stream on which nothing happens says so this often.
#define WEB_PULSE_US 1000000U
#define WEB_FILES    24U

/// IDLE --complete request--> ASKING --answered--> IDLE; IDLE, ASKING --shut down--> LEAVING: the library forgets it in its next round.
typedef enum { WEB_PEER_IDLE, WEB_PEER_ASKING, WEB_PEER_LEAVING } web_peer_state_t;

/// A connection.
typedef struct web_peer {
    int fd;
    web_peer_state_t state;
    bool known; ///< Has proved that it has the token, or the secret for reading: for all its requests.
    uint64_t since_us;
    struct web_peer *next;
} web_peer_t;

typedef struct web_server web_server_t;

///     NEW --judged--> JUDGED --carried out--> ANSWERING <--suspend, resume--> SUSPENDED
///
/// SUSPENDED: the library asks again only after the resume: an answer of the gateway or an event is awaited.
typedef enum { WEB_CALL_NEW, WEB_CALL_JUDGED, WEB_CALL_ANSWERING, WEB_CALL_SUSPENDED } web_call_state_t;

/// A request.
typedef struct web_call {
    web_call_state_t state;
    web_server_t *server;
    struct MHD_Connection *connection;
    char target[WEB_TARGET_SIZE]; ///< As it was sent; empty: longer.
    uint64_t session;             ///< Number of the session that proved the token; 0: none.
    web_verdict_t verdict;
    char *reply; ///< What it is answered, once it is known.
    size_t length;
    unsigned status;
    web_reader_t reader; ///< WEB_EVENTS
    uint64_t told_us;    ///< When the stream said something last.
    struct web_call *next;
} web_call_t;

struct web_server {
    const web_settings_t *settings;
    web_link_t link;
    web_token_t token;
    web_proofs_t proofs;
    char boot[BRIDGE_SECRET_SIZE]; ///< Of this run, for ages.
    web_driver_t driver;
    uint64_t driver_session; ///< Of the page that holds the lease.
    bridge_movers_t movers;
    web_own_t own;
    page_file_t files[WEB_FILES]; ///< By their place among the routes.
    struct MHD_Daemon *daemon;
    web_door_t door;
    web_peer_t *peers; ///< The newest first.
    web_call_t *streams;
    unsigned stream_count;
    uint64_t crowded_out; ///< Connections of strangers that made room for others.
    char *certificate;
    char *key;
    uint64_t now_us;
    uint64_t look_us; ///< When to look at peers and token next.
    bool ending;
};

/// Reads files and token, opens the socket. 0, or an exit code of sysexits with a line on stderr.
int web_server_open(web_server_t *self, const web_settings_t *settings);

/// Reads what `open` reads, and opens nothing.
int web_server_check(web_server_t *self, const web_settings_t *settings);
void web_server_close(web_server_t *self);

/// What iwheel-fleet wrote last, as it is, to be freed; NULL: it cannot be read. It lies in memory (/run), so nothing waits for a disk; a
/// link, a pipe or more than a megabyte is not read.
char *web_server_fleet(const web_server_t *self, size_t *out_length);

/// Whatever can be done now. 0, or an exit code.
int web_server_step(web_server_t *self);

/// Milliseconds until `step` has something to do, if neither descriptor has.
int web_server_wait_ms(const web_server_t *self);

/// The descriptors of HTTP, for poll(); -1: not now.
#define WEB_SERVER_FDS (2U + WEB_DOOR_LISTENERS)
void web_server_fds(const web_server_t *self, int out_fds[WEB_SERVER_FDS]);

/// How many may watch at once. The other connections are for who asks something, and for whom nobody knows yet.
unsigned web_server_streams_max(const web_server_t *self);

/// Answers one request: LogCallback (its target as it was sent), MHD_AccessHandlerCallback and MHD_RequestCompletedCallback of libmicrohttpd.
void *web_call_new(void *context, const char *target, struct MHD_Connection *connection);
enum MHD_Result web_call_handle(void *context, struct MHD_Connection *connection, const char *url, const char *method,
                                const char *version, const char *upload, size_t *upload_size, void **place);
void web_call_completed(void *context, struct MHD_Connection *connection, void **place,
                        enum MHD_RequestTerminationCode why);

/// Lets a call wait. Lets a suspended one go on.
void web_call_suspend(web_call_t *self);
void web_call_resume(web_call_t *self);

#endif
