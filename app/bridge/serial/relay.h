// SPDX-License-Identifier: MIT
/// Relay between the sockets of clients and the line of a board. The sockets use the code of the gateway (lib/sockets),
/// so that a client finds the same behaviour. Each client is a channel of the line.
///
/// An old command never becomes a new one, by these rules:
///
/// - A command quotes the newest stamp at the time when its client sent it, as far as known: at the latest since the
///   last time at which nothing of that client was waiting. The quote never changes later.
/// - If the loop was delayed for longer than RELAY_GAP_US (stopped, starved, suspended), waiting requests that could
///   lead to motion are refused. After RELAY_LEFT_US every client is closed, because the board has closed the channels.
/// - A command is sent only if the line has space for it immediately (serial_queue.h).
/// - Each stop refuses the requests of all clients that were sent before it and could lead to motion. The board does the
///   same at a stop that does not come from the relay (SERIAL_DATED_US).
///
/// A stop is never refused, waits for no other request, and is not lost when its client disconnects: it has a place of
/// its own until the board answers, and uses any channel that the board serves. After SIGTERM the relay ends its clients,
/// and continues until the stops are answered and the channels closed, for at most RELAY_END_US.
///
///     port: CLOSED --opens--> ASKING (link, every RELAY_ASK_US) --event link--> LINKED: clients are served
///                ^------------- goes, or cannot be written to -----'
#ifndef SERIAL_RELAY_H
#define SERIAL_RELAY_H

#include "serial_link.h"
#include "serial_port.h"
#include "serial_queue.h"
#include "serial_settings.h"
#include "serial_trouble.h"

#include "common/bridge_service.h"
#include "sockets/log.h"
#include "sockets/sock_clients.h"
#include "sockets/wakeup.h"

/// While there are clients, the loop runs at least at this interval and reports it to the board.
#define RELAY_ALIVE_US 50000U
#define RELAY_GAP_US   100000U
#define RELAY_LEFT_US  400000U
/// After a signal the relay sends stops and closes, and waits for the answers to the stops, for at most this time.
#define RELAY_END_US 300000U
/// Request for the identity of the board, which begins the link.
#define RELAY_ASK    "{\"cmd\":\"link\"}"
#define RELAY_ASK_US 300000U
/// An open without an answer is sent again after this time, and dropped later.
#define RELAY_OPEN_US    200000U
#define RELAY_WELCOME_US 1500000U
/// A client is closed after this number of requests in a row without an answer, because the board may have closed its
/// channel.
#define RELAY_UNANSWERED 3U
/// A port that accepts nothing for this time is opened again.
#define RELAY_STUCK_US 1000000U
/// Number of stop requests in progress. If all of them wait, the next one is equal to one of them.
#define RELAY_STOPS 32U
/// Interval at which a stop without an answer is sent again, with the same number.
#define SERIAL_AGAIN_US 150000U
/// If a stop has no answer for this time, the board may have closed the channels.
#define RELAY_DOUBT_US 300000U
#define RELAY_NOT_SENT                                                                                                 \
    "no board answers on the serial line: this stop was not delivered, or its reply was lost; press the e-stop"

/// States of a channel:
///
///     FREE --a client--> NEW --open is sent--> OPENING --hello--> WELCOMED: requests are sent
///       ^------------ client or board gone, no hello -----------------'
///
/// If a stop waits and the board serves no channel, or does not answer, one is opened without a client.
typedef enum { RELAY_FREE, RELAY_NEW, RELAY_OPENING, RELAY_WELCOMED } relay_channel_state_t;

/// A client on the line.
typedef struct {
    relay_channel_state_t state;
    iw_client_t client; ///< IW_CLIENT_NONE in FREE, and if it is open for stops only.
    bool watch;         ///< It is connected to the watch socket, in any state: its requests may only watch.
    bool close_due; ///< A close must be sent for the client before, in any state: the next client may already be there.
    bool granted;   ///< It has requested a lease, in any state: commands may follow.
    bool served;    ///< The board serves it, in any state: a hello has come, and neither close nor open was sent since.
    unsigned ahead; ///< Number of stops that were sent ahead: the first ones among the client's unread lines.
    uint64_t since_us;   ///< Time of its connection.
    uint64_t opened_us;  ///< Time of the last open.
    uint64_t arm_number; ///< Number of its last arm, ...
    uint64_t armed_us;   ///< ... and the time of its answer.
    uint64_t used_us;    ///< Last use: the channel that was unused for longest is used next.
    serial_queue_t queue;
} relay_channel_t;

/// A reply of the board. `rest` is the part after `ok`.
typedef struct {
    uint64_t number;
    bool ok;
    const char *rest;
    size_t length;
} relay_reply_t;

/// A stop request on its way to the board. WAITING: it was not sent. HELD: it is ahead and answered.
typedef struct {
    iw_client_t sender;       ///< Its client, which may be gone.
    uint8_t channel;          ///< Channel of the sender when it came; 0: none.
    bool latches;             ///< It is an estop.
    bool ahead;               ///< Its line is still among the unread ones of its client, whose turn has not come.
    serial_request_t request; ///< Number 0: the place is free.
} relay_stop_t;

typedef struct {
    const serial_settings_t *settings;
    sock_log_t log;
    sock_clients_t clients;
    sock_wakeup_t wakeup;
    bridge_service_t service;
    serial_port_t port;
    serial_link_t link;
    relay_channel_t channel[IWN_LINE_CHANNELS + 1U]; ///< Indexed by channel; 0 belongs to no client.
    relay_stop_t stop[RELAY_STOPS];
    unsigned next_channel; ///< Channel that sends next.
    uint64_t number;       ///< Number of the last request.
    uint64_t now_us;
    uint64_t planned_us; ///< Planned end of the last wait.
    uint64_t gap_us;     ///< Requests sent before this time may have waited for the relay.
    uint64_t free_us;    ///< Time at which the line has sent all bytes.
    uint64_t written_us; ///< Time of the last line.
    uint64_t asked_us;   ///< Time of the last request for the link.
    uint64_t retry_us;   ///< Time of the next attempt to open the port.
    uint64_t backoff_us;
    uint64_t ends_us;        ///< After the signal: latest time of the end. UINT64_MAX before.
    serial_trouble_t judged; ///< Bytes received while no board answers.
    char trouble[512];       ///< Reason why there is no board, for clients that connect.
    size_t out_length;
    size_t out_sent;
    char out[IWN_LINE_BOARD_MAX];
    iwn_work_t work;
    int signal_fd;
} relay_t;

/// Runs until SIGTERM or SIGINT. Returns 0, or a sysexits code after a message.
int relay_run(relay_t *self, const serial_settings_t *settings);

// ---- channels.c: the clients' side --------------------------------------------------------------------------------

sock_handler_t relay_handler(relay_t *self);

/// Returns the channel of this client; NULL if it has none.
relay_channel_t *relay_channel_of(relay_t *self, const sock_client_t *client);

void relay_refuse(relay_t *self, sock_client_t *client, const iwn_id_t *id, iwn_error_t error, const char *reason);

/// Passes a reply: `rest` is the part after `ok` in the board's reply, and the client receives it with its own id. If
/// the board executed a stop whose line is refused, the client receives the refusal.
void relay_pass_reply(relay_t *self, sock_client_t *client, const serial_request_t *request, const char *rest,
                      size_t length);

/// Handles a line of the board for a client.
void relay_take_line(relay_t *self, const iwn_line_t *line);

/// Ends every client at the end of the relay. The board still serves their channels: stops are sent before the closes.
void relay_end_clients(relay_t *self);

/// Handles another board, or a lost one: closes every client, and every channel when there is a board again.
void relay_drop_clients(relay_t *self);

/// Handles the time limits of requests, local replies, and clients that have gone.
void relay_poll_channels(relay_t *self);
uint64_t relay_channels_next_us(const relay_t *self);

/// Writes the next line for the board to `out`. Returns its length; 0 if there is none.
size_t relay_next_line(relay_t *self, char *out, size_t size);

/// Returns true if stops are answered, closes are sent and no channel is in use, or the time for that has expired, or no
/// board answers.
bool relay_has_ended(const relay_t *self);

// ---- stops.c: stop requests ---------------------------------------------------------------------------------------

/// Writes the request with this id instead of its own. Returns the length; 0 if it does not fit.
size_t relay_write_numbered(iwn_json_t root, uint64_t number, char *out, size_t size);

/// Sends a stop, which may have been sent ahead, and queues its reply.
void relay_stop_forward(relay_t *self, relay_channel_t *channel, sock_client_t *client, const iwn_request_t *asked);

/// Executes a stop of a client that has no queue, because it is beyond the maximum or is being closed. A client that is
/// being closed receives the refusal of its line here.
void relay_stop_last(relay_t *self, sock_client_t *client, const iwn_request_t *asked);

/// Sends the stops among the lines whose turn has not come. Their replies stay in order.
void relay_stops_read_ahead(relay_t *self, relay_channel_t *channel, sock_client_t *client);

/// Records the board's answer to a stop, if it is one, and replies to a client without a channel. `passed`: its client
/// has the reply, from its queue.
void relay_stop_take(relay_t *self, const relay_reply_t *reply, bool passed);

/// Handles a lost board: the clients are informed that their stops were not delivered.
void relay_stops_refuse(relay_t *self);

/// Handles the time limits of stops, and those whose clients have gone.
void relay_stops_age(relay_t *self);
uint64_t relay_stops_next_us(const relay_t *self);
/// Returns true if a stop that came until then has no answer yet.
bool relay_stops_wait(const relay_t *self, uint64_t since_us);

/// Logs the number of stops without an answer, if there are any.
void relay_stops_report(relay_t *self);

/// Writes the stop that is sent now. Returns its length; 0 if there is none, or the board serves no channel yet.
size_t relay_next_stop(relay_t *self, char *out, size_t size);

#endif
