// SPDX-License-Identifier: MIT
/// What may be configured of the MQTT bridge: share/mqtt.conf.
#ifndef MQTT_SETTINGS_H
#define MQTT_SETTINGS_H

#include "config/settings.h"

/// Read when no `-c FILE` is given. Its absence is no error then.
#define MQTT_SETTINGS_PATH  "/etc/iwheel/mqtt.conf"
#define FLEET_SETTINGS_PATH "/etc/iwheel/fleet.conf"
/// Bytes of a machine's id with its terminator.
#define MQTT_ID_SIZE   33U
#define MQTT_HOST_SIZE 256U
/// What `protocol` may be: 3.1.1, which every broker speaks, or 5.
#define MQTT_PROTOCOL_3 3U
#define MQTT_PROTOCOL_5 5U

typedef struct {
    struct {
        char socket[108];
    } gateway;
    struct {
        char id[MQTT_ID_SIZE]; ///< Of the machine in topics; none: not set yet.
    } machine;
    struct {
        char host[MQTT_HOST_SIZE]; ///< One or more, separated by blanks.
        uint32_t port;
        uint8_t protocol;     ///< MQTT_PROTOCOL_3 or MQTT_PROTOCOL_5.
        uint32_t stream_port; ///< Of NATS on the same hosts; 0: none.
        uint32_t keepalive_s;
        char process_user[33]; ///< Of the broker's process, where it is on this machine and without TLS.
        char credentials[108]; ///< A file; none.
        char ca[108];          ///< none: without TLS.
        char certificate[108];
        char key[108];
        bool allow_plain; ///< Without TLS to another machine.
    } broker;
    struct {
        uint32_t every_ms;
    } state;
    struct {
        char directory[108];
        uint32_t max_kB;
    } spool;
    struct {
        bool enabled;
        char prefix[65];
    } home_assistant;
    struct {
        bool enabled;
        bool allow_reset;
        uint32_t ttl_ms; ///< Of `arm`, `drive` and `twist`; of all others it is MQTT_TTL_MAX_MS.
    } drive;
} mqtt_settings_t;

/// The defaults.
extern const mqtt_settings_t mqtt_settings_standard;

extern const settings_form_t mqtt_settings_form;

/// The broker with this number, from 0 on; false: there are no more.
bool mqtt_settings_host(const mqtt_settings_t *settings, size_t number, char out[MQTT_HOST_SIZE]);

/// True of a host that is this machine by what it is written as: a loopback address, `localhost`, or the path of a unix socket.
bool mqtt_settings_is_local(const char *host);

/// True if a broker on this machine without TLS must prove whose process it is: it gets a password, or its commands drive.
bool mqtt_settings_guarded(const mqtt_settings_t *settings);

/// False for a text that says `none`.
bool mqtt_settings_given(const char *text);

/// A name in a topic: 1 to 32 letters, digits, `_` or `-`. So it is one in a subject of NATS too.
bool mqtt_settings_is_name(const char *text);

#endif
