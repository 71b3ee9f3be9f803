// SPDX-License-Identifier: MIT
/// The host on the other end of the serial line: several clients on numbered channels (docs/user/serial.md), each with
/// its own requests, replies and events of the northbound protocol, and one lease among them.
///
///     CLOSED --open--> OPEN --close | link | relay silent--> CLOSED
///
/// Nothing of a line is believed before its CRC is right, and no command that moves unless it quotes this start of the
/// board, a number that its channel has not had yet, and a stamp that is younger than the lease and than the channel: a
/// line that was held up, doubled or kept from before feeds nothing. The lease runs from that stamp, not from when the
/// line came.
///
/// Out: replies before events; what does not fit is dropped and counted. A snapshot is too long for the ring of small
/// lines and is lent to the DMA from a buffer of its own, one at a time: who asks for it meanwhile is owed it.
///
/// No heap; one instance, all zero before `brd_host_init`; everything from the main loop.
#ifndef BRD_HOST_H
#define BRD_HOST_H

#include "board_assumptions.h"
#include "pending.h"

#include "iwheel/gateway.h"
#include "iwheel_northbound/line.h"
#include "iwheel_server/server.h"

/// The longest line to the host, with its newline: told by the event link.
#define BRD_HOST_LINE_BYTES 4480U
/// The longest line but a snapshot's.
#define BRD_HOST_SMALL_BYTES 1664U
/// What events leave free of the line, for replies.
#define BRD_HOST_REPLY_ROOM 768U
/// The event `link` comes this often, and with an armed client whenever nothing else has been stamped for so long:
/// a command cannot quote a younger stamp than it has heard.
#define BRD_HOST_LINK_US       1000000U
#define BRD_HOST_LINK_ARMED_US 25000U
/// At most one line_error in this time.
#define BRD_HOST_ERROR_US 200000U
/// The answer to a commit has left by then, or nobody takes it.
#define BRD_HOST_RESTART_US 500000U

/// A client of the relay's.
typedef struct {
    iwn_client_t served; ///< Must be the first member; its id is IW_CLIENT_NONE while the channel is closed.
    bool owed_status;    ///< It asked for a snapshot, and
    bool owed_state;     ///< its subscription is due one; the line was taken.
    bool has_seq;        ///< `seq` is one.
    uint32_t lost;       ///< Lines dropped and not told yet.
    uint64_t seq;        ///< Of its newest command.
    iw_time_us_t opened_us;
} brd_host_client_t;

/// Whether what is learnt of the wheels is kept, as the daemon tells it.
typedef enum {
    BRD_RECORDS_NEW = 0, ///< Nothing has been, yet.
    BRD_RECORDS_STORED,
    BRD_RECORDS_FAILED,
} brd_records_state_t;

/// What watchers were told last of what is learnt of the wheels.
typedef struct {
    iw_time_us_t offset_us[IW_SIDES]; ///< Of the zero in force, and the two after it.
    int32_t offset_mN[IW_SIDES];
    uint8_t provenance[IW_SIDES]; ///< iw_offset_provenance_t.
    uint32_t assumed_changes;
    uint8_t assumed[IW_ASSUMPTION_ITEMS]; ///< iw_assumption_state_t.
} brd_host_reported_t;

/// Where the image runs.
typedef struct {
    iw_gateway_t *gateway;
    const char *version;
    const char *bus;     ///< Name of the bus, for messages.
    const char *estop;   ///< Name of the e-stop's pin.
    uint32_t bitrate_hz; ///< Of the bus.
    uint32_t sample_point_permille;
    brd_settings_t settings; ///< In force.
    uint32_t rate_max_hz;    ///< Of snapshots that the serial line carries beside replies.
    uint64_t boot;           ///< Another one at every start.
} brd_host_place_t;

/// Small members first, as in the server.
typedef struct {
    const iwn_quote_t *quote; ///< Of the request that is being carried out; NULL: it has none.
    uint64_t boot;            ///< Of this start.
    iw_time_us_t received_us; ///< When the last good line came.
    iw_time_us_t linked_us;   ///< When the last `link` was written.
    iw_time_us_t stamped_us;  ///< When any line was.
    iw_time_us_t error_us;    ///< When the last line_error was written.
    iw_time_us_t learn_us;    ///< Nothing that was learnt is written before.
    iw_time_us_t restart_us;  ///< A commit was answered: begin anew then, or when the answer is on the wire; 0: not.
    uint32_t errors;          ///< Bad lines since the start.
    uint32_t errors_told;     ///< Of them, those that a line_error has counted.
    uint32_t bitrate_hz;      ///< Of the bus.
    uint32_t sample_point_permille;
    iw_client_t last_id;
    uint32_t lease_us;
    iwn_line_verdict_t fault; ///< Of the last bad line.
    uint8_t next_owed;        ///< Whose turn it is to have the long line, so that nobody keeps it.
    bool has_staged;          ///< `staged` is something.
    brd_records_state_t memory;
    brd_assumptions_zero_t zero[IW_SIDES]; ///< Where the zeros in force come from.
    brd_host_reported_t told;
    iwn_server_t server;
    brd_settings_t settings; ///< In force.
    brd_settings_t staged;   ///< By `config`; in force after a commit and the start that follows it.
    brd_host_client_t client[IWN_LINE_CHANNELS]; ///< Channel 1 is the first.
    iwn_receiver_t receiver;
    brd_pending_t pending; ///< Answers of clients that wait.
    char in[IWN_LINE_BOARD_MAX];
    union {
        iwn_work_t work;                   ///< While a request is read, ...
        char texts[4][IWN_NAME_MAX + 32U]; ///< then names for a sentence, ...
        char small[BRD_HOST_SMALL_BYTES];  ///< and at last the line with the reply or event.
    } scratch;
    char big[BRD_HOST_LINE_BYTES]; ///< Lent to the serial line.
} brd_host_t;

/// Nobody is there yet.
void brd_host_init(brd_host_t *self, const brd_host_place_t *place, iw_time_us_t now_us);

/// Call it right before a step of the gateway. It ends what must end, and carries out one line: a request can take
/// milliseconds, and the loop must read the e-stop between two of them. Returns true if more lines may wait: call it
/// again immediately, after the step.
bool brd_host_take(brd_host_t *self, iw_time_us_t now_us);

/// Right after the step: answers the arms that it decided, tells what changed, and what is due. Returns when to come
/// again at the latest.
iw_time_us_t brd_host_tell(brd_host_t *self, const iw_snapshot_t *seen, bool estop_high);

// For the files of this part.

/// How many lines it has missed, if there is room to say so.
void brd_host_tell_lost(brd_host_t *self, brd_host_client_t *client);
/// Who speaks here, on the link, whatever client there is.
void brd_host_tell_link(brd_host_t *self);
/// Bad lines since the last time, if that is not too short ago.
void brd_host_tell_fault(brd_host_t *self);

/// Writes a snapshot into the line that is lent, if it is free: as reply with `id`, or as event `state` (NULL).
void brd_host_send_status(brd_host_t *self, brd_host_client_t *client, const iw_snapshot_t *seen, const iwn_id_t *id);

/// The host whose server this is.
static inline brd_host_t *brd_host_of(iwn_server_t *server) {
    return (brd_host_t *)(void *)((char *)server - offsetof(brd_host_t, server));
}

/// By the image: keeps a configuration for the next start. False: it could not, and the one of before stays.
bool brd_host_keep(const brd_settings_t *settings);
/// By the image: what was learnt of the wheels before. False: nothing.
bool brd_host_read_assumptions(brd_assumptions_t *out_learned);
/// By the image: keeps what was learnt. False: it could not.
bool brd_host_write_assumptions(const brd_assumptions_t *learned);

/// Nothing is sent, and nothing has been for the whole hold: what the flash costs in time, no wheel waits for.
bool brd_host_is_silent(const brd_host_t *self);

/// True once the board is to begin anew.
bool brd_host_wants_restart(const brd_host_t *self);

void brd_host_config(brd_host_t *self, iwn_client_t *client);
/// Carries out `confirm`: the operator's word on an assumption, for this run.
void brd_host_confirm(brd_host_t *self, iwn_client_t *client);
/// Of the ledger, into an object that is open.
void brd_host_write_item(brd_host_t *self, iw_assumption_item_t item, iwn_out_t *json);

/// Tells watchers what has changed since the last call.
void brd_host_observe(brd_host_t *self, const iw_snapshot_t *seen);
/// Of that, what is learnt of the wheels since the last call.
void brd_host_report_assumptions(brd_host_t *self, const iw_snapshot_t *seen);

#endif
