// SPDX-License-Identifier: MIT
/// Fetches the list of recordings and one recording of a machine by MQTT commands, in pieces with checksums.
///
///     LISTING --list--> LISTED --fetch_choose--> FETCHING --every file whole--> DONE
///     any of them, after `patience_us` without a piece, or after a final refusal: FAILED, with `why`
///
/// Each command quotes `boot` and `t_us` of the machine from the last answer. `hello` requests them at the start and
/// after a time without an answer. So a lost answer, a machine that was away and a bridge that restarted cost only a
/// repetition. Every piece is compared with its CRC-32, and each file with the checksum from the machine.
///
/// Pure: no I/O, no clock, no heap. Input is validated before use.
#ifndef MQTT_FETCH_H
#define MQTT_FETCH_H

#include "mqtt_command.h"
#include "mqtt_settings.h"

#include "iwheel_client/client.h"

/// Largest number of recordings in the list of a machine.
#define FETCH_LISTED_MAX 32U
#define FETCH_FILES      3U
#define FETCH_NAME_SIZE  64U
#define FETCH_WHY_SIZE   400U

typedef enum { FETCH_LISTING, FETCH_LISTED, FETCH_FETCHING, FETCH_DONE, FETCH_FAILED } fetch_stage_t;

/// Command under way; each answer sets NONE:
///
///     NONE --boot unknown or old--> HELLO;  NONE --else--> COMMAND;  HELLO, COMMAND --no answer in time--> HELLO
typedef enum { FETCH_NONE, FETCH_HELLO, FETCH_COMMAND } fetch_asked_t;

/// One recording of the machine.
typedef struct {
    char name[FETCH_NAME_SIZE];
    char cause[FETCH_NAME_SIZE];
    iwc_value_t wall_us;
    iwc_value_t bytes[FETCH_FILES]; ///< Sizes of its files, in the order of `fetch_endings`; not known: no such file.
} fetch_recording_t;

typedef struct {
    char id[MQTT_ID_SIZE];       ///< Id of the machine.
    char from[MQTT_SENDER_SIZE]; ///< Name of this client.
    fetch_stage_t stage;
    uint64_t patience_us;
    bool seen;                                ///< A message of this machine has arrived, in any stage.
    bool online;                              ///< Last availability; the machine may answer before it publishes it.
    fetch_recording_t list[FETCH_LISTED_MAX]; ///< Oldest first.
    size_t count;
    size_t chosen;
    size_t file; ///< Number of the file that is fetched.
    iwc_piece_t piece;
    uint8_t bytes[IWC_PIECE_MAX]; ///< Bytes of the last piece.
    size_t got;                   ///< Number of bytes in `bytes`.
    size_t got_file;              ///< Number of the file that these bytes belong to.
    uint64_t pieces;
    uint64_t again;           ///< Commands that were repeated.
    int code;                 ///< FAILED: an exit code of sysexits, or 1 if the machine refuses.
    char why[FETCH_WHY_SIZE]; ///< FAILED: cause and fix.

    // Command under way.
    char boot[MQTT_BOOT_SIZE]; ///< Boot id to quote; empty: not known yet.
    int64_t t_us;
    uint64_t quoted_us; ///< Time of receipt of the quote.
    int64_t seq;
    fetch_asked_t asked;
    uint64_t next_us;  ///< Time of the next step: repeat, or send.
    uint64_t begun_us; ///< Start, or time of the last piece or list.
    unsigned refused;  ///< Refusals in a row.
    char words[200];   ///< Text of the last refusal.
    iwn_work_t work;
} fetch_t;

/// Result of a message.
typedef enum {
    FETCH_NOTHING,
    FETCH_PIECE, ///< `bytes` contains the next `got` bytes of the file `got_file`.
} fetch_news_t;

/// Name endings of the files of a recording. The last one is the file with the frames.
extern const char *const fetch_endings[FETCH_FILES];

/// Requests the list of the machine. `from` is a name that no other client uses now.
void fetch_begin(fetch_t *self, const char *id, const char *from, uint64_t patience_us, uint64_t now_us);

/// Selects the recording to fetch, in stage LISTED: by its name or number; NULL: the newest. FAILED if there is none.
void fetch_choose(fetch_t *self, const char *name, uint64_t now_us);

/// Returns true if a command must be published now, and sets its VERB and payload.
bool fetch_step(fetch_t *self, uint64_t now_us, const char **out_verb, char out_payload[512]);

/// Receives a message of the machine. `what` is its topic without `iwheel/ID/`.
fetch_news_t fetch_take(fetch_t *self, const char *what, const char *payload, size_t length, uint64_t now_us);

#endif
