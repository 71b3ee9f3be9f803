// SPDX-License-Identifier: MIT
// Any bytes as a command by MQTT, as a spool's file, and as what the console reads. What is taken is this run's, in time, once, and one line for
// the gateway; what is read of a file is whole; what the console shows moves no terminal and names no file of its own choice.
#include "fuzz.h"

#include "command.h"
#include "fetch.h"
#include "history.h"
#include "spool.h"

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#define NOW_US 50000000U

/// The first line is the verb.
static void judge(const uint8_t *data, size_t size) {
    static const mqtt_rules_t rules = {"0123456789abcdef", 300, true, false, "iwheel/w1/reply/"};
    mqtt_judge_t judge = {0};
    mqtt_order_t order;
    char verb[32] = "";
    const uint8_t *newline = memchr(data, '\n', size);
    const size_t length = (newline != NULL) ? (size_t)(newline - data) : 0U;
    if (newline == NULL || length >= sizeof verb) {
        return;
    }
    memcpy(verb, data, length);
    char *payload = malloc(size - length);
    memcpy(payload, newline + 1, size - length - 1U); // Of exactly its length: a byte read behind it is found.
    const mqtt_command_t command = {.verb = verb, .payload = payload, .length = size - length - 1U};
    mqtt_judge(&judge, &rules, &command, NOW_US, &order);
    fuzz_require(judge.counts[order.verdict] == 1U, "counted");
    fuzz_require((order.verdict == MQTT_TAKEN) == (order.request[0] != '\0'), "a request, or a reason");
    fuzz_tell((order.verdict == MQTT_TAKEN) ? "taken" : "refused");
    if (order.verdict == MQTT_TAKEN) {
        fuzz_require(order.from[0] != '\0' && strpbrk(order.from, "/+#\" ") == NULL, "a name");
        fuzz_require(strchr(order.request, '\n') == NULL && strncmp(order.request, "{\"cmd\":\"", 8) == 0, "one line");
        fuzz_require(strncmp(order.request + 8, verb, strlen(verb)) == 0, "of that verb");
        fuzz_require(order.verb != MQTT_RESET, "not configured");
        mqtt_judge(&judge, &rules, &command, NOW_US, &order);
        fuzz_require(order.verb == MQTT_HELLO || order.verdict == MQTT_DOUBLED, "once");
        mqtt_judge(&judge, &rules, &command, NOW_US + 60000000U, &order);
        fuzz_require(order.verb == MQTT_HELLO || order.verdict == MQTT_LATE, "not late");
    }
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
    fuzz_require(mqtt_spool_open(&spool, folder, 0), "opened, whatever is in it");
    size_t found = 0;
    for (; mqtt_spool_after(&spool, number, &event); number = event.number) {
        fuzz_require(event.number > number && strlen(event.name) + event.length < MQTT_SPOOL_EVENT_MAX, "an event");
        found++;
    }
    fuzz_require(found == spool.waiting, "as many as it says");
    fuzz_tell((found > 0U) ? "taken" : "refused");
    fuzz_require(mqtt_spool_add(&spool, "stop", "{}", 2, 0), "it goes on");
    fuzz_require(mqtt_spool_after(&spool, number, &event) && strcmp(event.name, "stop") == 0, "in order");
    (void)mqtt_spool_close(&spool);
    (void)unlink(path);
}

/// The same bytes as an event of the stream, and as the answer to whatever the console asks for.
static void show(const uint8_t *data, size_t size) {
    static const history_wish_t wish = {.since_us = 1, .until_us = INT64_MAX, .all = true};
    static history_t history;
    static fetch_t fetch;
    char *text = NULL;
    size_t length = 0;
    const char *verb = "";
    char asked[512];
    char *payload = malloc(size + 1U);
    memcpy(payload, data, size);
    payload[size] = '\0'; // As the libraries hand it over.
    FILE *out = open_memstream(&text, &length);
    fuzz_require(out != NULL && history_open(&history, &wish, out), "memory");
    (void)history_take(&history, "iwheel/w1/event/stop", payload, size, 1000000);
    (void)history_take(&history, "iwheel/w1/event/fault", payload, size, 2000000);
    (void)fclose(out);
    fuzz_require(history.told + history.doubled + history.garbled == 2U && strchr(text, '\033') == NULL, "each once");
    history_close(&history);
    free(text);
    fetch_begin(&fetch, "w1", "me", 60000000U, NOW_US);
    fuzz_require(fetch_step(&fetch, NOW_US, &verb, asked), "it asks");
    fetch.greets = false;
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
    if (size >= 8U && memcmp(data, "iwspool1", 8) == 0) {
        read_file(data, size);
    }
    return 0;
}
