// SPDX-License-Identifier: MIT
/// Whether a request may be answered, and what it asks: everything that the bridge itself reads of what others send.
///
/// Pure: no socket, no clock, no heap. Texts are terminated; NULL: not sent.
#ifndef WEB_JUDGE_H
#define WEB_JUDGE_H

#include "proof.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Bytes of a token with its terminator: 128 random bits as hexadecimal digits.
#define WEB_TOKEN_SIZE BRIDGE_SECRET_SIZE
/// Bytes of a recording's file name with its terminator.
#define WEB_NAME_SIZE 64U

typedef enum {
    WEB_FILE, ///< One of the page's files.
    WEB_CHALLENGE,
    WEB_STATUS,
    WEB_EVENTS,
    WEB_STOPS,
    WEB_RECORDINGS,
    WEB_RECORDING,
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
    const char *file; ///< WEB_FILE: its name in the page's folder.
    const char *type; ///< Content-Type of the answer.
} web_route_t;

typedef struct {
    const char *method;
    const char *path;
    const char *host;
    const char *origin;
    const char *site; ///< Sec-Fetch-Site
    web_proof_t proof;
    bool has_body;
    bool is_doubled; ///< A header that counts is there twice, or a header's name has a blank.
} web_asked_t;

typedef struct {
    const char *hosts; ///< Names of this machine beside addresses and localhost, separated by blanks.
    bool may_drive;
    bool may_reset;
} web_rules_t;

typedef struct {
    unsigned status;          ///< Of HTTP; 200: go on with `route`.
    const char *error;        ///< A word.
    const char *message;      ///< Cause and cure.
    const web_route_t *route; ///< NULL unless `status` is 200.
} web_verdict_t;

/// The page's files, the challenge and STOP are for everybody who calls this machine by its own name. To read needs the secret for reading or
/// the token; everything else needs the token.
web_verdict_t web_judge(const web_rules_t *rules, const web_asked_t *asked);

/// All routes, the files first; ends with a null path.
const web_route_t *web_routes(void);

/// A whole decimal number within the range, without blanks or plus. False, with `*out_value` untouched: it is none.
bool web_number(const char *text, int64_t min, int64_t max, int64_t *out_value);

/// A file of a recording by its bare name: letters, digits, `_` and `-`, then .log, .jsonl or .conf.
bool web_recording_name(const char *text);

#endif
