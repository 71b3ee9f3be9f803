// SPDX-License-Identifier: MIT
#include "web_judge.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/// Bytes of a body that a stop may have.
#define STOP_BODY_MAX 4096

#define JSON "application/json"
#define TEXT "text/plain; charset=utf-8"
#define JS   "text/javascript; charset=utf-8"

static const web_route_t routes[] = {
    {"GET", "/", WEB_FILE, "index.html", "text/html; charset=utf-8"},
    {"GET", "/page.css", WEB_FILE, "page.css", "text/css; charset=utf-8"},
    {"GET", "/strings.js", WEB_FILE, "strings.js", JS},
    {"GET", "/proof.js", WEB_FILE, "proof.js", JS},
    {"GET", "/plots.js", WEB_FILE, "plots.js", JS},
    {"GET", "/recordings.js", WEB_FILE, "recordings.js", JS},
    {"GET", "/mcap.js", WEB_FILE, "mcap.js", JS},
    {"GET", "/link.js", WEB_FILE, "link.js", JS},
    {"GET", "/state.js", WEB_FILE, "state.js", JS},
    {"GET", "/stop.js", WEB_FILE, "stop.js", JS},
    {"GET", "/drive.js", WEB_FILE, "drive.js", JS},
    {"GET", "/player.js", WEB_FILE, "player.js", JS},
    {"GET", "/page.js", WEB_FILE, "page.js", JS},
    {"GET", "/fleet", WEB_FILE, "fleet.html", "text/html; charset=utf-8"},
    {"GET", "/fleet.js", WEB_FILE, "fleet.js", JS},
    {"GET", "/manifest.webmanifest", WEB_FILE, "manifest.webmanifest", "application/manifest+json"},
    {"GET", "/icon.svg", WEB_FILE, "icon.svg", "image/svg+xml"},
    {"GET", "/uPlot.iife.min.js", WEB_FILE, "uPlot.iife.min.js", JS},
    {"GET", "/uPlot.min.css", WEB_FILE, "uPlot.min.css", "text/css; charset=utf-8"},
    {"GET", "/uPlot.LICENSE", WEB_FILE, "uPlot.LICENSE", TEXT},
    {"GET", "/api/challenge", WEB_CHALLENGE, NULL, JSON},
    {"GET", "/api/status", WEB_STATUS, NULL, JSON},
    {"GET", "/api/events", WEB_EVENTS, NULL, "text/event-stream"},
    {"GET", "/api/stops", WEB_STOPS, NULL, JSON},
    {"GET", "/api/recordings", WEB_RECORDINGS, NULL, JSON},
    {"GET", "/api/recording", WEB_RECORDING, NULL, JSON},
    {"POST", "/api/record", WEB_RECORD, NULL, JSON},
    {"GET", "/api/fleet", WEB_FLEET, NULL, JSON},
    {"GET", "/metrics", WEB_METRICS, NULL, "application/openmetrics-text; version=1.0.0; charset=utf-8"},
    {"GET", "/health", WEB_HEALTH, NULL, JSON},
    {"POST", "/api/stop", WEB_STOP, NULL, JSON},
    {"POST", "/api/estop", WEB_ESTOP, NULL, JSON},
    {"POST", "/api/arm", WEB_ARM, NULL, JSON},
    {"POST", "/api/drive", WEB_DRIVE, NULL, JSON},
    {"POST", "/api/reset", WEB_RESET, NULL, JSON},
    {NULL, NULL, WEB_FILE, NULL, NULL},
};

const web_route_t *web_routes(void) {
    return routes;
}

bool web_number(const char *text, int64_t min, int64_t max, int64_t *out_value) {
    char *end = NULL;
    const size_t sign = (text != NULL && text[0] == '-') ? 1U : 0U;
    if (text == NULL || isdigit((unsigned char)text[sign]) == 0) {
        return false;
    }
    errno = 0;
    const long long value = strtoll(text, &end, 10);
    if (*end != '\0' || errno != 0 || value < min || value > max) {
        return false;
    }
    *out_value = value;
    return true;
}

bool web_recording_name(const char *text) {
    static const char *const endings[] = {".log", ".jsonl", ".conf"};
    const size_t stem = (text != NULL) ? strcspn(text, ".") : 0U;
    if (stem == 0U || strlen(text) >= WEB_NAME_SIZE) {
        return false;
    }
    for (size_t i = 0; i < stem; i++) {
        if (isalnum((unsigned char)text[i]) == 0 && text[i] != '-' && text[i] != '_') {
            return false;
        }
    }
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        if (strcmp(text + stem, endings[i]) == 0) {
            return true;
        }
    }
    return false;
}

/// Returns the length of the host in `host[:port]`.
static size_t host_length(const char *host) {
    const char *bracket = (host[0] == '[') ? strchr(host, ']') : NULL;
    return (bracket != NULL) ? (size_t)(bracket - host) + 1U : strcspn(host, ":");
}

/// Returns true for an address. A name server cannot redirect an address, so the request is for this machine.
static bool is_address(const char *host, size_t length) {
    char text[INET6_ADDRSTRLEN];
    struct in6_addr address;
    const bool v6 = length > 2U && host[0] == '[';
    const size_t inner = v6 ? length - 2U : length;
    if (inner >= sizeof text) {
        return false;
    }
    memcpy(text, host + (v6 ? 1 : 0), inner);
    text[inner] = '\0';
    return inet_pton(v6 ? AF_INET6 : AF_INET, text, &address) == 1;
}

static bool is_listed(const char *list, const char *host, size_t length) {
    while (*(list += strspn(list, " ")) != '\0') {
        const size_t word = strcspn(list, " ");
        if (word == length && strncasecmp(list, host, length) == 0) {
            return true;
        }
        list += word;
    }
    return false;
}

static bool is_our_name(const web_rules_t *rules, const char *host) {
    const size_t length = (host != NULL) ? host_length(host) : 0U;
    const char *port = (host != NULL) ? host + length : "";
    int64_t number = 0;
    if (length == 0U || (port[0] != '\0' && (port[0] != ':' || !web_number(port + 1, 1, 65535, &number)))) {
        return false;
    }
    return is_address(host, length) || is_listed("localhost", host, length) || is_listed(rules->hosts, host, length);
}

/// Returns true unless the browser reports that another site sends the request.
static bool is_our_page(const web_asked_t *asked) {
    const char *origin = asked->origin;
    if (asked->site != NULL && strcmp(asked->site, "same-origin") != 0 && strcmp(asked->site, "none") != 0) {
        return false;
    }
    if (origin == NULL) {
        return true;
    }
    const size_t scheme = (strncmp(origin, "https://", 8) == 0) ? 8U : (strncmp(origin, "http://", 7) == 0) ? 7U : 0U;
    return scheme > 0U && strcasecmp(origin + scheme, asked->host) == 0;
}

/// STOP needs no proof: any person who sees the page may stop.
static bool has_proof(const web_route_t *route, const web_asked_t *asked) {
    if (route != NULL && (route->verb == WEB_FILE || route->verb == WEB_CHALLENGE || route->verb == WEB_STOP)) {
        return true;
    }
    return asked->proof == WEB_PROOF_FULL || (asked->proof == WEB_PROOF_READ && strcmp(asked->method, "GET") == 0);
}

static const web_route_t *find_route(const web_asked_t *asked, bool *out_other_method) {
    *out_other_method = false;
    for (const web_route_t *route = routes; route->path != NULL; route++) {
        if (strcmp(route->path, asked->path) != 0) {
            continue;
        }
        if (strcmp(route->method, asked->method) == 0) {
            return route;
        }
        *out_other_method = true;
    }
    return NULL;
}

static web_verdict_t refuse(unsigned status, const char *error, const char *message) {
    return (web_verdict_t){status, error, message, NULL};
}

/// Many programs send `{}` with each POST: a short body does not prevent a stop. Nothing reads it.
static bool may_have_body(const web_route_t *route, int64_t body) {
    const bool stops = route != NULL && (route->verb == WEB_STOP || route->verb == WEB_ESTOP);
    return body == 0 || (stops && body > 0 && body <= STOP_BODY_MAX);
}

/// A link from another site to the page is allowed, like any link; it reveals nothing.
static bool is_navigation(const web_route_t *route, const web_asked_t *asked) {
    return route != NULL && strcmp(route->path, "/") == 0 && asked->origin == NULL;
}

web_verdict_t web_judge(const web_rules_t *rules, const web_asked_t *asked) {
    bool other_method = false;
    const web_route_t *route = find_route(asked, &other_method);
    if (!is_our_name(rules, asked->host)) {
        return refuse(421, "bad_host",
                      "this is not a name of this machine: use its address, or list the name under hosts");
    }
    if (!is_our_page(asked) && !is_navigation(route, asked)) {
        return refuse(403, "bad_origin",
                      "the request comes from the page of another site; open the page of this bridge");
    }
    if (asked->is_doubled) {
        return refuse(400, "bad_header",
                      "Host, Content-Length, Transfer-Encoding or Authorization is sent twice, or a name has a blank; "
                      "send each once");
    }
    if (!may_have_body(route, asked->body)) {
        return refuse(413, "no_body", "requests have no body here: the address has all fields");
    }
    if (!has_proof(route, asked)) {
        return (asked->proof == WEB_PROOF_OVER)
                   ? refuse(401, "bad_session", "the session is not known; begin another one: GET /api/challenge")
                   : refuse(401, "bad_token",
                            "no valid proof of the token; open the address that `iwheelctl web` prints. Programs: see "
                            "docs/user/web.md");
    }
    if (route == NULL) {
        return other_method ? refuse(405, "bad_method", "this address needs another method: see docs/user/web.md")
                            : refuse(404, "not_there", "this address does not exist: see docs/user/web.md");
    }
    if ((route->verb == WEB_ARM || route->verb == WEB_DRIVE) && !rules->may_drive) {
        return refuse(403, "denied", "driving is not configured: set enabled = yes under [drive] in web.conf");
    }
    if (route->verb == WEB_RESET && !rules->may_reset) {
        return refuse(403, "denied",
                      "reset is not configured: set enabled and allow_reset = yes under [drive] in web.conf");
    }
    return (web_verdict_t){200, "", "", route};
}
