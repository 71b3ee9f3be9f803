// SPDX-License-Identifier: MIT
/// History of the machines of a fleet in a span of time: the events of its stream, each once, and the gaps between
/// them. Pure: no I/O except the output stream.
///
/// Duplicates are recognised by their `id`: within a run of a bridge (`boot`) its number increases. A skipped number is
/// an event that is not in the stream: dropped from a full spool, or confirmed by the broker and not stored
/// (nats-server does not wait for the stream). A skipped number of a stop is one of those, or a stop while the bridge
/// did not run. Events that the stream lacks at its end are found by the retained `info` of the machines, which has the
/// numbers of the newest event and of the last stop.
///
/// An event belongs to the span if either clock puts it there: that of the machine (time of receipt by the bridge; for
/// a late report, time of the event) or that of the servers (time of storage). So a wrong clock hides no event. If the
/// two differ by more than a minute, both are printed.
#ifndef MQTT_HISTORY_H
#define MQTT_HISTORY_H

#include "fleet.h"
#include "mqtt_command.h"

/// Selection of events. Wall clock in microseconds.
typedef struct {
    const char *machine; ///< NULL: all machines.
    int64_t since_us;
    int64_t until_us;
    bool all; ///< All events and the restarts of bridges; false: stops only.
    bool json;
} history_config_t;

/// Contents of the retained `info` of a machine.
typedef struct {
    bool known;
    char boot[MQTT_BOOT_SIZE];
    int64_t stop; ///< Number of the last stop; 0: unknown.
    int64_t stop_wall_us;
    uint64_t last;    ///< Number of the newest event.
    uint64_t waiting; ///< Number of events that wait at the machine.
    uint64_t dropped; ///< Events that were dropped since the start of this run of the bridge.
} history_info_t;

/// Range of numbers of missing events; `first` 0: none.
typedef struct {
    uint64_t first;
    uint64_t last;
} history_gap_t;
#define HISTORY_GAPS 8U

/// Number of runs of a bridge for which duplicates are recognised.
#define HISTORY_BOOTS 4U

typedef struct {
    char id[MQTT_ID_SIZE];
    struct {
        char boot[MQTT_BOOT_SIZE];
        uint64_t number; ///< Newest number of the run.
    } runs[HISTORY_BOOTS];
    size_t run;       ///< Run of the last event.
    uint64_t number;  ///< Number of the newest event; 0: none yet.
    int64_t event_us; ///< Time of its receipt by the bridge.
    int64_t stop;     ///< Number of the newest stop; 0: none yet.
    int64_t stop_wall_us;
    history_info_t info;
    history_gap_t gaps[HISTORY_GAPS]; ///< Newest gaps: a late event in a gap is not a duplicate.
    size_t next_gap;
    uint64_t missing;       ///< Missing events before the next printed one.
    uint64_t stops_missing; ///< Missing stops before the next printed event.
    bool began;             ///< Its bridge restarted before the next printed event.
    bool printed;
} history_machine_t;

typedef struct {
    history_config_t config;
    FILE *out;
    history_machine_t *machines; ///< FLEET_MACHINES entries, in the order of arrival.
    size_t count;
    uint64_t printed;
    uint64_t doubled;
    uint64_t garbled; ///< Includes events of machines beyond FLEET_MACHINES.
    uint64_t missing;
    uint64_t stops_missing;
    bool has_info; ///< The broker accepted the connection that reads the `info` of the machines.
    iwn_work_t work;
} history_t;

/// Returns false if there is no memory.
bool history_open(history_t *self, const history_config_t *config, FILE *out);
void history_close(history_t *self);

/// Receives one event of the stream, in the order of storage. It has the type `stream_visit_t`, with the history as
/// context. Returns false if the output is closed.
bool history_take(void *context, const char *topic, const char *payload, size_t length, int64_t stored_us);

/// Receives the retained `info` of a machine. All of them must precede the first event.
void history_take_info(history_t *self, const char *topic, const char *payload, size_t length);

/// Reports the events that the stream lacks at its end. Call it after the last event.
void history_end(history_t *self);

/// Prints the totals and the host of the stream.
void history_sum(const history_t *self, const char *host);

// ---- between its parts --------------------------------------------------------------------------------------------

#define HISTORY_TIME_SIZE 32U

/// Writes the local time, or `--`.
void history_time(int64_t wall_us, char out[HISTORY_TIME_SIZE]);

/// Returns the row of a machine, which is added if new. Returns NULL if there are too many.
history_machine_t *history_machine(history_t *self, const char *id);

/// Writes why events of this machine may be missing, as far as the machine knows.
void history_cause(const history_machine_t *machine, char *out, size_t size);

/// Prints one line about a number of events.
void history_note(const history_t *self, const history_machine_t *machine, uint64_t events, const char *words);

// ---- times --------------------------------------------------------------------------------------------------------

/// Parses a point in time: `2026-11-21T22:00`, with or without seconds, also with a blank for the T, or only a date, in
/// local time; with Z in UTC. Returns false if it is not valid.
bool history_when(const char *text, int64_t *out_us);

/// Parses a duration: `90min`, `12h`, `7d`. Returns false if it is not valid or not above 0.
bool history_span(const char *text, int64_t *out_us);

#endif
