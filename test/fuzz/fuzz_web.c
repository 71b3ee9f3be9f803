// SPDX-License-Identifier: MIT
// Any bytes as input that the web bridge parses itself: header values, path, arguments of a drive command, the name of a recording. No request passes
// without the token and one of our host names, no command exceeds the limits, and no name leads out of the folder of recordings.
#include "fuzz.h"

#include "driver.h"
#include "web_judge.h"

#include <strings.h>

#define FIELDS 12U

static const char token[] = "00112233445566778899aabbccddeeff";
static const char nonce[] = "0123456789abcdef0123456789abcdef";

/// Cuts the bytes at each newline into texts of exactly their length, so the sanitizer finds a byte that is read after one. Missing texts are NULL.
static void cut(const uint8_t *data, size_t size, char *fields[FIELDS]) {
    const uint8_t *const end = data + size;
    for (size_t i = 0; i < FIELDS; i++) {
        fields[i] = NULL;
        if (data >= end) {
            continue;
        }
        const uint8_t *newline = memchr(data, '\n', (size_t)(end - data));
        const size_t length = (size_t)(((newline != NULL) ? newline : end) - data);
        fields[i] = malloc(length + 1U);
        memcpy(fields[i], data, length);
        fields[i][length] = '\0';
        data += length + 1U;
    }
}

static void judge_request(char *fields[FIELDS], bool drives) {
    web_proofs_t proofs = {.nonce = {"0123456789abcdef0123456789abcdef"}, .renew_us = UINT64_MAX / 2U};
    const web_claim_t claim = {(fields[0] != NULL) ? fields[0] : "", (fields[1] != NULL) ? fields[1] : "", fields[5]};
    uint64_t session = 0;
    const web_proof_t proof = web_proofs_judge(&proofs, token, &claim, 1, &session);
    fuzz_require((proof == WEB_PROOF_FULL) == (session > 0U), "a session belongs to a proof");
    fuzz_require(proof != WEB_PROOF_FULL || (strstr(fields[5], nonce) != NULL && strstr(fields[5], token) == NULL),
                 "with the nonce, and without the token");
    fuzz_require(proof != WEB_PROOF_FULL || web_proofs_judge(&proofs, token, &claim, 1, &session) == WEB_PROOF_WRONG,
                 "a proof counts once");
    const web_rules_t rules = {"walker.lan", drives, drives};
    const web_asked_t asked = {(fields[0] != NULL) ? fields[0] : "",
                               (fields[1] != NULL) ? fields[1] : "",
                               fields[2],
                               fields[3],
                               fields[4],
                               proof,
                               false,
                               false};
    const web_verdict_t verdict = web_judge(&rules, &asked);
    fuzz_require((verdict.status == 200U) == (verdict.route != NULL), "a route, or a refusal");
    fuzz_require(verdict.status == 200U || (verdict.error[0] != '\0' && verdict.message[0] != '\0'),
                 "a refusal has a reason");
    if (verdict.status != 200U) {
        if (drives) {
            fuzz_position("refused");
        }
        return;
    }
    fuzz_position("accepted");
    fuzz_require(asked.host != NULL && asked.host[0] != '\0', "without a host no route");
    fuzz_require(verdict.route->verb == WEB_FILE || verdict.route->verb == WEB_CHALLENGE ||
                     verdict.route->verb == WEB_STOP || proof == WEB_PROOF_FULL ||
                     (proof == WEB_PROOF_READ && strcmp(asked.method, "GET") == 0),
                 "a proof was there");
    fuzz_require(asked.origin == NULL || strcasecmp(strstr(asked.origin, "//") + 2, asked.host) == 0, "our own page");
    fuzz_require(drives || (verdict.route->verb != WEB_ARM && verdict.route->verb != WEB_DRIVE &&
                            verdict.route->verb != WEB_RESET),
                 "driving is configured");
}

static void judge_drive(char *fields[FIELDS]) {
    web_driver_t driver = {0};
    web_twist_t twist = {0, 0};
    const web_command_t command = {fields[6] != NULL && strcmp(fields[6], token) == 0, fields[7], fields[8], fields[9],
                                   fields[10]};
    const web_limits_t limits = {300, 300000, 0};
    web_driver_begin(&driver, 0);
    if (web_driver_take(&driver, &command, &limits, 10000000U, &twist) == NULL) {
        fuzz_position("accepted");
        fuzz_require(twist.v_mm_s >= -300 && twist.v_mm_s <= 300 && twist.yaw_mrad_s >= -1000 &&
                         twist.yaw_mrad_s <= 1000,
                     "within the limits");
        fuzz_require(command.is_holders && driver.sequence > 0, "by the page that armed");
        fuzz_require(web_driver_take(&driver, &command, &limits, 10000000U, &twist) != NULL, "once");
    } else {
        fuzz_require(driver.dropped == 1U, "counted");
        fuzz_position("refused");
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *fields[FIELDS];
    cut(data, size, fields);
    judge_request(fields, false);
    judge_request(fields, true);
    judge_drive(fields);
    if (web_recording_name(fields[11])) {
        fuzz_position("accepted");
        fuzz_require(strlen(fields[11]) < WEB_NAME_SIZE && strpbrk(fields[11], "/\\\"% ") == NULL &&
                         fields[11][0] != '.' && strstr(fields[11], "..") == NULL,
                     "a bare name");
    }
    for (size_t i = 0; i < FIELDS; i++) {
        free(fields[i]);
    }
    return 0;
}
