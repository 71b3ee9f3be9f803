// SPDX-License-Identifier: MIT
#include "test_config_rig.h"

#include "unity.h"

#include <string.h>

char messages[8192];
gateway_config_t config;
gateway_config_t before;

static FILE *begin(void) {
    memset(messages, 0, sizeof messages);
    return fmemopen(messages, sizeof messages, "w");
}

static FILE *begin_poisoned(void) {
    memset(&config, 0xA5, sizeof config);
    before = config;
    return begin();
}

int parse_bytes(const char *text, size_t size) {
    FILE *err = begin_poisoned();
    const int result = gateway_config_parse("iw.conf", text, size, &config, err);
    fclose(err);
    return result;
}

int parse(const char *text) {
    return parse_bytes(text, strlen(text));
}

int load(const char *path) {
    FILE *err = begin_poisoned();
    const int result = gateway_config_load(path, &config, err);
    fclose(err);
    return result;
}

int override(const char *name, const char *value) {
    FILE *err = begin();
    const int result = gateway_config_override(&config, name, value, "--option", err);
    fclose(err);
    return result;
}

void accepted(const char *text) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, parse(text), messages);
    TEST_ASSERT_EQUAL_STRING("", messages);
}

void refused(const char *text, const char *where, const char *what) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(GATEWAY_CONFIG_ERROR, parse(text), text);
    TEST_ASSERT_EQUAL_MEMORY(&before, &config, sizeof config);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(messages, where), messages);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(messages, what), messages);
}

char *printed(const gateway_config_t *from) {
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    gateway_config_print(from, out);
    fclose(out);
    return text;
}
