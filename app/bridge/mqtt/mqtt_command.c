// SPDX-License-Identifier: MIT
#include "mqtt_command.h"

#include "mqtt_settings.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/request.h"

#include <stdio.h>
#include <string.h>

/// After this time without a command a sender may restart its `seq`: its earlier commands are late by then.
#define FORGET_US (MQTT_TTL_MAX_MS * 1000ULL)

/// Fields of a verb, and whether it permits motion or clears a latch. The gateway checks which fields are required.
typedef struct {
    const char *word;
    bool permits;
    const char *fields[6]; ///< Ends with NULL.
} form_t;

static const form_t forms[MQTT_VERBS] = {
    [MQTT_HELLO] = {"hello", false, {NULL}},
    [MQTT_STOP] = {"stop", false, {NULL}},
    [MQTT_ESTOP] = {"estop", false, {NULL}}, // copy_reason copies its reason.
    [MQTT_ARM] = {"arm", true, {"takeover", NULL}},
    [MQTT_DRIVE] = {"drive", true, {"left_mm_s", "right_mm_s", "left_mA", "right_mA", NULL}},
    [MQTT_TWIST] = {"twist", true, {"v_mm_s", "yaw_mrad_s", NULL}},
    [MQTT_RESET] = {"reset", true, {"stop", NULL}},
    [MQTT_WHY] = {"why", false, {NULL}},
    [MQTT_RECORDINGS] = {"recordings", false, {NULL}},
    [MQTT_RECORDING] = {"recording", false, {"name", "offset", NULL}},
};

const char *mqtt_verb_word(mqtt_verb_t verb) {
    return (verb < MQTT_VERBS) ? forms[verb].word : "unknown";
}

const char *mqtt_verdict_word(mqtt_verdict_t verdict) {
    static const char *const words[MQTT_VERDICTS] = {
        [MQTT_TAKEN] = "taken",           [MQTT_RETAINED] = "retained", [MQTT_GARBLED] = "garbled",
        [MQTT_OTHER_BOOT] = "other_boot", [MQTT_LATE] = "late",         [MQTT_EARLY] = "early",
        [MQTT_DOUBLED] = "doubled",       [MQTT_CROWDED] = "crowded",   [MQTT_DENIED] = "denied",
    };
    return (verdict < MQTT_VERDICTS) ? words[verdict] : "unknown";
}

static bool drop(mqtt_order_t *order, mqtt_verdict_t verdict, const char *why) {
    order->verdict = verdict;
    (void)strncpy(order->why, why, sizeof order->why - 1U);
    return false;
}

/// Reads an integer of the command. Returns false if there is none.
static bool number_of(iwn_json_t root, const char *name, int64_t *out_number) {
    iwn_json_t value;
    if (!iwn_json_find(root, name, &value) || iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return false;
    }
    *out_number = iwn_json_integer(value);
    return true;
}

static bool text_of(iwn_json_t root, const char *name, char *out, size_t size) {
    iwn_json_t value;
    return iwn_json_find(root, name, &value) && iwn_json_kind(value) == IWN_JSON_TEXT &&
           iwn_json_text(value, out, size);
}

static bool is_one_of(iwn_json_t name, const char *const words[]) {
    for (size_t i = 0; words[i] != NULL; i++) {
        if (iwn_json_is(name, words[i])) {
            return true;
        }
    }
    return false;
}

/// Copies a field of the verb. Only numbers, texts and one boolean are rewritten, so the field cannot hide another
/// request.
static bool copy_field(iwn_json_t root, const char *name, iwn_out_t *out) {
    char text[256];
    iwn_json_t value;
    if (!iwn_json_find(root, name, &value)) {
        return true;
    }
    if (iwn_json_kind(value) == IWN_JSON_INTEGER) {
        iwn_out_int(out, name, iwn_json_integer(value));
        return true;
    }
    const bool truth = iwn_json_kind(value) == IWN_JSON_TRUE || iwn_json_kind(value) == IWN_JSON_FALSE;
    if (truth && strcmp(name, "takeover") == 0) {
        iwn_out_bool(out, name, iwn_json_kind(value) == IWN_JSON_TRUE);
        return true;
    }
    if (iwn_json_kind(value) == IWN_JSON_TEXT && iwn_json_text(value, text, sizeof text)) {
        iwn_out_text(out, name, text);
        return true;
    }
    return false;
}

/// Copies the part of the reason that the gateway can use: no reason prevents a stop.
static void copy_reason(iwn_json_t root, iwn_out_t *out) {
    char text[IWN_REASON_MAX + 1U] = "";
    iwn_json_t value;
    if (iwn_json_find(root, "reason", &value)) {
        (void)iwn_json_text(value, text, sizeof text); // Cuts a text that is too long.
        iwn_plain_blank(text);
    }
    if (text[0] != '\0') {
        iwn_out_text(out, "reason", text);
    }
}

static bool is_drive(mqtt_verb_t verb) {
    return verb == MQTT_DRIVE || verb == MQTT_TWIST;
}

static bool is_stop(mqtt_verb_t verb) {
    return verb == MQTT_STOP || verb == MQTT_ESTOP;
}

/// Reads the key of a drive command, and whether it is not zero. Both are independent of its age and sender.
static bool read_drive(iwn_json_t root, mqtt_order_t *order) {
    iwn_json_t value;
    for (size_t i = 0; forms[order->verb].fields[i] != NULL; i++) {
        int64_t number = 0;
        order->moves = order->moves || (number_of(root, forms[order->verb].fields[i], &number) && number != 0);
    }
    return !iwn_json_find(root, "key", &value) || text_of(root, "key", order->key, sizeof order->key);
}

/// Returns true if there are only fields that are common to all commands, or of this verb. A stop may have any.
static bool is_of_fields(iwn_json_t root, mqtt_verb_t verb) {
    static const char *const common[] = {"boot", "t_us", "ttl_ms", "seq", "from", NULL};
    iwn_json_t rest = iwn_json_inside(root);
    iwn_json_t name;
    iwn_json_t value;
    while (!is_stop(verb) && iwn_json_next(&rest, &name, &value)) {
        const bool is_key = is_drive(verb) && iwn_json_is(name, "key"); // The bridge judges it.
        if (!is_one_of(name, common) && !is_one_of(name, forms[verb].fields) && !is_key) {
            return false;
        }
    }
    return true;
}

static bool write_request(iwn_json_t root, mqtt_order_t *order) {
    const form_t *form = &forms[order->verb];
    iwn_out_t out;
    if (!is_of_fields(root, order->verb) || (is_drive(order->verb) && !read_drive(root, order))) {
        return false;
    }
    iwn_out_init(&out, order->request, sizeof order->request);
    iwn_out_open(&out, NULL, '{');
    iwn_out_text(&out, "cmd", form->word);
    bool good = true;
    for (size_t i = 0; form->fields[i] != NULL; i++) {
        good = copy_field(root, form->fields[i], &out) && good;
    }
    if (order->verb == MQTT_ESTOP) {
        copy_reason(root, &out);
    }
    if (order->verb == MQTT_ARM) {
        char who[MQTT_SENDER_SIZE + 8U] = "mqtt ";
        (void)strncat(who, order->from, MQTT_SENDER_SIZE);
        iwn_out_text(&out, "name", who);
    }
    int64_t logged_us = 0;
    if ((order->verb == MQTT_ARM || order->verb == MQTT_RESET) && number_of(root, "t_us", &logged_us)) {
        iwn_out_int(&out, "t_us", logged_us); // The gateway judges its age, too, and whether a stop is newer.
    }
    iwn_out_close(&out, '}');
    const size_t length = iwn_out_finish(&out);
    if (!good || length == 0U) {
        order->request[0] = '\0';
        return false;
    }
    order->request[length - 1U] = '\0'; // Without the newline, which the library of a client adds.
    return true;
}

/// Returns the index of the `seq` of this sender; otherwise that of the sender that was silent for longest.
/// MQTT_SENDERS: all are in use.
static size_t place_of(const mqtt_judge_t *self, const char *from, uint64_t now_us) {
    size_t oldest = 0;
    for (size_t i = 0; i < MQTT_SENDERS; i++) {
        if (strcmp(self->senders[i].name, from) == 0) {
            return i;
        }
        if (self->senders[i].received_us < self->senders[oldest].received_us) {
            oldest = i;
        }
    }
    const bool free = self->senders[oldest].name[0] == '\0' || now_us - self->senders[oldest].received_us > FORGET_US;
    return free ? oldest : MQTT_SENDERS;
}

/// Returns the largest age in ms after the quoted time; 0 if `ttl_ms` is not valid, except in a stop.
static int64_t ttl_of(const mqtt_rules_t *rules, iwn_json_t root, mqtt_verb_t verb) {
    const int64_t most_ms = forms[verb].permits ? (int64_t)rules->ttl_ms : (int64_t)MQTT_TTL_MAX_MS;
    int64_t asked_ms = most_ms;
    iwn_json_t value;
    if (iwn_json_find(root, "ttl_ms", &value) &&
        (!number_of(root, "ttl_ms", &asked_ms) || asked_ms < 1 || asked_ms > (int64_t)MQTT_TTL_MAX_MS)) {
        return is_stop(verb) ? most_ms : 0;
    }
    return (asked_ms < most_ms) ? asked_ms : most_ms;
}

static bool judge_age(const mqtt_rules_t *rules, iwn_json_t root, uint64_t gateway_us, mqtt_order_t *order) {
    char boot[MQTT_BOOT_SIZE] = "";
    int64_t logged_us = -1;
    const int64_t ttl_ms = ttl_of(rules, root, order->verb);
    if (!text_of(root, "boot", boot, sizeof boot) || !number_of(root, "t_us", &logged_us) || logged_us < 0 ||
        ttl_ms == 0) {
        return drop(order, MQTT_GARBLED,
                    "the command needs boot and t_us of a message of this machine; ttl_ms is 1 to 1000");
    }
    if (strcmp(boot, rules->boot) != 0) {
        return drop(order, MQTT_OTHER_BOOT, "send it again with boot and t_us of this reply");
    }
    if ((uint64_t)logged_us > gateway_us) {
        return drop(order, MQTT_EARLY,
                    "t_us is ahead of this machine; send it again with t_us of this reply, unchanged");
    }
    if (gateway_us - (uint64_t)logged_us > (uint64_t)ttl_ms * 1000U) {
        return drop(order, MQTT_LATE,
                    "too long on the way, or t_us of an old message; send it again with t_us of this reply");
    }
    return true;
}

static bool judge_count(mqtt_judge_t *self, uint64_t now_us, mqtt_order_t *order) {
    if (is_stop(order->verb)) { // A duplicate is harmless, and any client could use up the numbers or places.
        return true;
    }
    const size_t place = place_of(self, order->from, now_us);
    if (place == MQTT_SENDERS) {
        return drop(order, MQTT_CROWDED, "too many senders within a second");
    }
    if (strcmp(self->senders[place].name, order->from) == 0 && order->seq <= self->senders[place].seq &&
        now_us - self->senders[place].received_us <= FORGET_US) {
        return drop(order, MQTT_DOUBLED, "seq must increase with each command of a sender");
    }
    memcpy(self->senders[place].name, order->from, sizeof order->from);
    self->senders[place].seq = order->seq;
    self->senders[place].received_us = now_us;
    return true;
}

static bool find_verb(const char *word, mqtt_verb_t *out_verb) {
    for (unsigned i = 0; i < (unsigned)MQTT_VERBS; i++) {
        if (strcmp(forms[i].word, word) == 0) {
            *out_verb = (mqtt_verb_t)i;
            return true;
        }
    }
    return false;
}

/// Reads the destination and the correlation data of the answer: from the MQTT 5 properties, otherwise `from`. Returns
/// NULL, or what is wrong with them.
static const char *read_labels(const mqtt_rules_t *rules, const mqtt_command_t *command, mqtt_order_t *order) {
    const size_t begin = (rules->replies != NULL) ? strlen(rules->replies) : 0U;
    memcpy(order->to, order->from, sizeof order->to);
    if (command->answer_to != NULL) {
        if (begin == 0U || strncmp(command->answer_to, rules->replies, begin) != 0 ||
            !mqtt_settings_is_name(command->answer_to + begin)) {
            return "a response topic must be iwheel/ID/reply/NAME of this machine";
        }
        (void)snprintf(order->to, sizeof order->to, "%s", command->answer_to + begin);
    }
    if (command->correlation_length > sizeof order->correlation) {
        return "correlation data has 64 bytes at most";
    }
    if (command->correlation_length > 0U) {
        memcpy(order->correlation, command->correlation, command->correlation_length);
        order->correlation_length = (uint16_t)command->correlation_length;
    }
    return NULL;
}

/// Reads `from` and `seq`. Returns NULL, or what is wrong with them.
static const char *read_sender(iwn_json_t root, mqtt_order_t *order) {
    if (!text_of(root, "from", order->from, sizeof order->from) || !mqtt_settings_is_name(order->from)) {
        order->from[0] = '\0';
        return "from must be a name";
    }
    if (!number_of(root, "seq", &order->seq) || order->seq < 1) {
        order->seq = 0;
        return "the command needs seq, a number from 1 on that increases with each command";
    }
    return NULL;
}

/// Drops a payload that is no JSON object. A stop is executed anyway unless it is retained, because its age is unknown:
/// returns true with its request.
static bool drop_payload(const mqtt_rules_t *rules, const mqtt_command_t *command, mqtt_order_t *order) {
    if (!is_stop(order->verb) || command->retained) {
        return drop(order, MQTT_GARBLED, "not a JSON object");
    }
    (void)drop(order, MQTT_GARBLED, "not a JSON object; the stop is executed");
    (void)read_labels(rules, command, order); // Its sender is unknown.
    (void)snprintf(order->request, sizeof order->request, "{\"cmd\":\"%s\"}", forms[order->verb].word);
    return true;
}

/// Parses the JSON object.
static bool read_payload(mqtt_judge_t *self, const mqtt_command_t *command, mqtt_verb_t verb, iwn_json_t *out_root) {
    char fault[80];
    iwn_text_t words = iwn_text_begin(fault, sizeof fault);
    const size_t most = is_stop(verb) ? IWN_JSON_MAX : MQTT_COMMAND_MAX; // The reason may be long.
    return command->length <= most &&
           iwn_json_check(command->payload, command->length, &self->work, out_root, &words) &&
           iwn_json_kind(*out_root) == IWN_JSON_OBJECT;
}

/// Reads the sender and where the answer goes. A stop needs neither.
static bool read_command(const mqtt_rules_t *rules, const mqtt_command_t *command, bool known, iwn_json_t root,
                         mqtt_order_t *order) {
    const char *problem = read_sender(root, order);
    const char *labels = read_labels(rules, command, order); // Also of a bad sender: they name where the refusal goes.
    if (!known) {
        problem = "there is no such command";
    } else if (problem == NULL) {
        problem = labels;
    }
    return problem == NULL || is_stop(order->verb) || drop(order, MQTT_GARBLED, problem);
}

static bool is_allowed(const mqtt_rules_t *rules, mqtt_verb_t verb) {
    return (rules->may_drive || !forms[verb].permits) && (rules->may_reset || verb != MQTT_RESET);
}

/// Returns true if the request of `order` is executed.
static bool judge_command(mqtt_judge_t *self, const mqtt_rules_t *rules, const mqtt_command_t *command, uint64_t now_us,
                          mqtt_order_t *order) {
    iwn_json_t root;
    const bool known = find_verb(command->verb, &order->verb);
    if (!read_payload(self, command, order->verb, &root)) {
        return drop_payload(rules, command, order);
    }
    if (!read_command(rules, command, known, root, order)) {
        return false;
    }
    if (!write_request(root, order)) {
        return drop(order, MQTT_GARBLED, "it has a field that this command does not have, or an invalid value");
    }
    if (command->retained) {
        return drop(order, MQTT_RETAINED, "a command must not be retained");
    }
    int64_t stop = 0;
    if (order->verb == MQTT_RESET && (!number_of(root, "stop", &stop) || stop < 0)) {
        return drop(order, MQTT_GARBLED, "reset needs stop, the number of the stop to reset: see info or why");
    }
    if (order->verb == MQTT_HELLO) {
        return true;
    }
    if (!judge_age(rules, root, now_us + (uint64_t)rules->ahead_us, order) || !judge_count(self, now_us, order)) {
        return false;
    }
    return is_allowed(rules, order->verb) ||
           drop(order, MQTT_DENIED, "this bridge watches and stops; see [drive] in mqtt.conf");
}

void mqtt_judge(mqtt_judge_t *self, const mqtt_rules_t *rules, const mqtt_command_t *command, uint64_t now_us,
                mqtt_order_t *out_order) {
    memset(out_order, 0, sizeof *out_order);
    if (!judge_command(self, rules, command, now_us, out_order)) {
        out_order->request[0] = '\0';
    }
    self->counts[out_order->verdict]++;
}
