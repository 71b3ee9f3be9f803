// SPDX-License-Identifier: MIT
/// The host at the other end of the serial line: several clients on numbered channels (docs/user/serial.md). Each
/// client has its own requests, replies and events of the northbound protocol. They share one lease.
///
///     CLOSED --open--> OPEN --close | link | relay silent--> CLOSED
///
/// The board uses no content of a line before its CRC is right. It refuses a command that moves unless the command
/// quotes this start of the board, a number that its channel has not had yet, and a stamp that is younger than the
/// lease and than the channel. A line that was delayed, doubled or stored therefore does not extend the lease. The lease
/// runs from that stamp, not from the arrival of the line.
///
/// Output: replies have priority over events. A line that does not fit is dropped and counted. A snapshot is too long
/// for the ring of small lines, so the DMA sends it from its own buffer, one at a time. A client that requests a
/// snapshot meanwhile receives it later.
///
/// No heap. There is one instance, all zero before `brd_host_init`. Only the main loop calls these functions.
#ifndef BRD_HOST_H
#define BRD_HOST_H

#include "board_assumptions.h"
#include "fault.h"
#include "pending.h"

#include "iwheel/gateway.h"
#include "iwheel_northbound/line.h"
#include "iwheel_server/server.h"

/// Longest line to the host including its newline. The event link reports it.
#define BRD_HOST_LINE_BYTES 4480U
/// Longest line except snapshots.
#define BRD_HOST_SMALL_BYTES 1664U
/// Space in the send buffer that events leave free for replies.
#define BRD_HOST_REPLY_ROOM 768U
/// Periods of the event `link`. While a client is armed, the board also sends the event when no line was stamped for
/// BRD_HOST_LINK_ARMED_US: a command cannot quote a younger stamp than its client has received.
#define BRD_HOST_LINK_US       1000000U
#define BRD_HOST_LINK_ARMED_US 25000U
/// At most one line_error per this time.
#define BRD_HOST_ERROR_US 200000U
/// A restart after a commit waits until its reply has left, but not longer than this.
#define BRD_HOST_RESTART_US 500000U
/// Time in which the serial port sends the last bytes that it has, more than two at 115200 baud.
#define BRD_HOST_LAST_BYTES_US 1000U

/// A client of the relay.
typedef struct {
    iwn_client_t served; ///< Must be the first member; its id is IW_CLIENT_NONE while the channel is closed.
    bool owed_status;    ///< It has requested a snapshot that is not sent yet.
    bool owed_state;     ///< Its subscription is due a snapshot that is not sent yet.
    bool has_seq;        ///< `seq` is valid.
    uint32_t lost;       ///< Lines that were dropped and not reported yet.
    uint64_t seq;        ///< Sequence number of its newest command.
    iw_time_us_t opened_us;
} brd_host_client_t;

/// State of the stored facts about the wheels, as the daemon reports it.
typedef enum {
    BRD_RECORDS_NEW = 0, ///< Nothing was stored yet.
    BRD_RECORDS_STORED,
    BRD_RECORDS_FAILED,
} brd_records_state_t;

/// Learned facts as last reported to watchers.
typedef struct {
    iw_time_us_t offset_us[IW_SIDES]; ///< Offset in force: its time, its value, its source.
    int32_t offset_mN[IW_SIDES];
    uint8_t provenance[IW_SIDES]; ///< iw_offset_provenance_t.
    uint32_t assumed_changes;
    uint8_t assumed[IW_ASSUMPTION_ITEMS]; ///< iw_assumption_state_t.
} brd_host_reported_t;

/// Data about the image and its board, for brd_host_init.
typedef struct {
    iw_gateway_t *gateway;
    const char *version;
    const char *bus;     ///< Name of the bus, for messages.
    const char *estop;   ///< Name of the e-stop's pin.
    uint32_t bitrate_hz; ///< Bit rate of the bus.
    uint32_t sample_point_permille;
    brd_settings_t settings; ///< Settings of this start; in force if brd_settings_check accepts them.
    uint32_t rate_max_hz;    ///< Highest rate of snapshots that the serial line carries in addition to replies.
    uint64_t boot;           ///< Identifier of this start; every start has another one.
    brd_fault_t last_fault;  ///< Fault that ended an earlier run; cause 0: none.
} brd_host_place_t;

/// Small members come first, as in the server.
typedef struct {
    const iwn_quote_t *quote; ///< Quote of the current request; NULL: it has none.
    uint64_t boot;            ///< Identifier of this start.
    iw_time_us_t received_us; ///< Time of the last good line.
    iw_time_us_t linked_us;   ///< Time of the last `link`.
    iw_time_us_t stamped_us;  ///< Time of the last stamped line.
    iw_time_us_t error_us;    ///< Time of the last line_error.
    iw_time_us_t learn_us;    ///< Earliest time at which learned facts are written.
    iw_time_us_t restart_us;  ///< Latest time of the restart after a commit; 0: no restart.
    iw_time_us_t unsent_us;   ///< Last time at which bytes waited to be sent.
    brd_fault_t last_fault;   ///< As in brd_host_place_t.
    uint32_t errors;          ///< Bad lines since the start.
    uint32_t errors_reported; ///< Bad lines that a line_error has counted.
    uint32_t bitrate_hz;      ///< Bit rate of the bus.
    uint32_t sample_point_permille;
    iw_client_t last_id;
    uint32_t lease_us;
    iwn_line_verdict_t fault; ///< Defect of the last bad line.
    uint8_t next_owed;        ///< Client that is next for the long line, so that all get their turn.
    bool has_staged;          ///< `staged` contains changes.
    brd_records_state_t records;
    brd_assumptions_zero_t zero[IW_SIDES]; ///< Sources of the offsets in force.
    brd_host_reported_t reported;
    iwn_server_t server;
    brd_settings_t settings; ///< As in brd_host_place_t.
    brd_settings_t staged;   ///< Changed by `config`; in force after a commit and the restart that follows it.
    brd_host_client_t client[IWN_LINE_CHANNELS]; ///< Index 0 is channel 1.
    iwn_receiver_t receiver;
    brd_pending_t pending; ///< Waiting replies.
    char in[IWN_LINE_BOARD_MAX];
    union {
        iwn_work_t work;                   ///< Used while a request is read, ...
        char texts[4][IWN_NAME_MAX + 32U]; ///< then for names in a sentence, ...
        char small[BRD_HOST_SMALL_BYTES];  ///< and last for the line with the reply or event.
    } scratch;
    char big[BRD_HOST_LINE_BYTES]; ///< Buffer that is lent to the serial line.
} brd_host_t;

/// Starts without clients, restores the learned facts and sends the event `link`.
void brd_host_init(brd_host_t *self, const brd_host_place_t *place, iw_time_us_t now_us);

/// Call it directly before a step of the gateway. It closes all channels if the relay has sent nothing for
/// IWN_LINE_SILENT_MS, and executes one line: a request can need milliseconds, and the loop must read the e-stop
/// between two of them. Returns true if more lines may wait: call it again immediately, after the step.
bool brd_host_receive(brd_host_t *self, iw_time_us_t now_us);

/// Call it directly after the step. It answers the arms that the step decided, reports changes, and sends due events.
/// Returns the latest time of the next call.
iw_time_us_t brd_host_report(brd_host_t *self, const iw_snapshot_t *seen, bool estop_high);

// For the files of this part.

/// Writes the id of this start as hexadecimal digits. Returns `out_text`.
const char *brd_host_boot_text(uint64_t boot, char out_text[IWN_LINE_BOOT + 1U]);

/// Reports to the client the number of its dropped lines, if that line fits the ring.
void brd_host_report_lost(brd_host_t *self, brd_host_client_t *client);
/// Sends the event `link`, which identifies the board, on the channel of the link.
void brd_host_report_link(brd_host_t *self);
/// Reports new bad lines, unless the last report is too recent.
void brd_host_report_fault(brd_host_t *self);

/// Lends a snapshot to the serial line if it is free: as reply with `id`, or as event `state` if `id` is NULL.
void brd_host_send_status(brd_host_t *self, brd_host_client_t *client, const iw_snapshot_t *seen, const iwn_id_t *id);

/// Returns the host to which this server belongs.
static inline brd_host_t *brd_host_of(iwn_server_t *server) {
    return (brd_host_t *)(void *)((char *)server - offsetof(brd_host_t, server));
}

/// The image implements it. Stores a configuration for the next start. Returns false if that failed; the old one then
/// stays.
bool brd_host_store(const brd_settings_t *settings);
/// The image implements it. Reads the facts that earlier runs learned. Returns false if there are none.
bool brd_host_read_assumptions(brd_assumptions_t *out_learned);
/// The image implements it. Stores learned facts. Returns false if that failed.
bool brd_host_write_assumptions(const brd_assumptions_t *learned);

/// Returns true if the gateway is listening and sends nothing, not even zeros of a hold. Then no wheel waits while the
/// CPU writes to flash.
bool brd_host_is_silent(const brd_host_t *self);

/// Returns true if the stored settings are in force. Otherwise writes to the server's refusal what is wrong with them:
/// the board does not arm until `config` corrects that.
bool brd_host_is_configured(brd_host_t *self);

/// Returns true when the board must restart. Call it after each step. The restart would clear the latch of a stop that
/// came after the commit, so it waits until a person has reset it. Arm is refused meanwhile.
bool brd_host_wants_restart(brd_host_t *self);

void brd_host_config(brd_host_t *self, iwn_client_t *client);
/// Executes `confirm`: the operator confirms or contradicts an assumption.
void brd_host_confirm(brd_host_t *self, iwn_client_t *client);
/// Writes an item of the assumption store into an open object.
void brd_host_write_item(brd_host_t *self, iw_assumption_item_t item, iwn_out_t *json);

/// Reports to watchers all changes since the last call.
void brd_host_observe(brd_host_t *self, const iw_snapshot_t *seen);
/// Reports learned facts that are new since the last call.
void brd_host_report_assumptions(brd_host_t *self, const iw_snapshot_t *seen);

#endif
