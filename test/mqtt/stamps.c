// SPDX-License-Identifier: MIT
// Preloaded into iwheel-fleet by scale.py: records the age of each message of a machine after the console has processed it. The gateway's line
// contains `t_us` of this machine's monotonic clock, so the age covers the whole way: line, bridge, broker, console.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <mosquitto.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
    uint64_t at_us;
    uint64_t boot; ///< Boot of the bridge, which identifies the machine.
    uint32_t late_us;
    uint32_t number; ///< Number in the event's id; 0: a state.
    uint32_t bytes;  ///< Bytes of topic and payload.
    uint32_t spare;
} stamp_t;

typedef void (*callback_t)(struct mosquitto *, void *, const struct mosquitto_message *);
typedef void (*callback5_t)(struct mosquitto *, void *, const struct mosquitto_message *, const mosquitto_property *);

static callback_t console_callback;
static callback5_t taken5;
static FILE *file;

static uint64_t number_behind(const struct mosquitto_message *message, const char *name, int base) {
    const char *at = memmem(message->payload, (size_t)message->payloadlen, name, strlen(name));
    return (at != NULL) ? strtoull(at + strlen(name), NULL, base) : 0U; // In JSON a character that is no digit follows.
}

static void note(const struct mosquitto_message *message) {
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    stamp_t stamp = {.at_us = (uint64_t)now.tv_sec * 1000000U + (uint64_t)now.tv_nsec / 1000U,
                     .boot = number_behind(message, "\"boot\":\"", 16),
                     .bytes = (uint32_t)(strlen(message->topic) + (size_t)message->payloadlen)};
    const uint64_t stamp_us = number_behind(message, "\"t_us\":", 10);
    const char *id = memmem(message->payload, (size_t)message->payloadlen, "\"id\":\"", 6);
    if (stamp_us == 0U) {
        return;
    }
    stamp.late_us = (uint32_t)(stamp.at_us - stamp_us);
    stamp.number =
        (id != NULL && strstr(message->topic, "/event/") != NULL) ? (uint32_t)strtoul(id + 6 + 17, NULL, 10) : 0U;
    if (file == NULL) {
        file = fopen(getenv("IWHEEL_STAMPS"), "wb");
    }
    (void)fwrite(&stamp, sizeof stamp, 1, file);
}

static void on_message(struct mosquitto *client, void *context, const struct mosquitto_message *message) {
    console_callback(client, context, message);
    note(message);
}

static void take5(struct mosquitto *client, void *context, const struct mosquitto_message *message,
                  const mosquitto_property *properties) {
    taken5(client, context, message, properties);
    note(message);
}

void mosquitto_message_callback_set(struct mosquitto *client, callback_t callback) {
    void (*set)(struct mosquitto *, callback_t) = (void (*)(struct mosquitto *, callback_t))dlsym(RTLD_NEXT, __func__);
    console_callback = callback;
    set(client, on_message);
}

void mosquitto_message_v5_callback_set(struct mosquitto *client, callback5_t callback) {
    void (*set)(struct mosquitto *, callback5_t) =
        (void (*)(struct mosquitto *, callback5_t))dlsym(RTLD_NEXT, __func__);
    taken5 = callback;
    set(client, take5);
}
