// SPDX-License-Identifier: MIT
#include "findings.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void inspect_begin(inspect_findings_t *self) {
    memset(self, 0, sizeof *self);
    self->absent = INSPECT_FAIL;
}

void inspect_say(inspect_findings_t *self, const char *check, inspect_verdict_t verdict, const char *format, ...) {
    self->total[verdict]++;
    if (self->count == INSPECT_FINDINGS_MAX) {
        self->lost++;
        return;
    }
    inspect_finding_t *finding = &self->finding[self->count++];
    finding->check = check;
    finding->verdict = verdict;
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(finding->text, sizeof finding->text, format, arguments);
    va_end(arguments);
}

void inspect_cure(inspect_findings_t *self, const char *format, ...) {
    if (self->count == 0U || self->lost > 0U) {
        return;
    }
    inspect_finding_t *finding = &self->finding[self->count - 1U];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(finding->cure, sizeof finding->cure, format, arguments);
    va_end(arguments);
}

const char *inspect_verdict_word(inspect_verdict_t verdict) {
    static const char *const words[INSPECT_VERDICTS] = {
        [INSPECT_OK] = "ok", [INSPECT_WARN] = "warn", [INSPECT_FAIL] = "fail", [INSPECT_SKIP] = "skip"};
    return words[verdict];
}

void inspect_sentence(const inspect_finding_t *finding, char *out_text, size_t size) {
    (void)snprintf(out_text, size, "%s%s%s", finding->text, (finding->cure[0] != '\0') ? "; " : "", finding->cure);
}
