// SPDX-License-Identifier: MIT
/// Verbs of iwheel-fleet: each verb queries a broker, or its stream, and prints. No verb moves, stops or changes a
/// machine.
#ifndef MQTT_FLEET_VERBS_H
#define MQTT_FLEET_VERBS_H

#include "history.h"

#include <signal.h>

/// Contents of the command line.
typedef struct {
    const char *id;        ///< Id of a machine; NULL: none.
    const char *name;      ///< Name of a recording; NULL: the newest.
    const char *out;       ///< File of the frames, or the table's file, rewritten every second; NULL: default.
    uint64_t seconds;      ///< Table: print once after this time; 0: until a signal.
    uint64_t wait_s;       ///< Longest wait for a machine that does not answer.
    bool json;             ///< JSON: one object a line.
    history_config_t span; ///< Span of the history.
    const volatile sig_atomic_t *end_asked;
} fleet_wanted_t;

/// Callbacks without effect for a listener that sends with QoS 0 only: such messages are neither confirmed nor refused.
void fleet_ignore(void *context);
void fleet_ignore_sent(void *context, int message);
void fleet_ignore_refused(void *context, int message, const char *why);

/// All verbs return an exit code and print errors on stderr.
///
/// Prints the table of machines.
int fleet_verb_table(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

/// Prints the events of a span of time.
int fleet_verb_history(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

int fleet_verb_recordings(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

/// Fetches a recording into local files, either all of them or none.
int fleet_verb_recording(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

#endif
