// SPDX-License-Identifier: MIT
/// Configuration of the MQTT bridge: share/mqtt.conf.
#ifndef MQTT_SETTINGS_H
#define MQTT_SETTINGS_H

#include "config/settings.h"

/// Default file without `-c FILE`. It may be absent.
#define MQTT_SETTINGS_PATH  "/etc/iwheel/mqtt.conf"
#define FLEET_SETTINGS_PATH "/etc/iwheel/fleet.conf"
/// Size of the id of a machine with its terminator.
#define MQTT_ID_SIZE   33U
#define MQTT_HOST_SIZE 256U
/// Values of `protocol`: 3.1.1, which every broker supports, or 5.
#define MQTT_PROTOCOL_3 3U
#define MQTT_PROTOCOL_5 5U

typedef struct {
    struct {
        char socket[108];
    } gateway;
    struct {
        char id[MQTT_ID_SIZE]; ///< Id of the machine in topics; none: not set.
    } machine;
    struct {
        char host[MQTT_HOST_SIZE]; ///< One or more hosts, separated by blanks.
        uint32_t port;
        uint8_t protocol;     ///< MQTT_PROTOCOL_3 or MQTT_PROTOCOL_5.
        uint32_t stream_port; ///< Port of NATS on the same hosts; 0: none.
        uint32_t keepalive_s;
        char process_user[33]; ///< User of the broker process, if it is local and without TLS.
        char credentials[108]; ///< Path of the file; none: no credentials.
        char ca[108];          ///< Path of the file; none: without TLS.
        char certificate[108];
        char key[108];
        bool allow_plain; ///< Permits a broker on another machine without TLS.
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
        uint32_t ttl_ms; ///< Age limit of `arm`, `drive`, `twist` and `reset`; MQTT_TTL_MAX_MS for others.
    } drive;
} mqtt_settings_t;

/// The defaults.
extern const mqtt_settings_t mqtt_settings_standard;

extern const settings_form_t mqtt_settings_form;

/// Writes the broker host with this number, from 0 on. Returns false if there are no more.
bool mqtt_settings_host(const mqtt_settings_t *settings, size_t number, char out[MQTT_HOST_SIZE]);

/// Returns true for a host that names this machine: a loopback address, `localhost`, or the path of a unix socket.
bool mqtt_settings_is_local(const char *host);

/// Returns true if the owner of the process of a local broker without TLS is checked: it gets a password, or its
/// commands drive.
bool mqtt_settings_guarded(const mqtt_settings_t *settings);

/// Returns false for the text `none`.
bool mqtt_settings_given(const char *text);

/// Returns true for a name in a topic: 1 to 32 letters, digits, `_` or `-`. Such a name is also valid in a subject of
/// NATS.
bool mqtt_settings_is_name(const char *text);

#endif
