// SPDX-License-Identifier: MIT
/// Whether a command that came by MQTT still counts, and what it asks of the gateway. All that the bridge reads of what others send.
///
/// Pure: no I/O, no clock, no heap. A command quotes `boot` and `t_us` of a message of this machine's and says who it is `from`, with a
/// `seq` that rises. Its age is this machine's monotonic time since `t_us`: no other clock takes part. Whatever is retained, late, doubled,
/// out of order or from another run of the bridge is dropped and counted. A stop needs its age only: no `seq` and no number of senders refuses
/// it. `from` is a label: whoever may write there may use any. The right to drive is the `key` of the reply to `arm`.
///
/// A response topic of MQTT 5 counts only among this machine's replies: nobody makes the bridge write where only it may.
#ifndef MQTT_COMMAND_H
#define MQTT_COMMAND_H

#include "iwheel_northbound/json_in.h"

/// No command counts longer.
#define MQTT_TTL_MAX_MS 1000U
/// Bytes of a longer command are not looked at.
#define MQTT_COMMAND_MAX 4096U
#define MQTT_SENDER_SIZE 33U
/// Bytes of a key with its terminator.
#define MQTT_KEY_SIZE 33U
/// Bytes of correlation data that are given back.
#define MQTT_CORRELATION_MAX 64U
#define MQTT_SENDERS         16U
/// Bytes of `boot` with its terminator.
#define MQTT_BOOT_SIZE 17U

typedef enum {
    MQTT_HELLO, ///< Only asks for `boot` and `t_us`, which it need not know.
    MQTT_STOP,
    MQTT_ESTOP,
    MQTT_ARM,
    MQTT_DRIVE,
    MQTT_TWIST,
    MQTT_RESET,
    MQTT_WHY,
    MQTT_RECORDINGS,
    MQTT_RECORDING,
    MQTT_VERBS
} mqtt_verb_t;

/// Why a command is dropped; for each there is a word and a counter.
typedef enum {
    MQTT_TAKEN,
    MQTT_RETAINED,
    MQTT_GARBLED, ///< No such verb, no JSON, a field that is missing, unknown or none of its kind.
    MQTT_OTHER_BOOT,
    MQTT_LATE,
    MQTT_EARLY,   ///< It quotes a time that has not come yet.
    MQTT_DOUBLED, ///< Its `seq` does not rise.
    MQTT_CROWDED, ///< More than MQTT_SENDERS within a second.
    MQTT_DENIED,  ///< Not configured.
    MQTT_VERDICTS
} mqtt_verdict_t;

typedef struct {
    const char *boot; ///< Of this run.
    uint32_t ttl_ms;  ///< Of commands that permit motion or clear a latch, at most MQTT_TTL_MAX_MS.
    bool may_drive;
    bool may_reset;
    const char *replies; ///< `iwheel/ID/reply/`: what a response topic must begin with.
} mqtt_rules_t;

/// As it came.
typedef struct {
    const char *verb; ///< The last part of its topic, terminated.
    const char *payload;
    size_t length;
    bool retained;
    const char *answer_to;   ///< Response topic of MQTT 5; NULL: none.
    const void *correlation; ///< Correlation data of MQTT 5.
    size_t correlation_length;
} mqtt_command_t;

/// What it comes to.
typedef struct {
    mqtt_verdict_t verdict;
    mqtt_verb_t verb;
    char from[MQTT_SENDER_SIZE];               ///< Empty: not known, so there is nobody to answer.
    char to[MQTT_SENDER_SIZE];                 ///< Who gets the answer: `from`, or who the response topic names.
    uint8_t correlation[MQTT_CORRELATION_MAX]; ///< To be told with the answer.
    uint16_t correlation_length;
    int64_t seq;             ///< 0: not known.
    bool moves;              ///< A well-formed command with a value that is not zero, dropped or not.
    char key[MQTT_KEY_SIZE]; ///< Of a command that drives; empty: it has none.
    char why[160];           ///< Cause and cure, unless it is taken.
    char request[1024];      ///< For the gateway, unless it is dropped or MQTT_HELLO.
} mqtt_order_t;

/// Who sent what last. All zero at first.
typedef struct {
    struct {
        char name[MQTT_SENDER_SIZE];
        int64_t seq;
        uint64_t received_us;
    } senders[MQTT_SENDERS];
    uint64_t counts[MQTT_VERDICTS];
    iwn_work_t work;
} mqtt_judge_t;

/// Judges one command that came at `now_us`, and counts it.
void mqtt_judge(mqtt_judge_t *self, const mqtt_rules_t *rules, const mqtt_command_t *command, uint64_t now_us,
                mqtt_order_t *out_order);

/// The word for it, as in `error` and in the counters.
const char *mqtt_verdict_word(mqtt_verdict_t verdict);
const char *mqtt_verb_word(mqtt_verb_t verb);

#endif
