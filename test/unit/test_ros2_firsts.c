// SPDX-License-Identifier: MIT
// First messages of new Fast DDS writers: incoming heartbeats, outgoing ACKNACKs.
#include "firsts.h"

#include "unit.h"

#include <string.h>

#define SIZE 512U
#define HEAD ((size_t)20)
#define BEAT ((size_t)32)

static rtps_firsts_t firsts;
static uint8_t message[SIZE];
static uint8_t out[SIZE];
static size_t length;

void setUp(void) {
    memset(&firsts, 0, sizeof firsts);
    memset(out, 0xA5, sizeof out);
    length = 0;
}

static void put(const uint8_t *bytes, size_t count) {
    memcpy(message + length, bytes, count);
    length += count;
}

static void put_number(uint32_t value, size_t count, bool little) {
    rtps_write(value, count, little, message + length);
    length += count;
}

static void put_sequence(int64_t number, bool little) {
    rtps_write_sequence(number, little, message + length);
    length += 8U;
}

/// Begins a message of the participant with this last byte.
static void begin_message(uint8_t participant) {
    const uint8_t header[HEAD] = {'R', 'T', 'P', 'S', 2, 3, 1, 15, 1, 15, 0, 0, 0, 0, 0, 0, 0, 0, 0, participant};
    length = 0;
    put(header, sizeof header);
}

static void put_part(uint8_t kind, uint8_t flags, uint16_t rest) {
    const uint8_t start[2] = {kind, flags};
    put(start, sizeof start);
    put_number(rest, 2, (flags & 1U) != 0U);
}

static void put_ids(uint8_t writer_kind) {
    const uint8_t ids[8] = {0, 0, 0x0F, 4, 0, 0, 2, writer_kind};
    put(ids, sizeof ids);
}

static void put_heartbeat(bool little, uint8_t writer_kind, int64_t first, int64_t last) {
    put_part(7, little ? 1 : 0, 28);
    put_ids(writer_kind);
    put_sequence(first, little);
    put_sequence(last, little);
    put_number(9, 4, little);
}

/// Does not change the message. Returns 0 if there is nothing to add.
static size_t await_in(int64_t now_us, size_t count, size_t capacity) {
    memset(out, 0xA5, sizeof out);
    memcpy(out, message, count);
    const size_t used = rtps_await_firsts(&firsts, now_us, out, count, capacity);
    TEST_ASSERT_EACH_EQUAL_HEX8(0xA5, out + used, sizeof out - used);
    if (used == count) {
        TEST_ASSERT_EQUAL_MEMORY(message, out, count);
        return 0;
    }
    return used;
}

static size_t await_at(int64_t now_us) {
    return await_in(now_us, length, sizeof out);
}

// ---- heartbeats -----------------------------------------------------------------------------------------------------

TEST(test_firsts_new_writer_gets_an_empty_heartbeat_first) {
    for (unsigned little = 0; little < 2U; little++) {
        setUp();
        begin_message(1);
        put_part(0x09, (uint8_t)(little | 2U), 0); // An INFO_TS submessage without a time.
        put_heartbeat(little == 1U, 3, 0x200000005LL, 0x200000007LL);
        put_part(0x01, 1, 4);
        put_number(0x01020304U, 4, true);
        message[HEAD + 4U + 1U] |= 8U; // Sets the group flag, which the added heartbeat does not have.
        TEST_ASSERT_EQUAL_size_t(length + BEAT, await_at(0));
        TEST_ASSERT_EQUAL_MEMORY(message, out, HEAD + 4U);
        TEST_ASSERT_EQUAL_MEMORY(message + HEAD + 4U, out + HEAD + 4U + BEAT, length - HEAD - 4U);
        const uint8_t *added = out + HEAD + 4U;
        TEST_ASSERT_EQUAL_HEX8(7, added[0]);
        TEST_ASSERT_EQUAL_HEX8(little | 2U, added[1]);
        TEST_ASSERT_EQUAL_UINT32(28, rtps_read(added + 2, 2, little == 1U));
        TEST_ASSERT_EQUAL_MEMORY(message + HEAD + 4U + 4U, added + 4, 16); // Entity ids and the first sequence number.
        TEST_ASSERT_EQUAL_INT64(0x200000004LL, rtps_read_sequence(added + 20, little == 1U));
        TEST_ASSERT_EQUAL_UINT32(8, rtps_read(added + 28, 4, little == 1U));
    }
}

TEST(test_firsts_writer_is_new_for_five_seconds) {
    begin_message(1);
    put_heartbeat(true, 2, 1, 1);
    TEST_ASSERT_EQUAL_size_t(length + BEAT, await_at(1000));
    TEST_ASSERT_EQUAL_size_t(length + BEAT, await_at(1000 + FIRSTS_NEW_US - 1));
    TEST_ASSERT_EQUAL_size_t(0, await_at(1000 + FIRSTS_NEW_US));
    message[HEAD + 10U] = 9; // Another writer of the participant,
    TEST_ASSERT_EQUAL_size_t(length + BEAT, await_at(1000 + FIRSTS_NEW_US));
    message[HEAD - 1U] = 2; // and a writer of another participant.
    TEST_ASSERT_EQUAL_size_t(length + BEAT, await_at(1000 + 2LL * FIRSTS_NEW_US));
}

TEST(test_firsts_table_full_replaces_the_oldest_writer) {
    for (uint8_t i = 0; i < FIRSTS_WRITERS; i++) {
        begin_message(i);
        put_heartbeat(true, 3, 1, 1);
        TEST_ASSERT_GREATER_THAN_size_t(0, await_at(0));
    }
    for (uint8_t i = 0; i < FIRSTS_WRITERS; i++) {
        begin_message(i);
        put_heartbeat(true, 3, 1, 1);
        TEST_ASSERT_EQUAL_size_t(0, await_at(FIRSTS_NEW_US));
    }
    begin_message(FIRSTS_WRITERS);
    put_heartbeat(true, 3, 1, 1);
    TEST_ASSERT_GREATER_THAN_size_t(0, await_at(FIRSTS_NEW_US));
    TEST_ASSERT_GREATER_THAN_size_t(0, await_at(FIRSTS_NEW_US + 1));
    TEST_ASSERT_EQUAL_size_t(0, await_at(2LL * FIRSTS_NEW_US));
    begin_message(1);
    put_heartbeat(true, 3, 1, 1);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, await_at(FIRSTS_NEW_US), "the second is still known");
    begin_message(0);
    put_heartbeat(true, 3, 1, 1);
    TEST_ASSERT_GREATER_THAN_size_t(0, await_at(FIRSTS_NEW_US));
}

TEST(test_firsts_other_messages_are_unchanged) {
    static const struct {
        const char *what;
        int64_t first, last;
        uint8_t kind;
    } others[] = {{"of discovery", 1, 1, 0xC2},
                  {"of a reader", 1, 1, 4},
                  {"empty", 3, 2, 3},
                  {"from 0", 0, 2, 3},
                  {"from below", -4, 2, 3}};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        begin_message(1);
        put_heartbeat(true, others[i].kind, others[i].first, others[i].last);
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, await_at(0), others[i].what);
    }
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, firsts.count, "no writer was stored");
    begin_message(1);
    put_heartbeat(true, 3, 1, 1);
    message[HEAD] = 8;
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, await_at(0), "another submessage");
    message[HEAD] = 7;
    message[7] = 16;
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, await_at(0), "another vendor");
    message[7] = 15;
    message[0] = 'X';
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, await_at(0), "no RTPS");
    message[0] = 'R';
    TEST_ASSERT_EQUAL_size_t(length + BEAT, await_at(0));
}

TEST(test_firsts_damaged_message_or_small_buffer_is_unchanged) {
    begin_message(1);
    put_heartbeat(true, 3, 1, 2);
    put_part(0x01, 1, 4);
    put_number(0, 4, true);
    const size_t whole = length;
    for (size_t size = 1; size < whole; size++) {
        TEST_ASSERT_EQUAL_size_t((size == HEAD + BEAT) ? size + BEAT : 0U, await_in(0, size, sizeof out));
    }
    for (size_t capacity = whole; capacity < whole + BEAT; capacity++) {
        TEST_ASSERT_EQUAL_size_t(0, await_in(0, whole, capacity));
    }
    TEST_ASSERT_EQUAL_size_t(whole + BEAT, await_in(0, whole, whole + BEAT));
    message[HEAD + 2U] = 27; // Too short for a heartbeat.
    message[HEAD + 31U] = 1;
    TEST_ASSERT_EQUAL_size_t(0, await_at(0));
}

TEST(test_firsts_each_heartbeat_of_a_message_gets_its_own) {
    begin_message(1);
    put_heartbeat(true, 3, 1, 1);
    put_heartbeat(true, 0xC3, 1, 1);
    put_heartbeat(false, 2, 5, 6);
    message[length - 30U] = 0; // Length 0: the last submessage extends to the end.
    message[length - 29U] = 0;
    TEST_ASSERT_EQUAL_size_t(length + 2 * BEAT, await_at(0));
    TEST_ASSERT_EQUAL_MEMORY(message + HEAD, out + HEAD + BEAT, 2 * BEAT);
    TEST_ASSERT_EQUAL_INT64(4, rtps_read_sequence(out + HEAD + 3 * BEAT + 20U, false));
    TEST_ASSERT_EQUAL_MEMORY(message + HEAD + 2 * BEAT, out + HEAD + 4 * BEAT, BEAT);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(length + BEAT, await_in(0, length, length + BEAT), "there is space for one");
}

// ---- ACKNACKs -------------------------------------------------------------------------------------------------------

static void put_destination(uint8_t vendor, uint16_t rest) {
    const uint8_t prefix[12] = {1, vendor, 1, 15};
    put_part(0x0E, 1, rest);
    put(prefix, rest);
}

/// Returns the offset of the submessage.
static size_t put_acknack(bool little, int64_t base, uint32_t bits, uint32_t count) {
    const size_t at = length;
    put_part(6, little ? 1 : 0, (uint16_t)(24U + (bits + 31U) / 32U * 4U));
    put_ids(3);
    put_sequence(base, little);
    put_number(bits, 4, little);
    for (uint32_t i = 0; i < bits; i += 32U) {
        put_number(0x01020304U, 4, little);
    }
    put_number(count, 4, little);
    return at;
}

static int64_t base_at(size_t at) {
    return rtps_read_sequence(message + at + 12U, (message[at + 1U] & 1U) != 0U);
}

static uint32_t count_before(size_t end) {
    return rtps_read(message + end - 4U, 4, true);
}

TEST(test_firsts_first_acknack_asks_from_sequence_zero) {
    for (unsigned little = 0; little < 2U; little++) {
        begin_message(1);
        put_destination(15, 12);
        const size_t at = put_acknack(little == 1U, 1, 0, 0);
        memcpy(out, message, length);
        TEST_ASSERT_TRUE(rtps_ask_firsts(message, length));
        TEST_ASSERT_EQUAL_INT64(0, base_at(at));
        TEST_ASSERT_EQUAL_UINT32(1, rtps_read(message + at + 24U, 4, little == 1U));
        TEST_ASSERT_EQUAL_MEMORY(out, message, at + 12U);
        TEST_ASSERT_EQUAL_MEMORY(out + at + 20U, message + at + 20U, 4);
    }
}

TEST(test_firsts_later_acknacks_count_one_more) {
    static const uint32_t bits[] = {0, 1, 32, 33, 256};
    for (size_t i = 0; i < sizeof bits / sizeof bits[0]; i++) {
        begin_message(1);
        put_destination(15, 12);
        const size_t at = put_acknack(true, 0x300000007LL, bits[i], 1);
        const size_t end = length;
        put_part(0x01, 1, 0);
        TEST_ASSERT_TRUE(rtps_ask_firsts(message, length));
        TEST_ASSERT_EQUAL_INT64(0x300000007LL, base_at(at));
        TEST_ASSERT_EQUAL_UINT32(bits[i], rtps_read(message + at + 20U, 4, true));
        TEST_ASSERT_EQUAL_UINT32(2, count_before(end));
    }
    begin_message(1);
    put_destination(15, 12);
    const size_t at = put_acknack(true, 1, 1, 0);
    TEST_ASSERT_TRUE(rtps_ask_firsts(message, length));
    TEST_ASSERT_EQUAL_INT64_MESSAGE(1, base_at(at), "it asks for a sample");
}

TEST(test_firsts_only_acknacks_to_fast_dds_change) {
    begin_message(1);
    const size_t none = put_acknack(true, 1, 0, 0);
    put_destination(16, 12);
    const size_t other = put_acknack(true, 1, 0, 0);
    put_destination(15, 11);
    const size_t part = put_acknack(true, 1, 0, 0);
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, length));
    put_destination(15, 12);
    const size_t two[2] = {put_acknack(true, 1, 0, 0), put_acknack(true, 1, 0, 0)};
    put_destination(16, 12);
    const size_t last = put_acknack(true, 1, 0, 0);
    TEST_ASSERT_TRUE(rtps_ask_firsts(message, length));
    TEST_ASSERT_EQUAL_INT64(1, base_at(none));
    TEST_ASSERT_EQUAL_INT64(1, base_at(other));
    TEST_ASSERT_EQUAL_INT64(1, base_at(part));
    TEST_ASSERT_EQUAL_INT64(0, base_at(two[0]));
    TEST_ASSERT_EQUAL_INT64(0, base_at(two[1]));
    TEST_ASSERT_EQUAL_INT64(1, base_at(last));
}

TEST(test_firsts_damaged_acknack_is_unchanged) {
    begin_message(1);
    put_destination(15, 12);
    const size_t at = put_acknack(true, 1, 256, 5);
    memcpy(out, message, sizeof out);
    for (size_t size = 0; size < length; size++) {
        TEST_ASSERT_FALSE(rtps_ask_firsts(message, size));
    }
    rtps_write(257, 4, true, message + at + 20U);
    put_number(0, 4, true);
    message[at + 2U] = (uint8_t)(message[at + 2U] + 4U); // The set would have space for as many bits.
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, length));
    rtps_write(0xFFFFFFFFU, 4, true, message + at + 20U);
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, length));
    memcpy(message, out, sizeof out);
    length -= 4U;
    message[at + 2U] = 52; // Shorter than the set of the submessage.
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, at + 56U));
    message[at + 2U] = 20; // Shorter than any ACKNACK.
    memset(message + at + 20U, 0, 4);
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, at + 24U));
    memcpy(message, out, sizeof out);
    message[0] = 'X';
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, length));
    message[0] = 'R';
    message[at] = 8;
    TEST_ASSERT_FALSE(rtps_ask_firsts(message, length));
    message[at] = 6;
    TEST_ASSERT_EQUAL_MEMORY(out, message, length);
    TEST_ASSERT_TRUE(rtps_ask_firsts(message, length));
}
