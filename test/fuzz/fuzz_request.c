// SPDX-License-Identifier: MIT
// Any bytes as a client's line: a request in which every field is valid, or a refusal that can be printed; and the same
// result as the earlier reader returns (old_reader.h), word for word.
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

/// The earlier reader drops a NUL after a number or a word without a refusal: this one difference is intended.
static void compare(const char *line, size_t size, bool accepted, const iwn_request_t *now,
                    const iwn_refusal_t *refusal) {
    static iwn_request_t before;
    static iwn_refusal_t refusal_before;
    const bool accepted_before = old_request_read(line, size, &before, &refusal_before);
    if (memchr(line, '\0', size) != NULL) {
        fuzz_require(!accepted && refusal->error == IWN_BAD_JSON, "a NUL is bad JSON");
        return;
    }
    fuzz_require(accepted == accepted_before, "both accept it, or neither");
    compare_ids(&now->id, &before.id);
    if (accepted) {
        compare_requests(now, &before);
    } else {
        fuzz_require(refusal->error == refusal_before.error, "refused with the same name");
        fuzz_require(strcmp(refusal->message, refusal_before.message) == 0, "refused in the same words");
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
