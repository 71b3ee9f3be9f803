// SPDX-License-Identifier: MIT
/// What a fleet's machines say of themselves at a broker: one row each, and what several of them contradict. Pure but for the stream.
///
/// What comes is judged before it is read: whoever may write to the broker may send anything.
#ifndef MQTT_FLEET_H
#define MQTT_FLEET_H

#include "mqtt_settings.h"

#include "iwheel_client/client.h"
#include "iwheel_northbound/json_in.h"

#include <stdio.h>

/// More machines are counted, not shown.
#define FLEET_MACHINES 1024U
#define FLEET_ITEMS    16U ///< Assumptions that are counted.

/// Who told a last stop.
typedef enum {
    FLEET_NOBODY,
    FLEET_INFO,   ///< The machine's `info`, retained: the last one its bridge knows of.
    FLEET_STREAM, ///< The stream of the cluster.
    FLEET_HEARD   ///< The machine, just now.
} fleet_source_t;

typedef struct {
    char id[MQTT_ID_SIZE];
    bool online;
    char state[12];
    char version[24];
    char cause[24]; ///< Of its last stop; empty: none is known.
    int64_t stop_wall_us;
    fleet_source_t stop_from;
    char sentence[200];
    iwc_value_t battery_dV[2]; ///< Left, right.
    char zero[2][16];          ///< Where the force's zero comes from; `doubted` if it was taken under load.
    char contradicted[96];     ///< Assumptions, separated by blanks.
    uint64_t received_us;      ///< Its last message; 0: only retained ones.
} fleet_machine_t;

typedef struct {
    fleet_machine_t *machines; ///< FLEET_MACHINES of them, sorted by id.
    size_t count;
    uint64_t left_out;  ///< Messages of machines beyond that, or that were garbled.
    const char *stream; ///< The host whose stream was asked for last stops; NULL: none.
    iwn_work_t work;
} fleet_t;

/// False: no memory.
bool fleet_open(fleet_t *self);
void fleet_close(fleet_t *self);

/// One message; topics of others are passed over.
void fleet_take(fleet_t *self, const char *topic, const char *payload, size_t length, uint64_t now_us);

/// The last stop of a machine, as the stream has it; it counts unless a later one is known.
void fleet_take_stored(fleet_t *self, const char *topic, const char *payload, size_t length);

/// The parts of `iwheel/ID/WHAT`, of which `*out_what` lies in `topic`. False: it is no such topic.
bool fleet_split(const char *topic, char out_id[MQTT_ID_SIZE], const char **out_what);

/// A text of a message that moves no terminal; empty: there is none.
void fleet_text(const iwc_message_t *message, const char *path, char *out, size_t size);

/// A table, in lines of at most 118 columns, what is wrong with several, and who told the last stops.
void fleet_show(const fleet_t *self, uint64_t now_us, FILE *out);

/// The same as one JSON object per machine and line.
void fleet_tell(const fleet_t *self, uint64_t now_us, FILE *out);

/// The same as one object, with the wall clock of the moment: for iwheel-web.
void fleet_write(const fleet_t *self, uint64_t now_us, int64_t wall_us, FILE *out);

#endif
