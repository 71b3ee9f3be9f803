// SPDX-License-Identifier: MIT
// Requests and replies of services as the ROS vendors send them, and the additions to an outgoing RTPS message.
#include "services.h"

#include "unit.h"

#include <string.h>

#define SIZE 256U

static ros_caller_t caller;
static uint8_t message[SIZE];
static uint8_t out[SIZE];
static size_t length;
static ros_marks_t marks;

static const uint8_t PREFIX[ROS_PREFIX_SIZE] = {1, 16, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
static const uint8_t WRITER[4] = {0, 0, 0x12, 0x03};

void setUp(void) {
    memset(&caller, 0xA5, sizeof caller);
    memset(out, 0xA5, sizeof out);
    memset(&marks, 0, sizeof marks);
    memcpy(marks.prefix, PREFIX, sizeof PREFIX);
    memcpy(marks.writers[1].id, WRITER, sizeof WRITER);
    length = 0;
}

static void put(const uint8_t *bytes, size_t count) {
    memcpy(message + length, bytes, count);
    length += count;
}

static void begin_message(void) {
    static const uint8_t header[8] = {'R', 'T', 'P', 'S', 2, 1, 1, 16};
    put(header, sizeof header);
    put(PREFIX, sizeof PREFIX);
}

/// Adds a DATA submessage of WRITER with this number, this inline QoS (NULL: none) and a payload of 8 bytes.
static void put_data(bool little, uint8_t number, const uint8_t *qos, size_t qos_size) {
    const uint8_t rest = (uint8_t)(20U + qos_size + 8U);
    const uint8_t header[8] = {0x15,
                               (uint8_t)((little ? 1U : 0U) | 4U | ((qos != NULL) ? 2U : 0U)),
                               little ? rest : 0,
                               little ? 0 : rest,
                               0,
                               0,
                               little ? 16 : 0,
                               little ? 0 : 16};
    const uint8_t reader[4] = {0};
    const uint8_t sequence[8] = {0, 0, 0, 0, little ? number : 0, 0, 0, little ? 0 : number};
    const uint8_t payload[8] = {0, 1, 0, 0, 'd', 'a', 't', 'a'};
    put(header, sizeof header);
    put(reader, sizeof reader);
    put(WRITER, sizeof WRITER);
    put(sequence, sizeof sequence);
    if (qos != NULL) {
        put(qos, qos_size);
    }
    put(payload, sizeof payload);
}

static void put_heartbeat(void) {
    const uint8_t heartbeat[32] = {7, 1, 28};
    put(heartbeat, sizeof heartbeat);
}

// ---- requests -------------------------------------------------------------------------------------------------------

TEST(test_service_request_of_fast_dds_has_one_byte) {
    const uint8_t payload[8] = {0, 1, 0, 0, 0};
    caller.number = 7;
    ros_service_read(payload, 5, &caller);
    TEST_ASSERT_EQUAL_INT(ROS_FORM_IDENTITY, caller.form);
    TEST_ASSERT_EQUAL_INT64(7, caller.number);
    ros_service_read(payload, 8, &caller);
    TEST_ASSERT_EQUAL_INT(ROS_FORM_IDENTITY, caller.form);
}

TEST(test_service_request_of_cyclonedds_has_either_byte_order) {
    const uint8_t guid[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    const uint8_t little[24] = {0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 0, 0, 1};
    const uint8_t big[24] = {0, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 0, 0, 0, 1, 0, 0, 0, 9};
    ros_service_read(little, 21, &caller);
    TEST_ASSERT_EQUAL_INT(ROS_FORM_HEADER, caller.form);
    TEST_ASSERT_EQUAL_MEMORY(guid, caller.guid, sizeof guid);
    TEST_ASSERT_EQUAL_INT64(0x100000009LL, caller.number);
    ros_service_read(big, 24, &caller);
    TEST_ASSERT_EQUAL_INT(ROS_FORM_HEADER, caller.form);
    TEST_ASSERT_EQUAL_MEMORY(guid, caller.guid, sizeof guid);
    TEST_ASSERT_EQUAL_INT64(0x100000009LL, caller.number);
}

TEST(test_service_request_of_another_type_is_unreadable) {
    static const size_t sizes[] = {0, 1, 4, 9, 20, 25, 64};
    const uint8_t payload[64] = {0, 1, [12] = 1}; // With the size of a header, a request of number 1.
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        caller.form = ROS_FORM_HEADER;
        ros_service_read(payload, sizes[i], &caller);
        TEST_ASSERT_EQUAL_INT_MESSAGE(ROS_FORM_UNREADABLE, caller.form, "by its size");
    }
    static const uint8_t text[21] = "\0\1\0\0\15\0\0\0another type";
    static const uint8_t zero[21] = {0, 1};
    ros_service_read(text, sizeof text, &caller);
    TEST_ASSERT_EQUAL_INT_MESSAGE(ROS_FORM_UNREADABLE, caller.form, "by its number");
    ros_service_read(zero, sizeof zero, &caller);
    TEST_ASSERT_EQUAL_INT_MESSAGE(ROS_FORM_UNREADABLE, caller.form, "by its number");
    const uint8_t other[2][8] = {{0, 2}, {1, 1}};
    for (size_t i = 0; i < 2U; i++) {
        ros_service_read(other[i], 5, &caller);
        TEST_ASSERT_EQUAL_INT_MESSAGE(ROS_FORM_UNREADABLE, caller.form, "by its encoding");
    }
}

// ---- sample identity ------------------------------------------------------------------------------------------------

TEST(test_service_identity_is_the_writer_and_the_number) {
    for (unsigned little = 0; little < 2U; little++) {
        setUp();
        begin_message();
        put_data(little == 1U, 5, NULL, 0);
        TEST_ASSERT_TRUE(ros_service_identify(message, length, 20, &caller));
        TEST_ASSERT_EQUAL_MEMORY(PREFIX, caller.guid, sizeof PREFIX);
        TEST_ASSERT_EQUAL_MEMORY(WRITER, caller.guid + sizeof PREFIX, sizeof WRITER);
        TEST_ASSERT_EQUAL_INT64(5, caller.number);
    }
}

TEST(test_service_identity_in_inline_qos_has_priority) {
    static const uint8_t kinds[2][2] = {{0x83, 0}, {0x0F, 0x80}};
    for (unsigned i = 0; i < 2U; i++) {
        uint8_t qos[40] = {0x71, 0, 4, 0, 0, 0, 0, 1, kinds[i][0], kinds[i][1], 24, 0, 'c', 'l', 'i', 'e', 'n', 't'};
        qos[36] = 1; // End of the list of parameters.
        setUp();
        begin_message();
        put_data(true, 6, qos, sizeof qos);
        TEST_ASSERT_TRUE(ros_service_identify(message, length, 20, &caller));
        TEST_ASSERT_EQUAL_MEMORY("client\0\0\0\0\0\0\0\0\0", caller.guid, ROS_GUID_SIZE);
        TEST_ASSERT_EQUAL_INT64(6, caller.number);
    }
}

TEST(test_service_identity_of_a_damaged_message_is_none) {
    const uint8_t endless[8] = {0x83, 0, 0xFF, 0xFF, 1, 2, 3, 4};
    begin_message();
    put_data(true, 6, endless, sizeof endless);
    for (size_t size = 0; size < length; size++) {
        TEST_ASSERT_FALSE(ros_service_identify(message, size, 20, &caller));
        TEST_ASSERT_EQUAL_INT64(0, caller.number);
    }
    TEST_ASSERT_TRUE(ros_service_identify(message, length, 20, &caller));
    TEST_ASSERT_EQUAL_MEMORY(PREFIX, caller.guid, sizeof PREFIX);
    TEST_ASSERT_FALSE(ros_service_identify(message, length, 0, &caller));
    message[26] = 0xFF; // The inline QoS would start after the end of the message.
    TEST_ASSERT_FALSE(ros_service_identify(message, length, 20, &caller));
}

// ---- replies --------------------------------------------------------------------------------------------------------

TEST(test_service_reply_of_fast_dds_is_flag_and_text) {
    const uint8_t wanted[] = {0, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 'o', 'k', 0};
    caller.form = ROS_FORM_IDENTITY;
    TEST_ASSERT_EQUAL_size_t(sizeof wanted, ros_service_write(&caller, true, "ok", out, sizeof out));
    TEST_ASSERT_EQUAL_MEMORY(wanted, out, sizeof wanted);
}

TEST(test_service_reply_of_cyclonedds_begins_with_the_header) {
    const uint8_t wanted[] = {0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0};
    const uint8_t guid[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    memcpy(caller.guid, guid, sizeof guid);
    caller.form = ROS_FORM_HEADER;
    caller.number = 0x100000009LL;
    TEST_ASSERT_EQUAL_size_t(sizeof wanted, ros_service_write(&caller, false, "", out, sizeof out));
    TEST_ASSERT_EQUAL_MEMORY(wanted, out, sizeof wanted);
}

TEST(test_service_reply_that_does_not_fit_is_cut) {
    caller.form = ROS_FORM_HEADER;
    for (size_t size = 40; size < 100U; size++) {
        memset(out, 0xA5, sizeof out);
        const size_t used = ros_service_write(
            &caller, true, "a text that is much longer than the space for it in the message", out, size);
        TEST_ASSERT_LESS_OR_EQUAL_size_t(size, used);
        TEST_ASSERT_EQUAL_HEX8(0, out[used - 1U]);
        TEST_ASSERT_EQUAL_HEX8(0xA5, out[size]);
    }
}

// ---- additions ------------------------------------------------------------------------------------------------------

static void note(ros_form_t form, uint8_t last) {
    ros_caller_t of = {.form = form, .number = 0x100000002LL};
    memset(of.guid, last, sizeof of.guid);
    ros_service_note(&marks, 1, &of);
}

static size_t mark(void) {
    return ros_service_mark(&marks, message, length, out, sizeof out);
}

TEST(test_service_mark_names_the_caller_in_the_reply) {
    for (unsigned little = 0; little < 2U; little++) {
        setUp();
        note(ROS_FORM_IDENTITY, 0x77);
        begin_message();
        put_heartbeat();
        put_data(little == 1U, 1, NULL, 0);
        put_heartbeat();
        TEST_ASSERT_EQUAL_size_t(length + ROS_MARK_SIZE, mark());
        TEST_ASSERT_EQUAL_MEMORY(message, out, 53);                         // Bytes before the flags are equal,
        TEST_ASSERT_EQUAL_HEX8(message[53] | 2U, out[53]);                  // the flags have the bit of inline QoS,
        TEST_ASSERT_EQUAL_HEX8(28U + ROS_MARK_SIZE, out[little ? 54 : 55]); // and the length has grown.
        TEST_ASSERT_TRUE(ros_service_identify(out, length + ROS_MARK_SIZE, 52, &caller));
        TEST_ASSERT_EACH_EQUAL_HEX8(0x77, caller.guid, ROS_GUID_SIZE);
        const uint8_t little_number[8] = {1, 0, 0, 0, 2, 0, 0, 0};
        const uint8_t big_number[8] = {0, 0, 0, 1, 0, 0, 0, 2};
        TEST_ASSERT_EQUAL_MEMORY(little ? little_number : big_number, out + 52 + 24 + 20, 8);
        TEST_ASSERT_EQUAL_MEMORY(little ? little_number : big_number, out + 52 + 24 + 28 + 20, 8);
        // Payload and later bytes are equal.
        TEST_ASSERT_EQUAL_MEMORY(message + 76, out + 76 + ROS_MARK_SIZE, 8U + 32U);
    }
}

TEST(test_service_mark_reads_submessages_without_a_length) {
    const uint8_t without_time[4] = {0x09, 3, 0, 0};
    note(ROS_FORM_IDENTITY, 0x77);
    begin_message();
    put(without_time, sizeof without_time);
    put_data(true, 1, NULL, 0);
    message[26] = 0; // Length 0: the last submessage extends to the end.
    TEST_ASSERT_EQUAL_size_t(length + ROS_MARK_SIZE, mark());
}

TEST(test_service_mark_retains_existing_inline_qos) {
    const uint8_t qos[12] = {0x71, 0, 4, 0, 0, 0, 0, 1, 1, 0, 0, 0};
    note(ROS_FORM_UNREADABLE, 0x77);
    begin_message();
    put_data(true, 1, qos, sizeof qos);
    TEST_ASSERT_EQUAL_size_t(length + ROS_MARK_SIZE - 4U, mark());
    TEST_ASSERT_EQUAL_MEMORY(qos, out + 20 + 24 + 56, sizeof qos);
    TEST_ASSERT_TRUE(ros_service_identify(out, length + ROS_MARK_SIZE - 4U, 20, &caller));
    TEST_ASSERT_EACH_EQUAL_HEX8(0x77, caller.guid, ROS_GUID_SIZE);
}

TEST(test_service_mark_does_not_change_other_messages) {
    begin_message();
    put_data(true, 1, NULL, 0);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, mark(), "nothing was noted");
    note(ROS_FORM_HEADER, 0x77);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, mark(), "its caller has a header");
    note(ROS_FORM_IDENTITY, 0x77);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, mark(), "still the first");
    length = 0;
    begin_message();
    put_data(true, 2, NULL, 0);
    TEST_ASSERT_GREATER_THAN_size_t(0, mark());
    marks.writers[1].id[3] = 4;
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, mark(), "of another writer");
    marks.writers[1].id[3] = 3;
    marks.prefix[0] = 2;
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, mark(), "of another participant");
    marks.prefix[0] = 1;
    message[0] = 'X';
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, mark(), "no RTPS");
}

TEST(test_service_mark_is_stored_for_the_newest_callers_only) {
    for (uint8_t i = 1; i <= ROS_MARKS + 2U; i++) {
        note(ROS_FORM_IDENTITY, i);
    }
    for (uint8_t i = 1; i <= ROS_MARKS + 4U; i++) {
        length = 0;
        begin_message();
        put_data(true, i, NULL, 0);
        const bool stored = i > 2U && i <= ROS_MARKS + 2U;
        TEST_ASSERT_EQUAL_size_t(stored ? length + ROS_MARK_SIZE : 0U, mark());
        if (stored) {
            TEST_ASSERT_TRUE(ros_service_identify(out, sizeof out, 20, &caller));
            TEST_ASSERT_EACH_EQUAL_HEX8(i, caller.guid, ROS_GUID_SIZE);
        }
    }
}

TEST(test_service_mark_of_a_damaged_message_is_none) {
    note(ROS_FORM_IDENTITY, 0x77);
    begin_message();
    put_heartbeat();
    put_data(true, 1, NULL, 0);
    const size_t whole = length;
    for (length = 0; length < whole; length++) {
        TEST_ASSERT_EQUAL_size_t(0, mark());
    }
    for (size_t capacity = 0; capacity < whole + ROS_MARK_SIZE; capacity++) {
        TEST_ASSERT_EQUAL_size_t(0, ros_service_mark(&marks, message, whole, out, capacity));
    }
    TEST_ASSERT_EQUAL_size_t(whole + ROS_MARK_SIZE,
                             ros_service_mark(&marks, message, whole, out, whole + ROS_MARK_SIZE));
}
