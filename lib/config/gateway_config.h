// SPDX-License-Identifier: MIT
/// The gateway's configuration file: read, checked as a whole, printed back.
///
/// Link `iwheel_gateway_config` (lib/config) and include "config/gateway_config.h".
///
/// A file that is wrong anywhere changes nothing: every error is told with file, line and cure (the first 20 of them), and
/// the caller's structure is left alone. A key that is not given has its default. Used at start only: it reads a file and
/// writes to a stream, so it may block. No heap, no file-scope state.
#ifndef GATEWAY_CONFIG_H
#define GATEWAY_CONFIG_H

#include "iwheel/config.h"

#include <stdio.h>

/// Read when no `-c FILE` is given. Its absence is no error then: the caller goes on with the defaults.
#define GATEWAY_CONFIG_PATH "/etc/iwheel/gateway.conf"
/// A longer file is refused.
#define GATEWAY_CONFIG_FILE_MAX 65536U
/// What `gateway_config_load` returns on any error: EX_CONFIG of sysexits.
#define GATEWAY_CONFIG_ERROR 78

/// A path that fits a unix socket address, with its terminator.
#define GATEWAY_PATH_SIZE 108U
/// `unix:` and such a path.
#define GATEWAY_ADDRESS_SIZE 113U

typedef enum { GATEWAY_MISMATCH_REFUSE = 0, GATEWAY_MISMATCH_WARN } gateway_mismatch_t;

/// Texts are terminated, never empty, printable, and within the lengths given here.
typedef struct gateway_config {
    iw_config_t core; ///< [wheels] [left] [right] [drive] [limits]; `listen_only` is no key: the command line sets it.
    struct {
        char interface[GATEWAY_ADDRESS_SIZE]; ///< SocketCAN interface (1..15 characters) or `unix:PATH`.
        uint32_t bitrate;                     ///< Expected of the kernel, bit/s, 10000..1000000.
        uint16_t sample_point_permille;       ///< Expected, 500..900.
        gateway_mismatch_t on_mismatch;       ///< Whether a contradicted timing refuses arm or only warns.
    } bus;
    struct {
        char line[GATEWAY_ADDRESS_SIZE];  ///< gpiod line name, `gpiochipN:OFFSET`, `unix:PATH` (SIMULATED) or `none`.
        bool active_high;                 ///< Pressed, or a cut wire, reads high.
        uint16_t debounce_ms;             ///< On release only, 0..1000.
        char chip[32];                    ///< Label of the line's chip, as seen at bringup; `any`: not compared.
        char chip_line[32];               ///< The line's own name, as seen at bringup; `any`: not compared.
        char line2[GATEWAY_ADDRESS_SIZE]; ///< The button's second contact, as `line`; `none`: it has one.
        bool active2_high;                ///< As `active_high`.
        char chip2[32];                   ///< As `chip`.
        char chip2_line[32];              ///< As `chip_line`.
        uint16_t discrepancy_ms;          ///< The contacts may differ for so long, 50..1000; more than `debounce_ms`.
    } estop;
    struct {
        char socket[GATEWAY_PATH_SIZE];
        uint16_t mode;        ///< Permission bits of the socket; the owner's read and write are always among them.
        char group[33];       ///< Owner group of the socket; `none`: the gateway's own.
        uint16_t max_clients; ///< 1..64.
        char watch_socket[GATEWAY_PATH_SIZE]; ///< For clients that may not drive; `none`: there is none.
        uint16_t watch_mode;
        char watch_group[33];
        uint16_t max_watchers; ///< 1..64, beside max_clients.
        uint16_t max_age_ms;   ///< The oldest `t_us` of arm, reset and confirm, 200..2000.
    } northbound;
    struct {
        bool has_battery;               ///< There is a threshold; there is no default.
        bool has_temperature;           ///< The same.
        uint16_t battery_low_dV;        ///< 10..254; 0 without a threshold.
        uint16_t temperature_high_degC; ///< 20..200; the same.
    } health;                           ///< [limits]
    struct {
        uint16_t blackbox_s; ///< Length of the ring in memory, 0 (none) ..600.
        char directory[GATEWAY_PATH_SIZE];
        uint16_t keep_stops; ///< 8..GW_BOX_KEEP_MAX.
    } record;
} gateway_config_t;

/// The documented defaults. Setpoint type and current role are unset: arm is refused until they are configured.
void gateway_config_default(gateway_config_t *out_config);

/// Reads the file at `path` over the defaults. 0, or GATEWAY_CONFIG_ERROR with `*out_config` untouched and lines of the form
/// `FILE:LINE: what is wrong; what to do` on `err`.
int gateway_config_load(const char *path, gateway_config_t *out_config, FILE *err);

/// The same for a text in memory of `size` bytes; `name` stands for the file in messages.
int gateway_config_parse(const char *name, const char *text, size_t size, gateway_config_t *out_config, FILE *err);

/// One key changed after loading, by the same rules, as the command line does. `name` is "SECTION.KEY"; `origin` (for example
/// "--estop") begins the message. Returns as `gateway_config_load`.
int gateway_config_override(gateway_config_t *config, const char *name, const char *value, const char *origin,
                            FILE *err);

/// What is to be written above a key besides its help, in one line; null: nothing.
typedef const char *(*gateway_config_note_t)(const void *context, const char *section, const char *key);

/// As `gateway_config_print`, with notes.
void gateway_config_print_noted(const gateway_config_t *config, gateway_config_note_t note, const void *context,
                                FILE *out);

/// Writes everything in force as a commented file. Loading that file gives the same configuration and prints the same bytes
/// (`listen_only` excepted, which is printed as a comment).
void gateway_config_print(const gateway_config_t *config, FILE *out);

#endif
