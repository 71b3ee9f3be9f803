// SPDX-License-Identifier: MIT
// Any bytes as a client's line: a request in which every field is valid, or a refusal that can be printed; and the same
// result as the earlier reader returns (old_reader.h), word for word. A stop in a refused line is executed.
#include "fuzz.h"

#include "old_reader.h"

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
    fuzz_require(
        terminated(request->name, sizeof request->name) && terminated(request->reason, sizeof request->reason) &&
            terminated(request->value, sizeof request->value) && terminated(request->how, sizeof request->how) &&
            terminated(request->lease_key, sizeof request->lease_key),
        "texts end");
    fuzz_require(request->cmd != IWN_CMD_WATCH || request->rate_hz >= 1, "the rate is positive");
    fuzz_require(request->cmd != IWN_CMD_TARE || (request->sides >= IW_SIDES_LEFT && request->sides <= IW_SIDES_BOTH),
                 "tare names a side");
}

static void compare_ids(const iwn_id_t *now, const iwn_id_t *before) {
    fuzz_require(now->kind == before->kind, "the id is of the same kind");
    fuzz_require(now->kind != IWN_ID_NUMBER || now->number == before->number, "the id is the same number");
    fuzz_require(now->kind != IWN_ID_TEXT || strcmp(now->text, before->text) == 0, "the id is the same text");
}

/// The new reader writes spaces for the bytes of a character that fits only in part; the earlier one omits it.
static bool same_reason(const char *now, const char *before) {
    const size_t length = strlen(before);
    return strncmp(now, before, length) == 0 && strspn(&now[length], " ") == strlen(&now[length]);
}

static void compare_requests(const iwn_request_t *now, const iwn_request_t *before) {
    fuzz_require(now->cmd == before->cmd, "the same command");
    fuzz_require(now->left_mm_s == before->left_mm_s && now->right_mm_s == before->right_mm_s &&
                     now->v_mm_s == before->v_mm_s && now->yaw_mrad_s == before->yaw_mrad_s,
                 "the same speeds");
    fuzz_require(now->has_current == before->has_current && now->left_mA == before->left_mA &&
                     now->right_mA == before->right_mA,
                 "the same currents");
    fuzz_require(now->rate_hz == before->rate_hz && now->topics == before->topics, "the same subscription");
    fuzz_require(now->takeover == before->takeover && now->sides == before->sides && now->item == before->item,
                 "the same choices");
    fuzz_require(now->has_t_us == before->has_t_us && now->t_us == before->t_us && now->has_stop == before->has_stop &&
                     now->stop == before->stop,
                 "the same time, the same stop");
    fuzz_require(strcmp(now->name, before->name) == 0 && same_reason(now->reason, before->reason) &&
                     strcmp(now->value, before->value) == 0 && strcmp(now->how, before->how) == 0 &&
                     strcmp(now->file, before->file) == 0 && strcmp(now->key, before->key) == 0 &&
                     strcmp(now->lease_key, before->lease_key) == 0 && now->offset == before->offset &&
                     now->has_commit == before->has_commit && now->commit == before->commit,
                 "the same texts");
}

static size_t skip_blanks(const char *line, size_t size, size_t at) {
    while (at < size && memchr(" \t\r", line[at], 3U) != NULL) {
        at++;
    }
    return at;
}

static bool follows(const char *line, size_t size, size_t at, const char *words) {
    return size - at >= strlen(words) && memcmp(&line[at], words, strlen(words)) == 0;
}

/// Returns the stop that a line names anywhere; 0: none. It knows no escapes.
static iwn_cmd_t stop_in(const char *line, size_t size) {
    static const char *const words[] = {"\"stop\"", "\"disarm\"", "\"estop\""};
    iwn_cmd_t found = (iwn_cmd_t)0;
    for (size_t i = 0; i < size; i++) {
        const size_t colon = follows(line, size, i, "\"cmd\"") ? skip_blanks(line, size, i + 5U) : size;
        const size_t value = follows(line, size, colon, ":") ? skip_blanks(line, size, colon + 1U) : size;
        for (unsigned cmd = 0; cmd < 3U; cmd++) {
            if (follows(line, size, value, words[cmd]) && IWN_CMD_STOP + cmd > found) {
                found = (iwn_cmd_t)(IWN_CMD_STOP + cmd);
            }
        }
    }
    return found;
}

/// A line is refused: what names a stop is executed, nothing else.
static void judge_stop(const char *line, size_t size, bool accepted, const iwn_request_t *now,
                       const iwn_refusal_t *refusal) {
    const iwn_cmd_t cmd = stop_in(line, size);
    fuzz_require(accepted == iwn_cmd_stops(now->cmd), "a stop is executed");
    fuzz_require(accepted == (now->refused == IWN_BAD_JSON), "and refused");
    fuzz_require(accepted == (strstr(refusal->message, "; its stop is executed") != NULL), "and the client knows");
    fuzz_require(now->cmd == cmd || memchr(line, '\\', size) != NULL, "the stop that the line names");
    fuzz_require(cmd == 0 || now->cmd >= cmd, "or a stronger one, with escapes");
}

/// The earlier reader drops a NUL after a number or a word without a refusal, names a line that is nested too deeply in
/// other words, and finds no stop in a refused line: these differences are intended.
static void compare(const char *line, size_t size, bool accepted, const iwn_request_t *now,
                    const iwn_refusal_t *refusal) {
    static iwn_request_t before;
    static iwn_refusal_t refusal_before;
    const bool accepted_before = old_request_read(line, size, &before, &refusal_before);
    if (memchr(line, '\0', size) != NULL) {
        fuzz_require(now->refused == IWN_BAD_JSON || (!accepted && refusal->error == IWN_BAD_JSON),
                     "a NUL is bad JSON");
        judge_stop(line, size, accepted, now, refusal);
        return;
    }
    fuzz_require((accepted && now->refused == IWN_OK) == accepted_before, "both accept it, or neither");
    compare_ids(&now->id, &before.id);
    if (accepted_before) {
        compare_requests(now, &before);
        return;
    }
    const size_t length = strlen(refusal_before.message);
    fuzz_require(refusal->error == refusal_before.error, "refused with the same name");
    fuzz_require(strncmp(refusal->message, refusal_before.message, length) == 0 ||
                     strncmp(refusal_before.message, "nested more than ", 17U) == 0,
                 "refused in the same words");
    if (refusal->error == IWN_BAD_JSON) {
        judge_stop(line, size, accepted, now, refusal);
    } else {
        fuzz_require(!accepted && refusal->message[length] == '\0', "refused without more words");
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static iwn_work_t work;
    static iwn_request_t request;
    static iwn_refusal_t refusal;
    if (memchr(data, '\n', size) != NULL || size > IWN_LINE_MAX) {
        return -1;
    }
    // A copy of exactly that length: the sanitizer finds a byte that is read after it.
    char *const line = malloc((size > 0U) ? size : 1U);
    memcpy(line, data, size);
    memset(&request, 0xA5, sizeof request);
    memset(&refusal, 0xA5, sizeof refusal);
    const bool accepted = iwn_request_read(line, size, &work, &request, &refusal);
    if (accepted) {
        fuzz_position("accepted");
        judge_request(&request);
    } else {
        fuzz_position("refused");
        judge_refusal(&refusal);
    }
    fuzz_require(request.id.kind <= IWN_ID_TEXT, "the id has a known kind");
    compare(line, size, accepted, &request, &refusal);
    free(line);
    return 0;
}
