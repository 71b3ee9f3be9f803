// SPDX-License-Identifier: MIT
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

#include "unit.h"

// The linker defines these for a section whose name is a C identifier.
extern const unit_test_t *const __start_unit_tests[], *const __stop_unit_tests[];

// For tests that prepare nothing.
__attribute__((weak)) void setUp(void) {}

__attribute__((weak)) void tearDown(void) {}

/// Returns the first test after that line, NULL at the end: a compiler may emit them in any order.
static const unit_test_t *next(int line) {
    const unit_test_t *first = NULL;
    for (const unit_test_t *const *test = __start_unit_tests; test != __stop_unit_tests; test++) {
        if ((*test)->line > line && (first == NULL || (*test)->line < first->line)) {
            first = *test;
        }
    }
    return first;
}

/// With IWHEEL_FIRST_FAILURE in its environment, the program ends after the first failed test: test/faults and test/mutation need no more.
int main(void) {
    const bool only_first = getenv("IWHEEL_FIRST_FAILURE") != NULL;
    UNITY_BEGIN();
    for (const unit_test_t *test = next(0); test != NULL && !(only_first && Unity.TestFailures > 0);
         test = next(test->line)) {
        Unity.TestFile = test->file;
        UnityDefaultTestRun(test->run, test->name, test->line);
    }
    // If two tests in two files have the same line, one would not run.
    const int lost = (__stop_unit_tests - __start_unit_tests) - (ptrdiff_t)Unity.NumberOfTests != 0;
    return UNITY_END() + lost;
}
