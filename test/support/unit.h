// SPDX-License-Identifier: MIT
#ifndef IW_UNIT_H
#define IW_UNIT_H

#include "unity.h"

typedef struct {
    void (*run)(void);
    const char *name, *file;
    int line;
} unit_test_t;

/// A test of Unity that is in no list: the linker collects all tests of a program, and `main` of unit_main.c runs them in the order of their lines.
#define TEST(test)                                                                                                     \
    static void test(void);                                                                                            \
    static const unit_test_t test##_entry = {(test), #test, __FILE__, __LINE__};                                       \
    static const unit_test_t *const test##_listed __attribute__((section("unit_tests"), used)) = &test##_entry;        \
    static void test(void)

#endif
