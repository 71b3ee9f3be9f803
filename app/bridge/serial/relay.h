// SPDX-License-Identifier: MIT
/// Between the clients' sockets and the board's line. The sockets are the gateway's own code (lib/sockets), so that whoever
/// connects finds what it finds there; behind them each client is a channel of the line.
///
/// What keeps an old command from becoming a new one:
///
/// - A command quotes the newest stamp that had been heard when its client sent it, as far as that can be told: it waited since
///   the last time that nothing of that client was waiting. The quote never changes after that.
/// - When the loop itself was away for longer than RELAY_GAP_US (stopped, starved, suspended), whatever could lead to a motion and
///   was waiting then is refused. Away for longer than RELAY_LEFT_US, every client is closed: the board has closed the channels.
/// - A command leaves only for a line that has room for it at once (serial_queue.h).
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

/// The loop comes round at least this often while there are clients, and says so to the board.
#define RELAY_ALIVE_US 50000U
#define RELAY_GAP_US   100000U
#define RELAY_LEFT_US  400000U
/// The question who the board is, which begins the link.
#define RELAY_ASK    "{\"cmd\":\"link\"}"
#define RELAY_ASK_US 300000U
/// An open that is not answered is said again, and given up.
#define RELAY_OPEN_US    200000U
#define RELAY_WELCOME_US 1500000U
/// Whose requests the board does not answer, so many in a row, is closed: the board may have closed the channel.
#define RELAY_UNANSWERED 3U
/// A port that takes nothing for so long is opened anew.
#define RELAY_STUCK_US 1000000U

/// A channel:
///
///     FREE --a client--> NEW --open is sent--> OPENING --hello--> WELCOMED: requests are sent
///       ^------------ client or board gone, no hello -----------------'
typedef enum { RELAY_FREE, RELAY_NEW, RELAY_OPENING, RELAY_WELCOMED } relay_channel_state_t;

/// A client on the line.
typedef struct {
    relay_channel_state_t state;
    iw_client_t client; ///< FREE: IW_CLIENT_NONE.
    bool watch;
    bool close_due;      ///< To be sent for the client before, in any state: the next one may be there already.
    bool granted;        ///< It has asked for a lease, in any state: commands may follow.
    uint64_t since_us;   ///< It came then.
    uint64_t opened_us;  ///< The last open was said then.
    uint64_t arm_number; ///< Of its last arm,
    uint64_t armed_us;   ///< which was answered then.
    uint64_t used_us;    ///< Last given to somebody: the longest unused is given next.
    serial_queue_t queue;
} relay_channel_t;

typedef struct {
    const serial_settings_t *settings;
    sock_log_t log;
    sock_clients_t clients;
    sock_wakeup_t wakeup;
    bridge_service_t service;
    serial_port_t port;
    serial_link_t link;
    relay_channel_t channel[IWN_LINE_CHANNELS + 1U]; ///< By number; 0 is nobody's.
    unsigned next_channel;                           ///< Whose turn it is to send.
    uint64_t number;                                 ///< Of the last request.
    uint64_t now_us;
    uint64_t planned_us; ///< The loop meant to be back by then.
    uint64_t gap_us;     ///< What was sent before this may have waited for us.
    uint64_t free_us;    ///< The line has taken all that was given to it by then.
    uint64_t said_us;    ///< A line was last sent.
    uint64_t asked_us;   ///< For the link.
    uint64_t retry_us;   ///< The port is opened again then.
    uint64_t backoff_us;
    serial_trouble_t judged; ///< What comes while no board answers.
    char trouble[512];       ///< Why there is no board, for clients that come.
    size_t out_length;
    size_t out_sent;
    char out[IWN_LINE_BOARD_MAX];
    iwn_work_t work;
    int signal_fd;
} relay_t;

/// Runs until SIGTERM or SIGINT. 0, or a sysexits code after a complaint.
int relay_run(relay_t *self, const serial_settings_t *settings);

// ---- channels.c: the clients' side --------------------------------------------------------------------------------

sock_handler_t relay_handler(relay_t *self);

/// Writes the request without its id, and with this one; its length, 0 if it does not fit.
size_t relay_write_numbered(iwn_json_t root, uint64_t number, char *out, size_t size);

/// The one line of a client beyond the maximum (guests.c): a stop goes by the channel of another client, all else is refused.
void relay_guest_carry_out(relay_t *self, sock_client_t *client, const char *line, size_t length);

/// Who gets the answer to a request: the channel's client, or the guest that asked by it. NULL: that one has gone.
sock_client_t *relay_guest_or(relay_t *self, sock_client_t *client, const serial_request_t *request);

/// A line of the board's for a client.
void relay_take_line(relay_t *self, const iwn_line_t *line);

/// The board is another, or has gone: every client is closed, and every channel closed when there is a board again.
void relay_drop_clients(relay_t *self);

/// What time does to requests; answers that we give ourselves; clients that have gone.
void relay_poll_channels(relay_t *self);
uint64_t relay_channels_next_us(const relay_t *self);

/// Writes the next line for the board into `out`; its length, 0 if there is none.
size_t relay_next_line(relay_t *self, char *out, size_t size);

#endif
