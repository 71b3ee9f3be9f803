// SPDX-License-Identifier: MIT
/// Table of the machines of a fleet, as they report themselves at a broker: one row per machine, and contradictions
/// that several of them have. Pure: no I/O except the output stream.
///
/// Input is validated before use, because any client with the right to publish may send anything.
#ifndef MQTT_FLEET_H
#define MQTT_FLEET_H

#include "mqtt_settings.h"

#include "iwheel_client/client.h"
#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/why.h"

#include <stdio.h>

/// Further machines are counted, not shown.
#define FLEET_MACHINES 1024U
#define FLEET_ITEMS    16U ///< Largest number of assumptions in the summary.

/// Source of a last stop.
typedef enum {
    FLEET_NONE,
    FLEET_INFO,   ///< Retained `info` of the machine: the last stop that its bridge knows.
    FLEET_STREAM, ///< Stream of the cluster.
    FLEET_LIVE    ///< Live event of the machine.
} fleet_source_t;

typedef struct {
    char id[MQTT_ID_SIZE];
    bool online;
    char state[12];
    char version[24];
    char cause[24]; ///< Cause of the last stop; empty: unknown.
    int64_t stop_wall_us;
    fleet_source_t stop_from;
    char sentence[IWN_SENTENCE_SIZE];
    iwc_value_t battery_dV[2]; ///< Left, right.
    char zero[2][16];          ///< Source of the zero of the force; `doubted` if it was measured under load.
    char contradicted[96];     ///< Contradicted assumptions, separated by blanks.
    uint64_t received_us;      ///< Time of the last message; 0: only retained ones.
} fleet_machine_t;

typedef struct {
    fleet_machine_t *machines; ///< FLEET_MACHINES of them, sorted by id.
    size_t count;
    uint64_t left_out;  ///< Messages that were not parsed, or of machines beyond the maximum.
    const char *stream; ///< Host of the stream that provided last stops; NULL: none.
    iwn_work_t work;
} fleet_t;

/// Returns false if there is no memory.
bool fleet_open(fleet_t *self);
void fleet_close(fleet_t *self);

/// Receives one message. Messages of other topics are counted only.
void fleet_take(fleet_t *self, const char *topic, const char *payload, size_t length, uint64_t now_us);

/// Receives the last stop of a machine from the stream. It is used unless a later one is known.
void fleet_take_stored(fleet_t *self, const char *topic, const char *payload, size_t length);

/// Splits `iwheel/ID/WHAT`; `*out_what` points into `topic`. Returns false for any other topic.
bool fleet_split(const char *topic, char out_id[MQTT_ID_SIZE], const char **out_what);

/// Copies a text of a message without control characters of a terminal; empty if there is none.
void fleet_text(const iwc_message_t *message, const char *path, char *out, size_t size);

/// Prints a table with lines of at most 118 columns, the contradictions of several machines, and the source of the last
/// stops.
void fleet_show(const fleet_t *self, uint64_t now_us, FILE *out);

/// Prints one JSON object per machine and line.
void fleet_print(const fleet_t *self, uint64_t now_us, FILE *out);

/// Prints one JSON object with all machines and the current wall clock, for iwheel-web.
void fleet_write(const fleet_t *self, uint64_t now_us, int64_t wall_us, FILE *out);

#endif
