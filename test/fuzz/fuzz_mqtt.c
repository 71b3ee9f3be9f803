// SPDX-License-Identifier: MIT
// Any bytes as a command by MQTT, as a spool's file, and as input of the console. An accepted command belongs to this run, is in time, comes once,
// and is one line for the gateway; a record read from a file is whole; output of the console moves no terminal and names no foreign file.
#include "fuzz.h"

#include "fetch.h"
#include "history.h"
#include "mqtt_command.h"
#include "spool.h"

#include "iwheel_northbound/line.h"

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#define NOW_US 50000000U

#define SPOOL "iwspool1"
/// A record's length and checksum, and its letter, number and mark.
#define HEAD_SIZE 8U
#define BODY_SIZE 17U

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed);

static bool is_spool(const uint8_t *data, size_t size) {
    return size >= sizeof SPOOL - 1U && memcmp(data, SPOOL, sizeof SPOOL - 1U) == 0;
}

/// Corrects lengths and checksums of the records; the last record ends with the file. Otherwise no change of a spool would pass them.
static void seal(uint8_t *at, size_t left) {
    while (left >= HEAD_SIZE + BODY_SIZE) {
        size_t length = at[0] | (size_t)at[1] << 8;
        length = (length >= BODY_SIZE && length + HEAD_SIZE <= left) ? length : left - HEAD_SIZE;
        const uint32_t crc = iwn_line_crc(0, at + HEAD_SIZE, length);
        for (unsigned i = 0; i < 4U; i++) {
            at[i] = (uint8_t)(length >> (8U * i));
            at[4U + i] = (uint8_t)(crc >> (8U * i));
        }
        at += HEAD_SIZE + length;
        left -= HEAD_SIZE + length;
    }
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed) {
    const size_t magic = sizeof SPOOL - 1U;
    if (!is_spool(data, size) || max_size < 2U * magic || seed % 8U == 0U) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    const size_t length = LLVMFuzzerMutate(data + magic, size - magic, max_size - magic);
    seal(data + magic, length);
    return magic + length;
}

/// A stop needs no rising number and no place among the senders: no other sender can prevent it.
static bool is_stop(mqtt_verb_t verb) {
    return verb == MQTT_STOP || verb == MQTT_ESTOP;
}

/// An accepted command counts once, and only in time. A greeting may come again, and a stop while it is in time.
static void judge_again(mqtt_judge_t *judge, const mqtt_rules_t *rules, const mqtt_command_t *command) {
    mqtt_order_t order;
    mqtt_judge(judge, rules, command, NOW_US, &order);
    fuzz_require(order.verb == MQTT_HELLO || order.verdict == (is_stop(order.verb) ? MQTT_TAKEN : MQTT_DOUBLED),
                 "once");
    mqtt_judge(judge, rules, command, NOW_US + 60000000U, &order);
    fuzz_require(order.verb == MQTT_HELLO || order.verdict == MQTT_LATE, "not late");
}

/// Returns true if the payload is no JSON object.
static bool is_garbled(const mqtt_command_t *command) {
    static iwn_work_t work;
    char why[80];
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    iwn_json_t root;
    return !iwn_json_check(command->payload, command->length, &work, &root, &fault) ||
           iwn_json_kind(root) != IWN_JSON_OBJECT;
}

static void judge_command(const mqtt_rules_t *rules, const mqtt_command_t *command, bool crowded) {
    mqtt_judge_t judge = {0};
    mqtt_order_t order;
    for (unsigned i = 0; crowded && i < MQTT_SENDERS; i++) {
        judge.senders[i].name[0] = (char)('A' + (char)i);
        judge.senders[i].received_us = NOW_US - 1U;
    }
    mqtt_judge(&judge, rules, command, NOW_US, &order);
    fuzz_require(judge.counts[order.verdict] == 1U, "counted");
    const bool anyway = order.verdict == MQTT_GARBLED && order.request[0] != '\0';
    fuzz_require((order.verdict == MQTT_TAKEN || anyway) == (order.request[0] != '\0'), "a request, or a reason");
    fuzz_require(!anyway || (is_stop(order.verb) && !command->retained && is_garbled(command)), "a garbled stop");
    fuzz_require(
        !anyway || strcmp(order.request, (order.verb == MQTT_STOP) ? "{\"cmd\":\"stop\"}" : "{\"cmd\":\"estop\"}") == 0,
        "the stop alone");
    fuzz_position((order.verdict == MQTT_TAKEN) ? "accepted" : "refused");
    if (order.verdict != MQTT_TAKEN) {
        fuzz_require(order.why[0] != '\0', "and why");
        return;
    }
    fuzz_require(is_stop(order.verb) || (order.from[0] != '\0' && order.to[0] != '\0'), "a sender, and a receiver");
    fuzz_require(strpbrk(order.from, "/+#\" ") == NULL && strpbrk(order.to, "/+#\" ") == NULL, "names");
    fuzz_require(strchr(order.request, '\n') == NULL && strncmp(order.request, "{\"cmd\":\"", 8) == 0, "one line");
    fuzz_require(strncmp(order.request + 8, command->verb, strlen(command->verb)) == 0, "of that verb");
    fuzz_require(order.verb != MQTT_RESET || rules->may_reset, "not configured");
    fuzz_require((order.verb != MQTT_ARM && order.verb != MQTT_DRIVE && order.verb != MQTT_TWIST) || rules->may_drive,
                 "it watches only");
    fuzz_require(!command->retained, "not retained");
    fuzz_require(!crowded || order.verb == MQTT_HELLO || is_stop(order.verb) || strlen(order.from) == 1U,
                 "not crowded");
    judge_again(&judge, rules, command);
}

/// The first line is the verb; after a tab the response topic; after another tab correlation data. Flags may precede the verb: `!` the message
/// is retained; `#` sixteen other senders were active just now; `-` the bridge only watches; `+` the bridge may reset.
static void judge(const uint8_t *data, size_t size) {
    mqtt_rules_t rules = {"0123456789abcdef", 300, true, false, "iwheel/w1/reply/", 0};
    mqtt_command_t command = {0};
    char first[160] = "";
    const uint8_t *newline = memchr(data, '\n', size);
    const size_t length = (newline != NULL) ? (size_t)(newline - data) : 0U;
    if (newline == NULL || length >= sizeof first) {
        return;
    }
    memcpy(first, data, length);
    char *verb = first + strspn(first, "!#-+");
    const size_t flags = (size_t)(verb - first);
    command.retained = memchr(first, '!', flags) != NULL;
    rules.may_drive = memchr(first, '-', flags) == NULL;
    rules.may_reset = memchr(first, '+', flags) != NULL;
    char *tab = strchr(verb, '\t');
    if (tab != NULL) {
        *tab = '\0';
        command.answer_to = tab + 1;
        tab = strchr(tab + 1, '\t');
        command.correlation = (tab != NULL) ? tab + 1 : NULL;
        command.correlation_length = (tab != NULL) ? strlen(tab + 1) : 0U;
    }
    if (tab != NULL) {
        *tab = '\0';
    }
    char *payload = malloc(size - length);
    memcpy(payload, newline + 1,
           size - length - 1U); // Exactly this length: the sanitizer finds a byte that is read after it.
    command.verb = verb;
    command.payload = payload;
    command.length = size - length - 1U;
    judge_command(&rules, &command, memchr(first, '#', flags) != NULL);
    free(payload);
}

static void read_file(const uint8_t *data, size_t size) {
    static char folder[64];
    static char path[80];
    mqtt_spool_t spool;
    mqtt_spool_event_t event;
    uint64_t number = 0;
    if (folder[0] == '\0') {
        (void)snprintf(folder, sizeof folder, "%s/iwheel-fuzz-XXXXXX",
                       (access("/dev/shm", W_OK) == 0) ? "/dev/shm" : "/tmp");
        fuzz_require(mkdtemp(folder) != NULL, "a folder");
        (void)snprintf(path, sizeof path, "%s/" MQTT_SPOOL_FILE, folder);
    }
    const int file = open(path, O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
    fuzz_require(file >= 0 && write(file, data, size) == (ssize_t)size, "a file");
    (void)close(file);
    fuzz_require(mqtt_spool_open(&spool, folder, 0), "it opens with any content");
    size_t found = 0;
    for (; mqtt_spool_after(&spool, number, &event); number = event.number) {
        fuzz_require(event.number > number && strlen(event.name) + event.length < MQTT_SPOOL_EVENT_MAX, "an event");
        found++;
    }
    fuzz_require(found == spool.waiting, "as many as it reports");
    fuzz_position((found > 0U) ? "accepted" : "refused");
    fuzz_require(mqtt_spool_add(&spool, "stop", "{}", 2, 0), "it goes on");
    fuzz_require(mqtt_spool_after(&spool, number, &event) && strcmp(event.name, "stop") == 0, "in order");
    const uint64_t added = event.number;
    mqtt_spool_confirm(&spool, added - 1U);
    fuzz_require(spool.waiting == 1U && mqtt_spool_after(&spool, 0, &event) && event.number == added,
                 "a confirmed event is removed");
    (void)mqtt_spool_close(&spool);
    (void)unlink(path);
}

/// Uses the same bytes as an event of the stream, and as the reply to each request of the console.
static void show(const uint8_t *data, size_t size) {
    static const history_config_t config = {.since_us = 1, .until_us = INT64_MAX, .all = true};
    static history_t history;
    static fetch_t fetch;
    char *text = NULL;
    size_t length = 0;
    const char *verb = "";
    char asked[512];
    char *payload = malloc(size + 1U);
    memcpy(payload, data, size);
    payload[size] = '\0'; // The libraries add this NUL.
    FILE *out = open_memstream(&text, &length);
    fuzz_require(out != NULL && history_open(&history, &config, out), "memory");
    (void)history_take(&history, "iwheel/w1/event/stop", payload, size, 1000000);
    (void)history_take(&history, "iwheel/w1/event/fault", payload, size, 2000000);
    (void)fclose(out);
    fuzz_require(history.printed + history.doubled + history.garbled == 2U && strchr(text, '\033') == NULL,
                 "each once");
    history_close(&history);
    free(text);
    fetch_begin(&fetch, "w1", "me", 60000000U, NOW_US);
    fuzz_require(fetch_step(&fetch, NOW_US, &verb, asked), "it asks");
    fetch.asked = FETCH_COMMAND;
    (void)fetch_take(&fetch, "reply/me", payload, size, NOW_US);
    for (size_t i = 0; i < fetch.count; i++) {
        fuzz_require(strncmp(fetch.list[i].name, "stop-", 5) == 0 && strpbrk(fetch.list[i].name, "/.") == NULL,
                     "a name");
    }
    free(payload);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    judge(data, size);
    if (size > 0U && data[0] == '{') {
        show(data, size);
    }
    if (is_spool(data, size)) {
        read_file(data, size);
    }
    return 0;
}
