// SPDX-License-Identifier: MIT
/// Judges whether a command from MQTT is still valid, and converts it into a request to the gateway. The bridge parses
/// no other input of senders.
///
/// Pure: no I/O, no clock, no heap. A command quotes `boot` and `t_us` of a message of this machine, and has a sender
/// name `from` and a `seq` that increases. Its age is the monotonic time of this machine since `t_us`; no other clock
/// is used. Commands that are retained, late, duplicated, out of order or from another run of the bridge are dropped
/// and counted. A stop only needs its age: no sender, `seq`, property, unknown field or reason refuses it. The usable
/// part of the reason is passed on. A stop whose payload is no JSON object has no age: it is dropped with MQTT_GARBLED,
/// and executed anyway unless it is retained. `from` is a label: any client with the right to publish may use any name.
/// The right to drive is the `key` of the reply to `arm`.
///
/// A response topic of MQTT 5 is valid only among the replies of this machine, so that no client makes the bridge write
/// to other topics.
#ifndef MQTT_COMMAND_H
#define MQTT_COMMAND_H

#include "iwheel_northbound/json_in.h"

/// Largest age of a command.
#define MQTT_TTL_MAX_MS 1000U
/// Largest command in bytes. A longer one is not parsed, except a stop with at most IWN_JSON_MAX.
#define MQTT_COMMAND_MAX 4096U
#define MQTT_SENDER_SIZE 33U
/// Size of a key with its terminator.
#define MQTT_KEY_SIZE 33U
/// Largest correlation data in bytes that are returned.
#define MQTT_CORRELATION_MAX 64U
#define MQTT_SENDERS         16U
/// Size of `boot` with its terminator.
#define MQTT_BOOT_SIZE 17U

typedef enum {
    MQTT_HELLO, ///< Requests `boot` and `t_us`, and needs to quote neither.
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

/// Result of a command. Each has a word and a counter.
typedef enum {
    MQTT_TAKEN,
    MQTT_RETAINED,
    MQTT_GARBLED, ///< No JSON, unknown verb or field, or a field that is missing or of a wrong type.
    MQTT_OTHER_BOOT,
    MQTT_LATE,
    MQTT_EARLY,   ///< It quotes a time in the future.
    MQTT_DOUBLED, ///< Its `seq` does not increase.
    MQTT_CROWDED, ///< More than MQTT_SENDERS senders within a second.
    MQTT_DENIED,  ///< Not enabled in the configuration.
    MQTT_VERDICTS
} mqtt_verdict_t;

typedef struct {
    const char *boot; ///< Boot id of this run.
    uint32_t ttl_ms;  ///< Age limit of commands that permit motion or clear a latch, at most MQTT_TTL_MAX_MS.
    bool may_drive;
    bool may_reset;
    const char *replies; ///< `iwheel/ID/reply/`: required prefix of a response topic.
    int64_t ahead_us;    ///< The gateway's clock, as in `t_us`, is ahead of `now_us` by this time.
} mqtt_rules_t;

/// Command as received.
typedef struct {
    const char *verb; ///< Last part of its topic, terminated.
    const char *payload;
    size_t length;
    bool retained;
    const char *answer_to;   ///< Response topic of MQTT 5; NULL: none.
    const void *correlation; ///< Correlation data of MQTT 5.
    size_t correlation_length;
} mqtt_command_t;

/// Judged command.
typedef struct {
    mqtt_verdict_t verdict;
    mqtt_verb_t verb;
    char from[MQTT_SENDER_SIZE]; ///< Sender; empty: unknown, so there is no answer.
    char to[MQTT_SENDER_SIZE];   ///< Destination of the answer: `from`, or the name in the response topic.
    uint8_t correlation[MQTT_CORRELATION_MAX]; ///< Returned with the answer.
    uint16_t correlation_length;
    int64_t seq;             ///< 0: unknown.
    bool moves;              ///< A well-formed command with a value that is not zero, dropped or not.
    char key[MQTT_KEY_SIZE]; ///< Key of a command that drives; empty: none.
    char why[160];           ///< Cause and fix, unless it is accepted.
    char request[1024];      ///< Request to the gateway; empty: the command is not executed.
} mqtt_order_t;

/// Last command of each sender. All zero at first.
typedef struct {
    struct {
        char name[MQTT_SENDER_SIZE];
        int64_t seq;
        uint64_t received_us;
    } senders[MQTT_SENDERS];
    uint64_t counts[MQTT_VERDICTS];
    iwn_work_t work;
} mqtt_judge_t;

/// Judges one command that arrived at `now_us`, and counts it.
void mqtt_judge(mqtt_judge_t *self, const mqtt_rules_t *rules, const mqtt_command_t *command, uint64_t now_us,
                mqtt_order_t *out_order);

/// Returns the word of a verdict, as in `error` and in the counters.
const char *mqtt_verdict_word(mqtt_verdict_t verdict);
const char *mqtt_verb_word(mqtt_verb_t verb);

#endif
