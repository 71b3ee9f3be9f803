// SPDX-License-Identifier: MIT
/// What iwheel-fleet does: each verb asks a broker, or the stream behind it, and prints. None sends anything that moves, stops or changes a
/// machine.
#ifndef MQTT_FLEET_VERBS_H
#define MQTT_FLEET_VERBS_H

#include "history.h"

#include <signal.h>

/// What the command line says.
typedef struct {
    const char *id;   ///< Of a machine; NULL: none is named.
    const char *name; ///< Of a recording; NULL: the newest.
    const char *
        out; ///< Where its frames go; NULL: a name of its own, here. Of the table: a file that is rewritten every second.
    uint64_t seconds;      ///< The table, once after so long; 0: until it is told to end.
    uint64_t wait_s;       ///< For a machine that does not answer.
    bool json;             ///< Objects, one a line.
    history_config_t span; ///< Of the history.
    const volatile sig_atomic_t *end_asked;
} fleet_wanted_t;

/// For a listener that does not need them: it sends by QoS 0 only, which is neither confirmed nor refused.
void fleet_ignore(void *context);
void fleet_ignore_sent(void *context, int message);
void fleet_ignore_refused(void *context, int message, const char *why);

/// All of these: an exit code, with what is wrong told on stderr.
///
/// The table of machines.
int fleet_verb_table(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

/// What happened in a span of time.
int fleet_verb_history(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

int fleet_verb_recordings(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

/// Fetches one of them into files of this machine, all of them whole or none.
int fleet_verb_recording(const mqtt_settings_t *settings, const fleet_wanted_t *wanted);

#endif
