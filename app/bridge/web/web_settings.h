// SPDX-License-Identifier: MIT
/// What may be configured of the web bridge: share/web.conf.
#ifndef WEB_SETTINGS_H
#define WEB_SETTINGS_H

#include "config/settings.h"

/// Read when no `-c FILE` is given. Its absence is no error then.
#define WEB_SETTINGS_PATH "/etc/iwheel/web.conf"

typedef struct {
    struct {
        char socket[108];
        uint32_t rate_hz; ///< Of the event `state`, 1..100.
    } gateway;
    struct {
        char listen[108]; ///< An address, or `unix:PATH`.
        uint32_t port;
        char hosts
            [201]; ///< Names beside `listen` and localhost by which the page may be called, separated by blanks; none.
        char token_file[108];
        uint32_t token_hours; ///< 0: no end.
        uint32_t max_connections;
        char page[108];        ///< Folder of the page's files.
        char certificate[108]; ///< none: without TLS.
        char key[108];
    } web;
    struct {
        char source[108];       ///< What iwheel-fleet writes; none: there is no page of a fleet.
        char machine_page[128]; ///< Address of a machine's own page, with `{machine}` for its name; none.
    } fleet;
    struct {
        bool enabled;
        bool allow_reset;
        uint32_t max_speed_mm_s;
        uint32_t ttl_ms; ///< Older drive commands are dropped.
    } drive;
} web_settings_t;

/// The defaults.
extern const web_settings_t web_settings_standard;

extern const settings_form_t web_settings_form;

/// True if `listen` is a unix socket; then its path is behind `unix:`.
bool web_settings_is_unix(const web_settings_t *settings);

bool web_settings_has_tls(const web_settings_t *settings);

bool web_settings_has_fleet(const web_settings_t *settings);

/// Empty if there is none.
const char *web_settings_machine_page(const web_settings_t *settings);

/// Empty if there are none.
const char *web_settings_hosts(const web_settings_t *settings);

#endif
