// SPDX-License-Identifier: MIT
#include "web_settings.h"

#include "web_keys.h"

#include <arpa/inet.h>
#include <string.h>

#ifndef IWHEEL_WEB_PAGE_DIR
#define IWHEEL_WEB_PAGE_DIR "/usr/share/iwheel-web"
#endif

#define FIELD(member)             SETTINGS_FIELD(web_settings_t, member)
#define NUMBER(member, low, high) .kind = SETTINGS_NUMBER, .min = (low), .max = (high), FIELD(member)
#define SWITCH(member)            .kind = SETTINGS_WORD, .words = settings_no_yes, FIELD(member)
#define TEXT(member)              .kind = SETTINGS_TEXT, FIELD(member)

static const char *wrong_listen(const char *text) {
    struct in6_addr address;
    if (strncmp(text, "unix:", 5) == 0) {
        return settings_wrong_address(text);
    }
    const bool good = inet_pton(AF_INET, text, &address) == 1 || inet_pton(AF_INET6, text, &address) == 1;
    return good ? NULL : "is not an address; write one, such as 127.0.0.1, or unix:PATH";
}

/// Returns why a text is not valid. It becomes part of JSON and of a link, so it must be an address of https or http
/// without characters that need an escape.
static const char *wrong_page(const char *text) {
    static const char permitted[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789:/._-{}[]";
    const bool is_address = strncmp(text, "https://", 8) == 0 || strncmp(text, "http://", 7) == 0;
    const bool good = strcmp(text, "none") == 0 || (is_address && text[strspn(text, permitted)] == '\0');
    return good ? NULL : "is not the address of a page; write one, such as https://{machine}.local:8470/, or none";
}

static const settings_key_t keys[] = {
    {"gateway", "socket", "", TEXT(gateway.socket), .wrong = settings_wrong_socket},
    {"gateway", "rate_hz", " Hz", NUMBER(gateway.rate_hz, 1, 100)},
    {"web", "listen", "", TEXT(web.listen), .wrong = wrong_listen},
    {"web", "port", "", NUMBER(web.port, 1, 65535)},
    {"web", "hosts", "", TEXT(web.hosts)},
    {"web", "token_file", "", TEXT(web.token_file)},
    {"web", "token_hours", " h", NUMBER(web.token_hours, 0, 8760)},
    {"web", "max_connections", "", NUMBER(web.max_connections, 8, 700)},
    {"web", "page", "", TEXT(web.page)},
    {"web", "certificate", "", TEXT(web.certificate)},
    {"web", "key", "", TEXT(web.key)},
    {"fleet", "source", "", TEXT(fleet.source)},
    {"fleet", "machine_page", "", TEXT(fleet.machine_page), .wrong = wrong_page},
    {"drive", "enabled", "", SWITCH(drive.enabled)},
    {"drive", "allow_reset", "", SWITCH(drive.allow_reset)},
    {"drive", "max_speed_mm_s", " mm/s", NUMBER(drive.max_speed_mm_s, 10, 2000)},
    {"drive", "ttl_ms", " ms", NUMBER(drive.ttl_ms, 50, 1000)},
};

const web_settings_t web_settings_standard = {
    .gateway = {"/run/iwheel/watch/gateway.sock", 20},
    .web = {.listen = "127.0.0.1",
            .port = 8470,
            .hosts = "none",
            .token_file = "/var/lib/iwheel-web/token",
            .max_connections = 128,
            .page = IWHEEL_WEB_PAGE_DIR,
            .certificate = "none",
            .key = "none"},
    .fleet = {"none", "none"},
    .drive = {.max_speed_mm_s = 300, .ttl_ms = 300},
};

bool web_settings_is_unix(const web_settings_t *settings) {
    return strncmp(settings->web.listen, "unix:", 5) == 0;
}

static bool is_given(const char *text) {
    return strcmp(text, "none") != 0;
}

bool web_settings_has_tls(const web_settings_t *settings) {
    return is_given(settings->web.certificate);
}

bool web_settings_has_fleet(const web_settings_t *settings) {
    return is_given(settings->fleet.source);
}

const char *web_settings_machine_page(const web_settings_t *settings) {
    return is_given(settings->fleet.machine_page) ? settings->fleet.machine_page : "";
}

const char *web_settings_hosts(const web_settings_t *settings) {
    return is_given(settings->web.hosts) ? settings->web.hosts : "";
}

static bool stays_on_this_machine(const web_settings_t *settings) {
    const char *listen = settings->web.listen;
    return web_settings_is_unix(settings) || strncmp(listen, "127.", 4) == 0 || strcmp(listen, "::1") == 0;
}

static unsigned line_of(const char *key, const unsigned *lines) {
    return lines[settings_find(&web_settings_form, NULL, key) - keys];
}

static void relate(settings_report_t *report, const void *values, const unsigned *lines) {
    const web_settings_t *settings = values;
    const bool certificate = web_settings_has_tls(settings);
    if (certificate != is_given(settings->web.key)) {
        settings_complain(report, line_of(certificate ? "certificate" : "key", lines),
                          "%s is set without %s; set both files, or none", certificate ? "certificate" : "key",
                          certificate ? "key" : "certificate");
    }
    if (!certificate && !stays_on_this_machine(settings)) {
        settings_complain(
            report, line_of("listen", lines),
            "listen = %s can be reached from other machines, and without TLS any device between them can read the "
            "token; set certificate and key, or listen = 127.0.0.1",
            settings->web.listen);
    }
    if (settings->drive.allow_reset && !settings->drive.enabled) {
        settings_complain(report, line_of("allow_reset", lines),
                          "allow_reset = yes needs the right to drive; set enabled = yes, or allow_reset = no");
    }
}

const settings_form_t web_settings_form = {
    .keys = keys,
    .help = web_keys,
    .count = sizeof keys / sizeof keys[0],
    .program = "iwheel-web",
    .missing = "create it from share/web.conf",
    .relate = relate,
};
