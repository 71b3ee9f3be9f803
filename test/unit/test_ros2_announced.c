// SPDX-License-Identifier: MIT
// Announcements of a domain, before CycloneDDS reads them: large free data becomes padding, all other bytes stay.
#include "announced.h"
#include "log_limit.h"

#include "unit.h"

#include <stdlib.h>
#include <string.h>

#define USER  0x2CU
#define GROUP 0x2DU
#define TOPIC 0x2EU
#define NAME  0x05U
#define SIZE  8192U

static uint8_t message[SIZE];
static uint8_t before[SIZE];
static size_t length;
static bool is_of_a_writer; ///< Result of the last call by `finish`.

static void put(unsigned value, bool little) {
    rtps_write(value, 2, little, message + length);
    length += 2U;
}

static size_t parameter(unsigned id, size_t size, bool little) {
    const size_t at = length;
    put(id, little);
    put((unsigned)size, little);
    memset(message + length, 'x', size);
    length += size;
    return at;
}

/// Begins a message with one DATA of this writer. Returns the offset of its list of parameters. `finish` ends the message.
static size_t begin(uint8_t kind, uint8_t second, bool little, bool has_qos) {
    static const uint8_t head[] = {'R', 'T', 'P', 'S', 2, 1, 1, 16, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
    memset(message, 0, sizeof message);
    memcpy(message, head, sizeof head);
    length = sizeof head;
    message[length++] = 0x15;
    message[length++] = (uint8_t)(4U | (has_qos ? 2U : 0U) | (little ? 1U : 0U));
    length += 2U;
    put(0, little);
    put(16, little);
    length += 4U;
    const uint8_t writer[] = {0, second, kind, 0xC2};
    memcpy(message + length, writer, 4);
    length += 12U;
    if (has_qos) {
        (void)parameter(USER, 600, little); // This list is the inline QoS, not the announcement.
        put(1, little);
        put(0, little);
    }
    message[length + 1U] = little ? 3U : 2U;
    length += 4U;
    return length;
}

static void finish(bool little) {
    put(1, little);
    put(0, little);
    rtps_write((uint32_t)(length - 24U), 2, little, message + 22);
    memcpy(before, message, sizeof before);
    is_of_a_writer = rtps_drop_large_data(message, length);
}

static unsigned id_at(size_t at, bool little) {
    return (unsigned)rtps_read(message + at, 2, little);
}

static void expect_dropped(uint8_t kind, uint8_t second, bool little, bool has_qos) {
    (void)begin(kind, second, little, has_qos);
    const size_t name = parameter(NAME, 700, little);
    const size_t small = parameter(USER, ANNOUNCED_DATA_MAX, little);
    const size_t user = parameter(USER, ANNOUNCED_DATA_MAX + 4U, little);
    const size_t group = parameter(GROUP, 1000, little);
    const size_t topic = parameter(TOPIC, 1000, little);
    finish(little);
    TEST_ASSERT_EQUAL(kind == 3U, is_of_a_writer);
    TEST_ASSERT_EQUAL_HEX(NAME, id_at(name, little));
    TEST_ASSERT_EQUAL_HEX(USER, id_at(small, little));
    TEST_ASSERT_EQUAL_HEX(0, id_at(user, little));
    TEST_ASSERT_EQUAL_HEX(0, id_at(group, little));
    TEST_ASSERT_EQUAL_HEX(0, id_at(topic, little));
    rtps_write(USER, 2, little, message + user);
    rtps_write(GROUP, 2, little, message + group);
    rtps_write(TOPIC, 2, little, message + topic);
    TEST_ASSERT_EQUAL_MEMORY(before, message, sizeof before); // Nothing else has changed.
}

TEST(test_announced_large_data_becomes_padding_and_the_rest_stays) {
    for (unsigned form = 0; form < 4U; form++) {
        expect_dropped(3, 0, (form & 1U) != 0U, (form & 2U) != 0U);
        expect_dropped(4, 0, (form & 1U) != 0U, (form & 2U) != 0U);
        expect_dropped(0, 1, (form & 1U) != 0U, (form & 2U) != 0U);
    }
}

/// CycloneDDS sends messages of more than 1344 bytes in fragments: the free data begins in the first one and ends in another.
TEST(test_announced_data_begun_in_first_fragment_becomes_padding) {
    for (unsigned first = 1; first <= 2U; first++) {
        (void)begin(3, 0, true, false);
        memmove(message + 56, message + 44, 4); // Moves the encapsulation behind the longer head.
        memset(message + 44, 0, 12);
        message[20] = 0x16;
        rtps_write(28, 2, true, message + 26);
        rtps_write(first, 4, true, message + 44);
        length = 60;
        (void)parameter(NAME, 40, true);
        const size_t user = length;
        put(USER, true);
        put(8000, true);
        memset(message + length, 'x', 1200);
        length += 1200U;
        rtps_write((uint32_t)(length - 24U), 2, true, message + 22);
        TEST_ASSERT_EQUAL(first == 1U, rtps_drop_large_data(message, length));
        TEST_ASSERT_EQUAL_HEX((first == 1U) ? 0U : USER, id_at(user, true));
    }
}

TEST(test_announced_data_of_a_user_is_untouched) {
    (void)begin(5, 0, true, false);
    (void)parameter(USER, 4000, true);
    finish(true);
    TEST_ASSERT_EQUAL_MEMORY(before, message, sizeof before);
    TEST_ASSERT_FALSE(is_of_a_writer);
    (void)begin(3, 0, true, false);
    message[length - 3U] = 1; // CDR instead of a list of parameters.
    (void)parameter(USER, 4000, true);
    finish(true);
    TEST_ASSERT_EQUAL_MEMORY(before, message, sizeof before);
}

/// Cuts the message at every length and damages every byte of its heads: the function reads nothing beyond the message (a sanitizer
/// would report it) and changes nothing beyond it.
TEST(test_announced_message_that_is_cut_or_damaged_is_survived) {
    (void)begin(3, 0, true, true);
    (void)parameter(NAME, 40, true);
    (void)parameter(USER, 600, true);
    finish(true);
    for (size_t cut = 0; cut < length; cut++) {
        uint8_t *copy = malloc(cut + 1U);
        TEST_ASSERT_NOT_NULL(copy);
        memcpy(copy, before, cut);
        (void)rtps_drop_large_data(copy, cut);
        free(copy);
    }
    for (size_t at = 0; at < length; at++) {
        uint8_t *copy = malloc(length);
        TEST_ASSERT_NOT_NULL(copy);
        memcpy(copy, before, length);
        copy[at] ^= 0xFFU;
        (void)rtps_drop_large_data(copy, length);
        free(copy);
    }
}

TEST(test_log_of_others_is_bounded_and_counts_what_it_leaves_out) {
    log_limit_t limit = {.since_us = 0};
    uint64_t dropped = 0;
    unsigned passed = 0;
    for (unsigned i = 0; i < 1000U; i++) {
        passed += log_limit_pass(&limit, 5U + i, &dropped) ? 1U : 0U;
        TEST_ASSERT_EQUAL_UINT64(0, dropped);
    }
    TEST_ASSERT_EQUAL_UINT(LOG_LIMIT_LINES, passed);
    TEST_ASSERT_FALSE(log_limit_pass(&limit, 4U + LOG_LIMIT_US, &dropped));
    TEST_ASSERT_TRUE(log_limit_pass(&limit, 5U + LOG_LIMIT_US, &dropped));
    TEST_ASSERT_EQUAL_UINT64(1001U - LOG_LIMIT_LINES, dropped);
    TEST_ASSERT_TRUE(log_limit_pass(&limit, 6U + LOG_LIMIT_US, &dropped));
    TEST_ASSERT_EQUAL_UINT64(0, dropped);
}
