// SPDX-License-Identifier: MIT
/// What was found out, one sentence each: ok, worth a warning, wrong, or not to be looked at here; and the command that mends it.
///
/// The owner fills a list by calling the judges (inspect.h) and its own code, and prints it as it likes. No heap.
#ifndef INSPECT_FINDINGS_H
#define INSPECT_FINDINGS_H

#include <stdbool.h>
#include <stddef.h>

/// More than all judges together ever say; what comes after that is counted only.
#define INSPECT_FINDINGS_MAX 40U
#define INSPECT_TEXT_SIZE    320U
#define INSPECT_CURE_SIZE    320U

/// INSPECT_SKIP: this machine has not what there would be to look at.
typedef enum { INSPECT_OK = 0, INSPECT_WARN, INSPECT_FAIL, INSPECT_SKIP } inspect_verdict_t;
#define INSPECT_VERDICTS 4U

typedef struct {
    const char *check; ///< What was looked at: a word of a closed list (docs/doctor.md).
    inspect_verdict_t verdict;
    char text[INSPECT_TEXT_SIZE]; ///< What is.
    char cure[INSPECT_CURE_SIZE]; ///< What mends it; empty if there is nothing to mend.
} inspect_finding_t;

typedef struct {
    inspect_finding_t finding[INSPECT_FINDINGS_MAX];
    unsigned count;
    unsigned lost;                    ///< That did not fit.
    unsigned total[INSPECT_VERDICTS]; ///< Of each verdict, those that did not fit too.
    inspect_verdict_t absent;         ///< What a machine without CAN or GPIO gets: INSPECT_FAIL unless set otherwise.
} inspect_findings_t;

void inspect_begin(inspect_findings_t *self);

/// Adds a finding without a cure. `check` must be a literal.
__attribute__((format(printf, 4, 5))) void inspect_say(inspect_findings_t *self, const char *check,
                                                       inspect_verdict_t verdict, const char *format, ...);

/// The cure of the finding added last.
__attribute__((format(printf, 2, 3))) void inspect_cure(inspect_findings_t *self, const char *format, ...);

/// "ok", "warn", "fail" or "skip".
const char *inspect_verdict_word(inspect_verdict_t verdict);

/// "text; cure" in one line.
void inspect_sentence(const inspect_finding_t *finding, char *out_text, size_t size);

#endif
