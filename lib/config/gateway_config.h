// SPDX-License-Identifier: MIT
/// Configuration file of the gateway: reads it, checks it as a whole, and prints it.
///
/// Link `iwheel_gateway_config` (lib/config) and include "config/gateway_config.h".
///
/// A file with an error changes nothing: every error is reported with file, line and fix (the first 20 of them), and
/// the caller's structure is unchanged. A missing key has its default. Use it at the start only: it reads a file and
/// writes to a stream, so it may block. It uses no heap and no file-scope state.
#ifndef GATEWAY_CONFIG_H
#define GATEWAY_CONFIG_H

#include "iwheel/config.h"

#include <stdio.h>

/// Default file. It is read without `-c FILE`; if it is absent, the gateway uses the defaults.
#define GATEWAY_CONFIG_PATH "/etc/iwheel/gateway.conf"
/// Largest size of a file.
#define GATEWAY_CONFIG_FILE_MAX 65536U
/// Result of `gateway_config_load` on any error: EX_CONFIG of sysexits.
#define GATEWAY_CONFIG_ERROR 78

/// Size of a path of a unix socket, with its terminator.
#define GATEWAY_PATH_SIZE 108U
/// Size of `unix:` and such a path.
#define GATEWAY_ADDRESS_SIZE 113U

typedef enum { GATEWAY_MISMATCH_REFUSE = 0, GATEWAY_MISMATCH_WARN } gateway_mismatch_t;

/// Texts are terminated, not empty, printable, and within the lengths below.
typedef struct gateway_config {
    iw_config_t
        core; ///< [wheels] [left] [right] [drive] [limits]. `listen_only` is not a key; the command line sets it.
    struct {
        char interface[GATEWAY_ADDRESS_SIZE]; ///< SocketCAN interface (1..15 characters) or `unix:PATH`.
        uint32_t bitrate;                     ///< Expected bit rate in bit/s, 10000..1000000.
        uint16_t sample_point_permille;       ///< Expected sample point, 500..900.
        gateway_mismatch_t on_mismatch;       ///< Whether a contradicted timing refuses arm or only causes a warning.
    } bus;
    struct {
        char line[GATEWAY_ADDRESS_SIZE];  ///< gpiod line name, `gpiochipN:OFFSET`, `unix:PATH` (SIMULATED) or `none`.
        bool active_high;                 ///< Pressed, or a cut wire, reads high.
        uint16_t debounce_ms;             ///< Debounce of a release, 0..1000.
        char chip[32];                    ///< Label of the line's chip from bringup; `any` accepts all.
        char chip_line[32];               ///< Name of the line from bringup; `any` accepts all.
        char line2[GATEWAY_ADDRESS_SIZE]; ///< Second contact of the button, like `line`; `none` if there is none.
        bool active2_high;                ///< `active_high` of the second contact.
        char chip2[32];                   ///< `chip` of the second contact.
        char chip2_line[32];              ///< `chip_line` of the second contact.
        uint16_t discrepancy_ms;          ///< Longest difference of the contacts, 50..1000, more than `debounce_ms`.
    } estop;
    struct {
        char socket[GATEWAY_PATH_SIZE]; ///< Path of the socket for clients that may drive.
        uint16_t mode;                  ///< Permission bits of the socket; always with read and write of the owner.
        char group[33];                 ///< Group of the socket; `none`: the group of the gateway.
        uint16_t max_clients;           ///< Clients, 1..64.
        char watch_socket[GATEWAY_PATH_SIZE]; ///< Socket for clients that may not drive; `none` if there is none.
        uint16_t watch_mode;                  ///< Like `mode`, for the watch socket.
        char watch_group[33];                 ///< Like `group`, for the watch socket.
        uint16_t max_watchers;                ///< Watchers, 1..64, in addition to max_clients.
        uint16_t max_age_ms; ///< Largest age in ms of `t_us` in arm, reset, release and confirm, 200..2000.
    } northbound;
    struct {
        bool has_battery;               ///< A battery threshold is configured; it has no default.
        bool has_temperature;           ///< A temperature threshold is configured; it has no default.
        uint16_t battery_low_dV;        ///< 10..254; 0 without a threshold.
        uint16_t temperature_high_degC; ///< 20..200; 0 without a threshold.
    } health;                           ///< [limits]
    struct {
        uint16_t blackbox_s;               ///< Length of the ring in memory, 0 (none)..600.
        char directory[GATEWAY_PATH_SIZE]; ///< Directory of the recordings.
        uint16_t keep_stops;               ///< Recordings of stops that are stored on disk, 8..256.
    } record;
} gateway_config_t;

/// Writes the documented defaults. Setpoint type, current role and track are not set: arm is refused until they are
/// configured.
void gateway_config_default(gateway_config_t *out_config);

/// Reads the file at `path` over the defaults. Returns 0, or GATEWAY_CONFIG_ERROR; then `*out_config` is unchanged and
/// `err` has lines of the form `FILE:LINE: what is wrong; what to do`.
int gateway_config_load(const char *path, gateway_config_t *out_config, FILE *err);

/// Does the same for a text in memory of `size` bytes. `name` replaces the file name in messages.
int gateway_config_parse(const char *name, const char *text, size_t size, gateway_config_t *out_config, FILE *err);

/// Changes one key after loading, by the same rules, for the command line. `name` is "SECTION.KEY". Messages begin with
/// `origin` (for example "--estop"). Returns like `gateway_config_load`.
int gateway_config_override(gateway_config_t *config, const char *name, const char *value, const char *origin,
                            FILE *err);

/// Returns a line to write above a key in addition to its help, or NULL.
typedef const char *(*gateway_config_note_t)(const void *context, const char *section, const char *key);

/// Does the same as `gateway_config_print`, with notes.
void gateway_config_print_noted(const gateway_config_t *config, gateway_config_note_t note, const void *context,
                                FILE *out);

/// Writes the whole configuration as a commented file. Loading that file results in the same configuration, and
/// printing it again in the same bytes (except `listen_only`, which is printed as a comment).
void gateway_config_print(const gateway_config_t *config, FILE *out);

#endif
