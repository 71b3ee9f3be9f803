// SPDX-License-Identifier: MIT
// Any bytes as a client's line: a request in which every field is what it should be, or a refusal that can be printed.
#include "fuzz.h"

#include "json/json_arena.h"

#include "iwheel_northbound/request.h"

static bool terminated(const char *text, size_t size) {
    return memchr(text, '\0', size) != NULL;
}

static void judge_refusal(const iwn_refusal_t *refusal) {
    fuzz_require(refusal->error > IWN_OK && refusal->error < IWN_ERRORS, "the refusal has a name");
    fuzz_require(terminated(refusal->message, sizeof refusal->message) && refusal->message[0] != '\0', "and a message");
    for (const char *c = refusal->message; *c != '\0'; c++) {
        fuzz_require(*c >= 0x20 && *c <= 0x7E, "that can be printed");
    }
}

static void judge_request(const iwn_request_t *request) {
    fuzz_require(request->cmd < IWN_CMDS, "the command exists");
    fuzz_require(terminated(request->name, sizeof request->name) &&
                     terminated(request->reason, sizeof request->reason) &&
                     terminated(request->value, sizeof request->value),
                 "texts end");
    fuzz_require(request->cmd != IWN_CMD_WATCH || request->rate_hz >= 1, "the rate is positive");
    fuzz_require(request->cmd != IWN_CMD_TARE || (request->sides >= IW_SIDES_LEFT && request->sides <= IW_SIDES_BOTH),
                 "tare names a side");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static bool installed;
    static iwn_request_t request;
    static iwn_refusal_t refusal;
    if (!installed) {
        json_arena_install();
        installed = true;
    }
    if (memchr(data, '\n', size) != NULL || size > IWN_LINE_MAX) {
        return -1;
    }
    // A copy of exactly that length: a byte read behind it is found.
    char *const line = malloc(size > 0U ? size : 1U);
    memcpy(line, data, size);
    memset(&request, 0xA5, sizeof request);
    memset(&refusal, 0xA5, sizeof refusal);
    if (iwn_request_parse(line, size, &request, &refusal)) {
        fuzz_tell("taken");
        judge_request(&request);
    } else {
        fuzz_tell("refused");
        judge_refusal(&refusal);
    }
    fuzz_require(request.id.kind <= IWN_ID_TEXT, "the id is known, or known to be unknown");
    fuzz_require(json_arena_peak() < JSON_ARENA_SIZE, "the arena is large enough");
    free(line);
    return 0;
}
