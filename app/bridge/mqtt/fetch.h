// SPDX-License-Identifier: MIT
/// A recording fetched from a machine by commands of MQTT, in pieces that are checked, and the list of what there is.
///
///     LISTING --list--> LISTED --fetch_choose--> FETCHING --every file whole--> DONE
///     any of them, after `patience_us` without a piece, or refused for good: FAILED, with `why`
///
/// Each command quotes `boot` and `t_us` of the last answer, which are the machine's; `hello` asks for them at the start and when none came
/// for a while. So a lost answer, a machine that was away and a bridge that began anew cost a repetition, no more. Every piece is compared
/// with its CRC-32, and each file as a whole with what the machine says of it.
///
/// Pure: no I/O, no clock, no heap. What comes is judged before it is read.
#ifndef MQTT_FETCH_H
#define MQTT_FETCH_H

#include "mqtt_command.h"
#include "mqtt_settings.h"

#include "iwheel_client/client.h"

/// A machine tells no more recordings.
#define FETCH_LISTED_MAX 32U
#define FETCH_FILES      3U
#define FETCH_NAME_SIZE  64U
#define FETCH_WHY_SIZE   400U

typedef enum { FETCH_LISTING, FETCH_LISTED, FETCH_FETCHING, FETCH_DONE, FETCH_FAILED } fetch_stage_t;

/// The command under way; each answer makes it NONE:
///
///     NONE --boot unknown or old--> HELLO;  NONE --else--> COMMAND;  HELLO, COMMAND --no answer in time--> HELLO
typedef enum { FETCH_NONE, FETCH_HELLO, FETCH_COMMAND } fetch_asked_t;

/// One that the machine has.
typedef struct {
    char name[FETCH_NAME_SIZE];
    char cause[FETCH_NAME_SIZE];
    iwc_value_t wall_us;
    iwc_value_t bytes[FETCH_FILES]; ///< Of its files, in the order of `fetch_endings`; not known: there is none.
} fetch_recording_t;

typedef struct {
    char id[MQTT_ID_SIZE];       ///< Of the machine.
    char from[MQTT_SENDER_SIZE]; ///< Who asks.
    fetch_stage_t stage;
    uint64_t patience_us;
    bool seen;                                ///< Anything came of this machine, in whatever stage.
    bool online;                              ///< As it said last; it may answer before it says so.
    fetch_recording_t list[FETCH_LISTED_MAX]; ///< The oldest first.
    size_t count;
    size_t chosen;
    size_t file; ///< The one that is being fetched.
    iwc_piece_t piece;
    uint8_t bytes[IWC_PIECE_MAX]; ///< Of the piece that came last,
    size_t got;                   ///< how many,
    size_t got_file;              ///< and of which file.
    uint64_t pieces;
    uint64_t again;           ///< Commands that were asked again.
    int code;                 ///< When it has failed: an exit code of sysexits, or 1 for a machine that says no,
    char why[FETCH_WHY_SIZE]; ///< and cause and cure.

    // Of the command that is under way.
    char boot[MQTT_BOOT_SIZE]; ///< To quote; empty: not known yet.
    int64_t t_us;
    uint64_t quoted_us; ///< When it came.
    int64_t seq;
    fetch_asked_t asked;
    uint64_t next_us;  ///< When something is due: to give up waiting, or to ask.
    uint64_t begun_us; ///< When it was begun, or the last piece or list came.
    unsigned refused;  ///< Times in a row.
    char words[200];   ///< Of the last refusal.
    iwn_work_t work;
} fetch_t;

/// What a message brought.
typedef enum {
    FETCH_NOTHING,
    FETCH_PIECE, ///< The next `got` bytes of the file `got_file`, in `bytes`.
} fetch_news_t;

/// The endings of a recording's files. The last to be fetched is the one with the frames.
extern const char *const fetch_endings[FETCH_FILES];

/// Begins to ask the machine for its list. `from` is a name that no other uses now.
void fetch_begin(fetch_t *self, const char *id, const char *from, uint64_t patience_us, uint64_t now_us);

/// Which one to fetch: by its name, or its number; NULL: the newest. Stage LISTED; else FAILED: there is none.
void fetch_choose(fetch_t *self, const char *name, uint64_t now_us);

/// True if a command is to be published now: VERB and payload.
bool fetch_step(fetch_t *self, uint64_t now_us, const char **out_verb, char out_payload[512]);

/// A message of the machine's. `what` is its topic without `iwheel/ID/`.
fetch_news_t fetch_take(fetch_t *self, const char *what, const char *payload, size_t length, uint64_t now_us);

#endif
