// SPDX-License-Identifier: MIT
#include "mqtt_settings.h"

#include "mqtt_command.h"

#include "mqtt_keys.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <string.h>

#define FIELD(member)             SETTINGS_FIELD(mqtt_settings_t, member)
#define NUMBER(member, low, high) .kind = SETTINGS_NUMBER, .min = (low), .max = (high), FIELD(member)
#define SWITCH(member)            .kind = SETTINGS_WORD, .words = settings_no_yes, FIELD(member)
#define TEXT(member)              .kind = SETTINGS_TEXT, FIELD(member)

static const settings_word_t protocols[] = {{"3.1.1", MQTT_PROTOCOL_3}, {"5", MQTT_PROTOCOL_5}, {NULL, 0}};

bool mqtt_settings_is_name(const char *text) {
    const size_t length = strlen(text);
    for (size_t i = 0; i < length; i++) {
        if (!isalnum((unsigned char)text[i]) && text[i] != '_' && text[i] != '-') {
            return false;
        }
    }
    return length > 0U && length < MQTT_ID_SIZE;
}

static const char *wrong_name(const char *text) {
    return mqtt_settings_is_name(text) ? NULL
                                       : "is not a valid name in topics; use letters, digits, _ and -, 32 at most";
}

static const settings_key_t keys[] = {
    {"gateway", "socket", "", TEXT(gateway.socket), .wrong = settings_wrong_socket},
    {"machine", "id", "", TEXT(machine.id), .wrong = wrong_name},
    {"broker", "host", "", TEXT(broker.host)},
    {"broker", "port", "", NUMBER(broker.port, 1, 65535)},
    {"broker", "protocol", "", .kind = SETTINGS_WORD, .words = protocols, FIELD(broker.protocol)},
    {"broker", "stream_port", "", NUMBER(broker.stream_port, 0, 65535)},
    {"broker", "keepalive_s", " s", NUMBER(broker.keepalive_s, 5, 3600)},
    {"broker", "process_user", "", TEXT(broker.process_user)},
    {"broker", "credentials", "", TEXT(broker.credentials)},
    {"broker", "ca", "", TEXT(broker.ca)},
    {"broker", "certificate", "", TEXT(broker.certificate)},
    {"broker", "key", "", TEXT(broker.key)},
    {"broker", "allow_plain", "", SWITCH(broker.allow_plain)},
    {"state", "every_ms", " ms", NUMBER(state.every_ms, 100, 3600000)},
    {"spool", "directory", "", TEXT(spool.directory)},
    {"spool", "max_kB", " kB", NUMBER(spool.max_kB, 64, 65536)},
    {"home_assistant", "enabled", "", SWITCH(home_assistant.enabled)},
    {"home_assistant", "prefix", "", TEXT(home_assistant.prefix), .wrong = wrong_name},
    {"drive", "enabled", "", SWITCH(drive.enabled)},
    {"drive", "allow_reset", "", SWITCH(drive.allow_reset)},
    {"drive", "ttl_ms", " ms", NUMBER(drive.ttl_ms, 50, MQTT_TTL_MAX_MS)},
};

const mqtt_settings_t mqtt_settings_standard = {
    .gateway = {"/run/iwheel/watch/gateway.sock"},
    .machine = {"none"},
    .broker = {.host = "127.0.0.1",
               .port = 1883,
               .protocol = MQTT_PROTOCOL_3,
               .keepalive_s = 10,
               .process_user = "mosquitto",
               .credentials = "none",
               .ca = "none",
               .certificate = "none",
               .key = "none"},
    .state = {5000},
    .spool = {"/var/lib/iwheel-mqtt", 1024},
    .home_assistant = {.prefix = "homeassistant"},
    .drive = {.ttl_ms = 300},
};

bool mqtt_settings_given(const char *text) {
    return strcmp(text, "none") != 0;
}

bool mqtt_settings_host(const mqtt_settings_t *settings, size_t number, char out[MQTT_HOST_SIZE]) {
    const char *at = settings->broker.host + strspn(settings->broker.host, " ");
    for (; number > 0U && *at != '\0'; number--) {
        at += strcspn(at, " ");
        at += strspn(at, " ");
    }
    const size_t length = strcspn(at, " ");
    memcpy(out, at, length);
    out[length] = '\0';
    return length > 0U;
}

bool mqtt_settings_is_local(const char *host) {
    struct in_addr v4;
    struct in6_addr v6;
    return host[0] == '/' || strcmp(host, "localhost") == 0 ||
           (inet_pton(AF_INET, host, &v4) == 1 && ntohl(v4.s_addr) >> 24U == 127U) ||
           (inet_pton(AF_INET6, host, &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6));
}

bool mqtt_settings_guarded(const mqtt_settings_t *settings) {
    return !mqtt_settings_given(settings->broker.ca) &&
           (settings->drive.enabled || mqtt_settings_given(settings->broker.credentials));
}

static bool stays_on_this_machine(const mqtt_settings_t *settings) {
    char host[MQTT_HOST_SIZE];
    bool stays = true;
    for (size_t i = 0; mqtt_settings_host(settings, i, host); i++) {
        stays = stays && mqtt_settings_is_local(host);
    }
    return stays;
}

static unsigned line_of(const char *section, const char *key, const unsigned *lines) {
    return lines[settings_find(&mqtt_settings_form, section, key) - keys];
}

static void relate(settings_report_t *report, const void *values, const unsigned *lines) {
    const mqtt_settings_t *settings = values;
    const bool tls = mqtt_settings_given(settings->broker.ca);
    const bool certificate = mqtt_settings_given(settings->broker.certificate);
    if (certificate != mqtt_settings_given(settings->broker.key)) {
        settings_complain(report, line_of("broker", certificate ? "certificate" : "key", lines),
                          "%s is set without %s; set both files, or none", certificate ? "certificate" : "key",
                          certificate ? "key" : "certificate");
    }
    if (certificate && !tls) {
        settings_complain(report, line_of("broker", "certificate", lines), "certificate needs TLS; also set ca");
    }
    if (!tls && settings->drive.enabled && !stays_on_this_machine(settings)) {
        settings_complain(report, line_of("drive", "enabled", lines),
                          "enabled = yes needs TLS to a broker on another machine; set ca under [broker], or "
                          "enabled = no");
    } else if (!tls && !settings->broker.allow_plain && !stays_on_this_machine(settings)) {
        settings_complain(report, line_of("broker", "host", lines),
                          "host = %s is another machine, and without TLS anybody on the network between them can read "
                          "everything and send commands; set ca, or allow_plain = yes",
                          settings->broker.host);
    }
    if (settings->drive.allow_reset && !settings->drive.enabled) {
        settings_complain(report, line_of("drive", "allow_reset", lines),
                          "allow_reset = yes needs the right to drive; set enabled = yes, or allow_reset = no");
    }
}

const settings_form_t mqtt_settings_form = {
    .keys = keys,
    .help = mqtt_keys,
    .count = sizeof keys / sizeof keys[0],
    .program = "iwheel-mqtt",
    .missing = "create it from share/mqtt.conf",
    .relate = relate,
};
