// SPDX-License-Identifier: MIT
/// What happened to a fleet's machines in a span of time: the events of its stream, each once, with what is missing between them. Pure but
/// for the stream that it writes to.
///
/// Doubles are known by their `id`: within a run of a bridge (`boot`) its number rises. A number left out is an event that is not in the stream:
/// dropped from a full spool, or confirmed by the broker and not stored (nats-server does not wait for the stream). A number of a stop left
/// out is one of those, or one that happened while the bridge did not run. What the stream lacks at its end shows in the machines' retained
/// `info`, which has the numbers of the newest event and of the last stop.
///
/// An event belongs to the span if the machine's clock (when it was heard; of one told late, when it happened) or the servers' (when it was
/// stored) puts it there: so a wrong clock hides none. Where the two are more than a minute apart, both are told.
#ifndef MQTT_HISTORY_H
#define MQTT_HISTORY_H

#include "fleet.h"
#include "mqtt_command.h"

/// What is to be told. Wall clock in microseconds.
typedef struct {
    const char *machine; ///< NULL: of all.
    int64_t since_us;
    int64_t until_us;
    bool all; ///< Every event, and where a bridge began anew; else stops only.
    bool json;
} history_config_t;

/// What a machine's retained `info` says.
typedef struct {
    bool known;
    char boot[MQTT_BOOT_SIZE];
    int64_t stop; ///< Number of its last stop; 0: none is known.
    int64_t stop_wall_us;
    uint64_t last;    ///< Number of its newest event,
    uint64_t waiting; ///< and how many of them wait at the machine.
    uint64_t dropped; ///< Since this run of the bridge began.
} history_info_t;

/// Numbers of events that are missing so far; `first` 0: none.
typedef struct {
    uint64_t first;
    uint64_t last;
} history_gap_t;
#define HISTORY_GAPS 8U

/// Runs of a bridge whose doubles are known.
#define HISTORY_BOOTS 4U

typedef struct {
    char id[MQTT_ID_SIZE];
    struct {
        char boot[MQTT_BOOT_SIZE];
        uint64_t number; ///< The newest of it.
    } runs[HISTORY_BOOTS];
    size_t run;       ///< The one that an event came from last.
    uint64_t number;  ///< Of its newest event; 0: none yet.
    int64_t event_us; ///< When that was heard.
    int64_t stop;     ///< Of its newest stop; 0: none yet.
    int64_t stop_wall_us;
    history_info_t info;
    history_gap_t gaps[HISTORY_GAPS]; ///< The newest ones: by them an event that comes late is no double.
    size_t next_gap;
    uint64_t missing; ///< Events that should lie before the next one that is told,
    uint64_t unheard; ///< stops,
    bool began;       ///< and whether its bridge began anew.
    bool told;
} history_machine_t;

typedef struct {
    history_config_t config;
    FILE *out;
    history_machine_t *machines; ///< FLEET_MACHINES of them, in the order in which they came.
    size_t count;
    uint64_t told;
    uint64_t doubled;
    uint64_t garbled; ///< Also those of machines beyond FLEET_MACHINES.
    uint64_t missing;
    uint64_t unheard;
    bool has_info; ///< A broker was asked for the `info` of the machines.
    iwn_work_t work;
} history_t;

/// False: no memory.
bool history_open(history_t *self, const history_config_t *config, FILE *out);
void history_close(history_t *self);

/// One event of the stream, in the order in which they were stored. As `stream_take_t`, with the history as context: false when nobody
/// reads any more.
bool history_take(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us);

/// The retained `info` of a machine; all of them come before the first event.
void history_take_info(history_t *self, const char *topic, const char *payload, size_t length);

/// After the last event: what the stream lacks behind it.
void history_end(history_t *self);

/// The sum, and whose stream it was.
void history_sum(const history_t *self, const char *host);

// ---- between its parts --------------------------------------------------------------------------------------------

#define HISTORY_TIME_SIZE 32U

/// Local time, or `--`.
void history_time(int64_t wall_us, char out[HISTORY_TIME_SIZE]);

/// Its row; NULL: there are too many.
history_machine_t *history_machine(history_t *self, const char *id);

/// Why events of this machine may be missing, as far as the machine knows it.
void history_cause(const history_machine_t *machine, char *out, size_t size);

/// One line about a number of events.
void history_note(const history_t *self, const history_machine_t *machine, uint64_t events, const char *words);

// ---- times --------------------------------------------------------------------------------------------------------

/// A point in time as people write it: `2026-11-21T22:00`, with seconds or without, also a blank for the T, or a day alone, in local time;
/// with Z in UTC. False: it is none.
bool history_when(const char *text, int64_t *out_us);

/// How long: `90min`, `12h`, `7d`. False: it is none, or not above 0.
bool history_span(const char *text, int64_t *out_us);

#endif
