// SPDX-License-Identifier: MIT
/// Configuration of the web bridge: share/web.conf.
#ifndef WEB_SETTINGS_H
#define WEB_SETTINGS_H

#include "config/settings.h"

/// Default file without `-c FILE`. It may be absent.
#define WEB_SETTINGS_PATH "/etc/iwheel/web.conf"

typedef struct {
    struct {
        char socket[108];
        uint32_t rate_hz; ///< Rate of the event `state`, 1..100.
    } gateway;
    struct {
        char listen[108]; ///< An address, or `unix:PATH`.
        uint32_t port;
        char hosts
            [201]; ///< More names of the page, in addition to `listen` and localhost, separated by blanks; or none.
        char token_file[108];
        uint32_t token_hours; ///< Hours of validity; 0: no end.
        uint32_t max_connections;
        char page[108];        ///< Folder of the files of the page.
        char certificate[108]; ///< Path of the file; none: without TLS.
        char key[108];
    } web;
    struct {
        char source[108];       ///< File of iwheel-fleet; none: no page of a fleet.
        char machine_page[128]; ///< Address of the page of a machine, with `{machine}` for its id; or none.
    } fleet;
    struct {
        bool enabled;
        bool allow_reset;
        uint32_t max_speed_mm_s;
        uint32_t ttl_ms; ///< Largest age of a drive command.
    } drive;
} web_settings_t;

/// Default values.
extern const web_settings_t web_settings_standard;

extern const settings_form_t web_settings_form;

/// Returns true if `listen` is a unix socket; its path follows `unix:`.
bool web_settings_is_unix(const web_settings_t *settings);

bool web_settings_has_tls(const web_settings_t *settings);

bool web_settings_has_fleet(const web_settings_t *settings);

/// Empty if there is none.
const char *web_settings_machine_page(const web_settings_t *settings);

/// Empty if there are none.
const char *web_settings_hosts(const web_settings_t *settings);

#endif
