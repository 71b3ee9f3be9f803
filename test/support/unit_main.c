// SPDX-License-Identifier: MIT
#include <stddef.h>

#include "unit.h"

// The linker's, for a section whose name is one of C.
extern const unit_test_t *const __start_unit_tests[], *const __stop_unit_tests[];

// Of tests that prepare nothing.
__attribute__((weak)) void setUp(void) {}

__attribute__((weak)) void tearDown(void) {}

/// The first test behind that line, NULL at the end: a compiler may give them in any order.
static const unit_test_t *next(int line) {
    const unit_test_t *first = NULL;
    for (const unit_test_t *const *test = __start_unit_tests; test != __stop_unit_tests; test++) {
        if ((*test)->line > line && (first == NULL || (*test)->line < first->line)) {
            first = *test;
        }
    }
    return first;
}

int main(void) {
    UNITY_BEGIN();
    for (const unit_test_t *test = next(0); test != NULL; test = next(test->line)) {
        Unity.TestFile = test->file;
        UnityDefaultTestRun(test->run, test->name, test->line);
    }
    // Of two in one line, in two files, one would be lost.
    const int lost = (__stop_unit_tests - __start_unit_tests) - (ptrdiff_t)Unity.NumberOfTests != 0;
    return UNITY_END() + lost;
}
