// SPDX-License-Identifier: MIT
// Any bytes as a command by MQTT and as a spool's file. What is taken is this run's, in time, once, and one line for the gateway; what is
// read of a file is whole.
#include "fuzz.h"

#include "command.h"
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

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    judge(data, size);
    if (size >= 8U && memcmp(data, "iwspool1", 8) == 0) {
        read_file(data, size);
    }
    return 0;
}
