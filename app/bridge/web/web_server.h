// SPDX-License-Identifier: MIT
/// The whole bridge: HTTP on one side, the gateway on the other, in one thread that never waits for either.
///
/// Bounded: connections, bytes of a request, time until a request is complete, requests to the gateway, stored events.
/// A client with the token is served next to any number of others: these are closed if there are too many, the oldest
/// first.
#ifndef WEB_SERVER_H
#define WEB_SERVER_H

#include "backlog.h"
#include "driver.h"
#include "metrics.h"
#include "page_file.h"
#include "proof.h"
#include "token.h"
#include "web_link.h"
#include "web_settings.h"

#include <microhttpd.h>

/// A connection is closed if a request is not complete this time after the connection was made or last used.
#define WEB_HEADER_US 5000000U
/// Interval of signs of life on a stream without events.
#define WEB_PULSE_US 1000000U
#define WEB_FILES    24U

/// States: IDLE --complete request--> ASKING --answered--> IDLE; IDLE, ASKING --shut down--> LEAVING: the library frees
/// it in its next round.
typedef enum { WEB_PEER_IDLE, WEB_PEER_ASKING, WEB_PEER_LEAVING } web_peer_state_t;

/// A connection.
typedef struct web_peer {
    int fd;
    web_peer_state_t state;
    bool known; ///< A request has proved the token, or the secret for reading; valid for the whole connection.
    uint64_t since_us;
    struct web_peer *next;
} web_peer_t;

typedef struct web_server web_server_t;

///     NEW --judged--> JUDGED --carried out--> ANSWERING <--suspend, resume--> SUSPENDED
///
/// SUSPENDED: the library calls again only after the resume, which follows an answer of the gateway or an event.
typedef enum { WEB_CALL_NEW, WEB_CALL_JUDGED, WEB_CALL_ANSWERING, WEB_CALL_SUSPENDED } web_call_state_t;

/// A request.
typedef struct web_call {
    web_call_state_t state;
    web_server_t *server;
    struct MHD_Connection *connection;
    char target[WEB_TARGET_SIZE]; ///< As received; empty: too long.
    uint64_t session;             ///< Number of the session that proved the token; 0: none.
    web_verdict_t verdict;
    char *reply; ///< Answer, once it is known.
    size_t length;
    unsigned status;
    web_reader_t reader; ///< WEB_EVENTS
    uint64_t written_us; ///< Time of the last bytes of the stream.
    struct web_call *next;
} web_call_t;

struct web_server {
    const web_settings_t *settings;
    web_link_t link;
    web_token_t token;
    web_proofs_t proofs;
    char boot[BRIDGE_SECRET_SIZE]; ///< Id of this run, for ages.
    web_driver_t driver;
    uint64_t driver_session; ///< Session of the page that holds the lease.
    bridge_movers_t movers;
    web_own_t own;
    page_file_t files[WEB_FILES]; ///< Indexed like the routes.
    struct MHD_Daemon *daemon;
    web_backlog_t backlog;
    web_peer_t *peers; ///< Newest first.
    web_call_t *streams;
    unsigned stream_count;
    uint64_t crowded_out; ///< Connections that were closed for newer ones.
    char *certificate;
    char *key;
    uint64_t now_us;
    uint64_t poll_us; ///< Time of the next check of peers and token.
    bool ending;
};

/// Reads files and token, opens the socket. Returns 0, or an exit code of sysexits with a line on stderr.
int web_server_open(web_server_t *self, const web_settings_t *settings);

/// Reads the files that `open` reads, and opens nothing.
int web_server_check(web_server_t *self, const web_settings_t *settings);
void web_server_close(web_server_t *self);

/// Returns the last file of iwheel-fleet unchanged; NULL if it cannot be read. The caller frees it. The file is in
/// memory (/run), so the read waits for no disk; a link, a pipe or more than a megabyte is not read.
char *web_server_fleet(const web_server_t *self, size_t *out_length);

/// Does all work that is due. Returns 0, or an exit code.
int web_server_step(web_server_t *self);

/// Returns the time in milliseconds until `step` has work without input.
int web_server_wait_ms(const web_server_t *self);

/// Writes the descriptors of HTTP for poll(); -1: not now.
#define WEB_SERVER_FDS (2U + WEB_BACKLOG_LISTENERS)
void web_server_fds(const web_server_t *self, int out_fds[WEB_SERVER_FDS]);

/// Returns the largest number of event streams. The other connections are for requests and for clients without a proof
/// yet.
unsigned web_server_streams_max(const web_server_t *self);

/// Callbacks of libmicrohttpd for one request: LogCallback (its target as received), MHD_AccessHandlerCallback and
/// MHD_RequestCompletedCallback.
void *web_call_new(void *context, const char *target, struct MHD_Connection *connection);
enum MHD_Result web_call_handle(void *context, struct MHD_Connection *connection, const char *url, const char *method,
                                const char *version, const char *upload, size_t *upload_size, void **place);
void web_call_completed(void *context, struct MHD_Connection *connection, void **place,
                        enum MHD_RequestTerminationCode why);

/// The first function suspends a call, the second resumes a suspended one.
void web_call_suspend(web_call_t *self);
void web_call_resume(web_call_t *self);

#endif
