// SPDX-License-Identifier: MIT
// Requests that wait between a client and a board: in order, bounded, replaced by newer ones, never sent late.
#include "serial_queue.h"

#include "unit.h"

#include <string.h>

#define NOW  1000000U
#define HOLD 60000U

static serial_queue_t queue;
static uint64_t number;

void setUp(void) {
    serial_queue_init(&queue, HOLD);
    number = 0;
}

static serial_request_t *put(serial_kind_t kind, uint64_t came_us) {
    serial_request_t *place = serial_queue_place(&queue);
    *place = (serial_request_t){.kind = kind, .number = ++number, .came_us = came_us, .length = 2, .json = "{}"};
    serial_queue_put(&queue);
    return place;
}

/// Returns the request that is sent now; NULL: none.
static serial_request_t *send_next(uint64_t now_us) {
    serial_request_t *next = serial_queue_next(&queue, now_us);
    if (next != NULL) {
        serial_queue_sent(next, now_us);
    }
    return next;
}

static bool answered(uint64_t which) {
    return serial_queue_take(&queue, which, true, "}", 1);
}

TEST(test_queue_kind_of_each_command_is_that_of_its_effect) {
    TEST_ASSERT_EQUAL_INT(SERIAL_MOVES, serial_kind_of(IWN_CMD_DRIVE));
    TEST_ASSERT_EQUAL_INT(SERIAL_MOVES, serial_kind_of(IWN_CMD_TWIST));
    TEST_ASSERT_EQUAL_INT(SERIAL_STOPS, serial_kind_of(IWN_CMD_STOP));
    TEST_ASSERT_EQUAL_INT(SERIAL_STOPS, serial_kind_of(IWN_CMD_DISARM));
    TEST_ASSERT_EQUAL_INT(SERIAL_STOPS, serial_kind_of(IWN_CMD_ESTOP));
    TEST_ASSERT_EQUAL_INT(SERIAL_GRANTS, serial_kind_of(IWN_CMD_ARM));
    TEST_ASSERT_EQUAL_INT(SERIAL_GRANTS, serial_kind_of(IWN_CMD_RESET));
    TEST_ASSERT_EQUAL_INT(SERIAL_ASKS, serial_kind_of(IWN_CMD_STATUS));
}

TEST(test_queue_sends_the_next_request_after_the_reply) {
    serial_request_t *first = put(SERIAL_ASKS, NOW);
    serial_request_t *second = put(SERIAL_ASKS, NOW);
    TEST_ASSERT_EQUAL_PTR(first, send_next(NOW));
    TEST_ASSERT_NULL(send_next(NOW));
    TEST_ASSERT_TRUE(answered(first->number));
    serial_queue_drop(&queue);
    TEST_ASSERT_EQUAL_PTR(second, send_next(NOW));
}

TEST(test_queue_newer_command_replaces_the_waiting_one_only) {
    const serial_request_t *sent = put(SERIAL_MOVES, NOW);
    (void)send_next(NOW);
    const serial_request_t *waits = put(SERIAL_MOVES, NOW + 1U);
    const serial_request_t *newest = put(SERIAL_MOVES, NOW + 2U);
    TEST_ASSERT_EQUAL_INT(SERIAL_SENT, sent->state);
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, waits->state);
    TEST_ASSERT_EQUAL_INT(IWN_STALE_COMMAND, waits->error);
    TEST_ASSERT_NOT_NULL(strstr(waits->reason, "replaced"));
    TEST_ASSERT_EQUAL_INT(SERIAL_WAITING, newest->state);
    TEST_ASSERT_NULL(send_next(NOW + 3U));
}

TEST(test_queue_replies_are_in_the_order_of_the_requests) {
    (void)put(SERIAL_MOVES, NOW);
    (void)send_next(NOW);
    (void)put(SERIAL_MOVES, NOW);
    (void)put(SERIAL_MOVES, NOW);
    TEST_ASSERT_NULL(serial_queue_answered(&queue));
    TEST_ASSERT_TRUE(answered(1));
    serial_queue_drop(&queue);
    TEST_ASSERT_EQUAL_UINT(2, serial_queue_answered(&queue)->number);
    serial_queue_drop(&queue);
    TEST_ASSERT_NULL(serial_queue_answered(&queue));
    TEST_ASSERT_EQUAL_UINT(3, send_next(NOW)->number);
}

/// A stop, which the relay sends.
static serial_request_t *put_stop(void) {
    serial_request_t *place = serial_queue_place(&queue);
    *place = (serial_request_t){.state = SERIAL_SENT, .kind = SERIAL_STOPS, .number = ++number, .sent_us = NOW};
    serial_queue_put(&queue);
    return place;
}

TEST(test_queue_earlier_motion_is_refused_at_a_stop) {
    (void)put(SERIAL_ASKS, NOW);
    (void)send_next(NOW);
    const serial_request_t *arm = put(SERIAL_GRANTS, NOW);
    const serial_request_t *drive = put(SERIAL_MOVES, NOW);
    const serial_request_t *question = put(SERIAL_ASKS, NOW);
    serial_queue_overtake(&queue, SERIAL_STOPS);
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, arm->state);
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, drive->state);
    TEST_ASSERT_EQUAL_INT(SERIAL_WAITING, question->state);
}

TEST(test_queue_stop_is_not_sent_from_the_queue_and_refuses_earlier_motion) {
    (void)put(SERIAL_ASKS, NOW);
    (void)send_next(NOW);
    const serial_request_t *arm = put(SERIAL_GRANTS, NOW);
    const serial_request_t *stop = put_stop();
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, arm->state);
    TEST_ASSERT_NULL(send_next(NOW));
    TEST_ASSERT_EQUAL_UINT(NOW + SERIAL_PATIENCE_US, serial_queue_next_us(&queue, NOW));
    serial_queue_age(&queue, NOW + SERIAL_PATIENCE_US);
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, stop->state);
    TEST_ASSERT_EQUAL_INT(IWN_INTERNAL, stop->error);
}

TEST(test_queue_early_reply_waits_for_its_turn) {
    (void)put(SERIAL_ASKS, NOW);
    (void)send_next(NOW);
    const serial_request_t *stop = put_stop();
    TEST_ASSERT_TRUE(serial_queue_take(&queue, stop->number, true, ",\"state\":\"stopping\"}", 20));
    TEST_ASSERT_EQUAL_INT(SERIAL_HELD, stop->state);
    TEST_ASSERT_NULL(serial_queue_answered(&queue));
    TEST_ASSERT_TRUE(answered(1));
    serial_queue_drop(&queue);
    TEST_ASSERT_EQUAL_PTR(stop, serial_queue_answered(&queue));
    TEST_ASSERT_EQUAL_STRING_LEN(",\"state\":\"stopping\"}", stop->json, stop->length);
}

TEST(test_queue_command_that_waited_too_long_is_refused) {
    (void)put(SERIAL_ASKS, NOW);
    (void)send_next(NOW);
    const serial_request_t *drive = put(SERIAL_MOVES, NOW);
    TEST_ASSERT_EQUAL_UINT(NOW + SERIAL_FRESH_US, serial_queue_next_us(&queue, NOW));
    serial_queue_age(&queue, NOW + SERIAL_FRESH_US - 1U);
    TEST_ASSERT_EQUAL_INT(SERIAL_WAITING, drive->state);
    serial_queue_age(&queue, NOW + SERIAL_FRESH_US);
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, drive->state);
    TEST_ASSERT_EQUAL_INT(IWN_STALE_COMMAND, drive->error);
    TEST_ASSERT_TRUE(answered(1));
    TEST_ASSERT_NULL(send_next(NOW + SERIAL_FRESH_US));
}

TEST(test_queue_lost_reply_delays_the_next_command_by_hold_time) {
    (void)put(SERIAL_MOVES, NOW);
    (void)send_next(NOW);
    (void)put(SERIAL_MOVES, NOW + 10000U);
    TEST_ASSERT_NULL(send_next(NOW + HOLD - 1U));
    TEST_ASSERT_EQUAL_UINT(NOW + HOLD, serial_queue_next_us(&queue, NOW));
    TEST_ASSERT_EQUAL_UINT(2, send_next(NOW + HOLD)->number);
    serial_queue_age(&queue, NOW + SERIAL_MOVE_PATIENCE_US);
    TEST_ASSERT_EQUAL_UINT(1, serial_queue_answered(&queue)->number);
    TEST_ASSERT_EQUAL_UINT(1, queue.unanswered);
}

TEST(test_queue_lost_reply_uses_no_place_after_the_next_one) {
    const serial_request_t *lost = put(SERIAL_MOVES, NOW);
    (void)send_next(NOW);
    const serial_request_t *replaced = put(SERIAL_MOVES, NOW);
    const serial_request_t *drive = put(SERIAL_MOVES, NOW + HOLD);
    TEST_ASSERT_EQUAL_PTR(drive, send_next(NOW + HOLD));
    TEST_ASSERT_TRUE(answered(drive->number));
    TEST_ASSERT_EQUAL_INT(SERIAL_ANSWERED, lost->state);
    TEST_ASSERT_EQUAL_INT(IWN_STALE_COMMAND, lost->error);
    TEST_ASSERT_NOT_NULL(strstr(replaced->reason, "replaced"));
    for (unsigned i = 0; i < 3U; i++) {
        TEST_ASSERT_NOT_NULL(serial_queue_answered(&queue));
        serial_queue_drop(&queue);
    }
    TEST_ASSERT_NULL(serial_queue_answered(&queue));
}

TEST(test_queue_reply_without_a_request_is_rejected) {
    (void)put(SERIAL_ASKS, NOW);
    TEST_ASSERT_FALSE(answered(1));
    (void)send_next(NOW);
    TEST_ASSERT_FALSE(answered(7));
    serial_queue_age(&queue, NOW + SERIAL_PATIENCE_US);
    TEST_ASSERT_FALSE(answered(1));
    TEST_ASSERT_EQUAL_INT(IWN_INTERNAL, serial_queue_answered(&queue)->error);
}

TEST(test_queue_full_refuses_until_it_is_drained) {
    for (unsigned round = 0; round < 3U; round++) {
        for (unsigned i = 0; i < SERIAL_QUEUE_SIZE; i++) {
            TEST_ASSERT_FALSE(serial_queue_is_full(&queue));
            (void)put(SERIAL_ASKS, NOW);
        }
        TEST_ASSERT_TRUE(serial_queue_is_full(&queue));
        for (unsigned i = 0; i < SERIAL_QUEUE_SIZE; i++) {
            const serial_request_t *sent = send_next(NOW);
            TEST_ASSERT_NOT_NULL(sent);
            TEST_ASSERT_TRUE(answered(sent->number));
            serial_queue_drop(&queue);
        }
        TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, serial_queue_next_us(&queue, NOW));
    }
}
