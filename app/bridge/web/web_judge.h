// SPDX-License-Identifier: MIT
/// Judges whether a request may be answered, and finds its route. The bridge itself parses no other input of
/// clients.
///
/// Pure: no socket, no clock, no heap. Texts are terminated; NULL: not sent.
#ifndef WEB_JUDGE_H
#define WEB_JUDGE_H

#include "proof.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Size of a token with its terminator: 128 random bits as hexadecimal digits.
#define WEB_TOKEN_SIZE BRIDGE_SECRET_SIZE
/// Size of the file name of a recording with its terminator.
#define WEB_NAME_SIZE 64U

typedef enum {
    WEB_FILE, ///< A file of the page.
    WEB_CHALLENGE,
    WEB_STATUS,
    WEB_EVENTS,
    WEB_STOPS,
    WEB_RECORDINGS,
    WEB_RECORDING,
    WEB_RECORD,
    WEB_FLEET,
    WEB_METRICS,
    WEB_HEALTH,
    WEB_STOP,
    WEB_ESTOP,
    WEB_ARM,
    WEB_DRIVE,
    WEB_RESET
} web_verb_t;

typedef struct {
    const char *method;
    const char *path;
    web_verb_t verb;
    const char *file; ///< WEB_FILE: its name in the folder of the page.
    const char *type; ///< Content-Type of the answer.
} web_route_t;

typedef struct {
    const char *method;
    const char *path;
    const char *host;
    const char *origin;
    const char *site; ///< Sec-Fetch-Site
    web_proof_t proof;
    int64_t body;    ///< Bytes; -1: any number.
    bool is_doubled; ///< A header that must be unique is sent twice, or the name of a header has a blank.
} web_asked_t;

typedef struct {
    const char *hosts; ///< Names of this machine in addition to addresses and localhost, separated by blanks.
    bool may_drive;
    bool may_reset;
} web_rules_t;

typedef struct {
    unsigned status;          ///< Status of HTTP; 200: continue with `route`.
    const char *error;        ///< One word.
    const char *message;      ///< Cause and fix.
    const web_route_t *route; ///< NULL unless `status` is 200.
} web_verdict_t;

/// The files of the page, the challenge and STOP are open to all clients that call this machine by its own name.
/// Reading needs the secret for reading or the token. All other routes need the token.
web_verdict_t web_judge(const web_rules_t *rules, const web_asked_t *asked);

/// Returns all routes, the files first; ends with a NULL path.
const web_route_t *web_routes(void);

/// Parses an integer within the range, without blanks or plus. Returns false and leaves `*out_value` unchanged if it is
/// not valid.
bool web_number(const char *text, int64_t min, int64_t max, int64_t *out_value);

/// Returns true for the file name of a recording: letters, digits, `_` and `-`, then .log, .jsonl or .conf.
bool web_recording_name(const char *text);

#endif
