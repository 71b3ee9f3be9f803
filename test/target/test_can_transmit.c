// SPDX-License-Identifier: MIT
// Mailboxes, echoes, replacement and abort: bxCAN 7.1 and M_CAN 3.5, and the contract of the port in iwheel/hal.h.
#include "can_rig.h"
#include "unit.h"

void setUp(void) {
    rig_reset();
    rig_start(0);
}

/// A frame is accepted, leaves, and has its echo, the only one.
static void assert_sent(uint32_t id, uint8_t mark) {
    TEST_ASSERT_EQUAL(1, rig_send(id, mark));
    rig_assert_on_bus(id, mark);
    rig_assert_echo(id, mark);
    rig_assert_no_echo();
}

TEST(test_sent_frame_has_the_same_bytes) {
    const uint8_t bytes[8] = {0x81, 0x02, 0xF3, 0x04, 0x95, 0x06, 0xA7, 0x08};
    iw_can_frame_t frame = {.id = 0x7FF, .dlc = 8};
    model_frame_t on_bus;
    for (size_t i = 0; i < 8; i++) {
        frame.data[i] = bytes[i];
    }
    TEST_ASSERT_EQUAL(1, can_send(driver, &frame, 1));
    TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
    TEST_ASSERT_EQUAL(0x7FF, on_bus.id);
    TEST_ASSERT_EQUAL(0, on_bus.extended);
    TEST_ASSERT_EQUAL(0, on_bus.remote);
    TEST_ASSERT_EQUAL(8, on_bus.dlc);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, on_bus.data, 8);
}

TEST(test_sent_frame_may_have_any_dlc) {
    for (uint8_t dlc = 0; dlc <= 8; dlc++) {
        const iw_can_frame_t frame = {.id = 266, .dlc = dlc};
        model_frame_t on_bus;
        TEST_ASSERT_EQUAL(1, can_send(driver, &frame, 1));
        TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
        TEST_ASSERT_EQUAL(dlc, on_bus.dlc);
    }
}

TEST(test_send_of_other_than_a_standard_data_frame_is_refused) {
    const iw_can_frame_t wrong[] = {
        {.id = 266U | IW_CAN_EXTENDED, .dlc = 5},
        {.id = 266U | IW_CAN_REMOTE, .dlc = 5},
        {.id = 266U | IW_CAN_ERROR, .dlc = 5},
        {.id = 0x800, .dlc = 5},
        {.id = 266, .dlc = 9},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_LESS_THAN(0, can_send(driver, &wrong[i], 1));
    }
    rig_assert_nothing_waits();
}

TEST(test_echo_is_created_only_by_the_acknowledgement) {
    model_frame_t frame;
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    rig_assert_no_echo();
    for (int i = 0; i < 50; i++) {
        (void)rig_attempt_next(0, (i % 2 == 0) ? MODEL_NO_ACKNOWLEDGEMENT : MODEL_LOST_ARBITRATION, &frame);
        rig_assert_no_echo();
    }
    rig_assert_on_bus(266, 1);
    rig_assert_echo(266, 1);
    rig_assert_no_echo();
}

TEST(test_left_frame_is_sent_before_the_right_in_any_order) {
    (void)rig_send(298, 2);
    (void)rig_send(266, 1);
    rig_assert_on_bus(266, 1);
    rig_assert_on_bus(298, 2);
    rig_assert_echo(266, 1);
    rig_assert_echo(298, 2);
}

/// Bytes and id of every mailbox are written before the first one is requested: the mailbox of the left frame is not
/// pending yet when the data of the right frame is written.
static uint32_t written[64];
static uint32_t writes;

static void note_write(uint32_t offset) {
    if (RIG_IS_BUFFER(offset) || RIG_IS_REQUEST(offset)) {
        written[writes++ % 64U] = offset;
    }
}

static int send_pair(uint8_t left_mark, uint8_t right_mark) {
    const iw_can_frame_t pair[] = {rig_frame(266, left_mark), rig_frame(298, right_mark)};
    return can_send(driver, pair, 2);
}

TEST(test_pair_fills_both_mailboxes_before_it_requests_one) {
    writes = 0;
    rig[0].on_write = note_write;
    TEST_ASSERT_EQUAL(2, send_pair(1, 2));
    rig[0].on_write = NULL;
    TEST_ASSERT_GREATER_THAN(2, writes);
    for (uint32_t i = 0; i < writes; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(i >= writes - RIG_REQUESTS, RIG_IS_REQUEST(written[i]), "requests come last");
    }
    rig_assert_on_bus(266, 1);
    rig_assert_on_bus(298, 2);
    rig_assert_nothing_waits();
    rig_assert_echo(266, 1);
    rig_assert_echo(298, 2);
    rig_assert_no_echo();
}

TEST(test_pair_replaces_the_waiting_pair) {
    TEST_ASSERT_EQUAL(2, send_pair(1, 2));
    TEST_ASSERT_EQUAL(2, send_pair(3, 4));
    TEST_ASSERT_EQUAL(0, send_pair(5, 6));
    rig_assert_on_bus(266, 3);
    rig_assert_on_bus(298, 4);
    rig_assert_nothing_waits();
    rig_assert_echo(266, 1);
    rig_assert_echo(266, 3);
    rig_assert_echo(298, 2);
    rig_assert_echo(298, 4);
    rig_assert_no_echo();
}

TEST(test_pair_with_a_wrong_frame_is_refused_completely) {
    const iw_can_frame_t left_wrong[] = {rig_frame(0x800, 1), rig_frame(298, 2)};
    const iw_can_frame_t right_wrong[] = {rig_frame(266, 1), rig_frame(0x800, 2)};
    TEST_ASSERT_LESS_THAN(0, can_send(driver, left_wrong, 2));
    TEST_ASSERT_LESS_THAN(0, can_send(driver, right_wrong, 2));
    rig_assert_idle();
}

TEST(test_pair_without_a_place_for_right_accepts_left_only) {
    (void)rig_send(298, 1);
    (void)rig_send(298, 2);
    TEST_ASSERT_EQUAL(1, send_pair(3, 4));
    rig_assert_on_bus(266, 3);
    rig_assert_on_bus(298, 2);
    rig_assert_nothing_waits();
    rig_assert_echo(266, 3);
}

/// All waiting frames are sent when the interrupt has just been masked: the abort is too late.
static bool send_all_at_masking(uint32_t offset) {
    model_frame_t frame;
    while (offset == RIG_MASK_REGISTER && rig_attempt_next(0, MODEL_SENT, &frame)) {
    }
    return true;
}

/// Both old frames are sent while the new ones replace them: the mailbox of the first one is free again for the second
/// one.
TEST(test_pair_is_accepted_while_both_old_frames_are_sent) {
    TEST_ASSERT_EQUAL(2, send_pair(1, 2));
    rig[0].on_read = send_all_at_masking;
    TEST_ASSERT_EQUAL(2, send_pair(3, 4));
    rig[0].on_read = NULL;
    rig_assert_echo(266, 1);
    rig_assert_echo(298, 2);
    rig_assert_no_echo();
    rig_assert_on_bus(266, 3);
    rig_assert_on_bus(298, 4);
    rig_assert_nothing_waits();
    rig_assert_echo(266, 3);
    rig_assert_echo(298, 4);
    rig_assert_no_echo();
}

TEST(test_send_call_accepts_no_more_frames_than_wheels) {
    const iw_can_frame_t three[] = {rig_frame(266, 1), rig_frame(298, 2), rig_frame(300, 3)};
    TEST_ASSERT_EQUAL(2, can_send(driver, three, 3));
    rig_assert_on_bus(266, 1);
    rig_assert_on_bus(298, 2);
    rig_assert_nothing_waits();
}

TEST(test_newer_frame_replaces_the_waiting_one) {
    (void)rig_send(266, 1);
    (void)rig_send(298, 1);
    TEST_ASSERT_EQUAL(1, rig_send(266, 2));
    rig_assert_on_bus(266, 2);
    rig_assert_on_bus(298, 1);
    rig_assert_nothing_waits();
    rig_assert_echo(266, 1); // One echo for each accepted frame, with its own bytes,
    rig_assert_echo(266, 2); // after the newer frame was acknowledged.
    rig_assert_echo(298, 1);
    rig_assert_no_echo();
}

TEST(test_third_frame_of_an_id_must_wait_and_changes_nothing) {
    (void)rig_send(298, 1);
    (void)rig_send(298, 2);
    TEST_ASSERT_EQUAL(0, rig_send(298, 3));
    rig_assert_on_bus(298, 2);
    rig_assert_nothing_waits();
    rig_assert_echo(298, 1);
    rig_assert_echo(298, 2);
    rig_assert_no_echo();
    TEST_ASSERT_EQUAL(1, rig_send(298, 3));
}

static void end_frame_on_bus(model_end_t end) {
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        if (RIG_IS_ON_BUS(model, i)) {
            can_model_end(model, i, end);
        }
    }
}

/// The frame under way ends while the driver polls TSR.
static bool send_frame_at_poll(uint32_t offset) {
    if (offset != RIG_POLL_REGISTER) {
        return true;
    }
    end_frame_on_bus(MODEL_SENT);
    return false;
}

static bool lose_frame_at_poll(uint32_t offset) {
    if (offset != RIG_POLL_REGISTER) {
        return true;
    }
    end_frame_on_bus(MODEL_BIT_ERROR);
    return false;
}

static void begin_first(void) {
    model_frame_t frame;
    can_model_begin(model, can_model_offer(model, &frame));
}

TEST(test_old_frame_sent_during_its_replacement_has_its_own_echo) {
    (void)rig_send(266, 1);
    begin_first();
    rig[0].on_read = send_frame_at_poll;
    TEST_ASSERT_EQUAL(1, rig_send(266, 2));
    rig_assert_echo(266, 1);
    rig_assert_no_echo();
    rig_assert_on_bus(266, 2);
    rig_assert_echo(266, 2);
    rig_assert_no_echo();
}

TEST(test_old_frame_failed_during_its_replacement_is_not_sent) {
    (void)rig_send(266, 1);
    begin_first();
    rig[0].on_read = lose_frame_at_poll;
    TEST_ASSERT_EQUAL(1, rig_send(266, 2));
    rig_assert_no_echo();
    rig_assert_on_bus(266, 2);
    rig_assert_nothing_waits();
    rig_assert_echo(266, 1);
    rig_assert_echo(266, 2);
    rig_assert_no_echo();
}

static void join_again(void) {
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, can_bus_state(driver));
    rig_assert_joins(0);
}

TEST(test_frame_that_never_ends_has_a_bounded_wait) {
    (void)rig_send(266, 1);
    begin_first();
    TEST_ASSERT_EQUAL(0, rig_send(266, 2));
    end_frame_on_bus(MODEL_BIT_ERROR);
    rig_serve(0);
    rig_assert_idle();
    assert_sent(266, 3);
}

TEST(test_purge_that_does_not_end_resets_the_controller) {
    (void)rig_send(266, 1);
    (void)rig_send(298, 1);
    begin_first();
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    TEST_ASSERT_EQUAL(1, driver->resets);
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, rig[0].reset, "the device is let go again");
    TEST_ASSERT_LESS_THAN(0, rig_send(266, 2));
    join_again();
    rig_assert_idle();
    assert_sent(266, 3);
}

/// The frame was sent and acknowledged, but the core has not read its echo yet when the other frame must be purged by
/// force.
TEST(test_purge_with_a_reset_drops_earlier_echoes) {
    iw_can_frame_t echo;
    (void)rig_send(266, 1);
    rig_assert_on_bus(266, 1);
    (void)rig_send(298, 1);
    model->abort_reads = UINT32_MAX;
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    TEST_ASSERT_EQUAL(1, driver->resets);
    TEST_ASSERT_EQUAL(-1, can_receive(driver, &echo));
}

TEST(test_purge_of_a_controller_that_ignores_aborts_resets_it) {
    (void)rig_send(266, 1);
    model->abort_reads = UINT32_MAX;
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    rig_assert_nothing_waits();
    join_again();
    rig_assert_nothing_waits();
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    TEST_ASSERT_EQUAL(1, driver->resets);
}

TEST(test_purge_on_a_dominant_bus_leaves_no_frame) {
    (void)rig_send(266, 1);
    (void)rig_send(298, 1);
    begin_first();
    end_frame_on_bus(MODEL_BIT_ERROR);
    can_model_hold(model, 50, true);
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    TEST_ASSERT_EQUAL(0, driver->resets);
    rig_assert_active_after(0, 11);
    rig_assert_idle();
}

/// ALST and TERR of an attempt stay readable after the abort of the mailbox. They are no echo, and they do not block
/// the next frame.
TEST(test_failed_attempts_before_an_abort_are_no_echo) {
    const model_end_t ends[] = {MODEL_LOST_ARBITRATION, MODEL_BIT_ERROR, MODEL_NO_ACKNOWLEDGEMENT};
    for (size_t i = 0; i < 3; i++) {
        model_frame_t frame;
        (void)rig_send(266, 1);
        (void)rig_attempt_next(0, ends[i], &frame);
#ifndef IWHEEL_RIG_FDCAN
        TEST_ASSERT_NOT_EQUAL(0, model->tsr & (0x0C0C0CU));
#endif
        TEST_ASSERT_EQUAL(1, can_purge(driver));
        rig_assert_no_echo();
        assert_sent(266, 2);
    }
}

TEST(test_slow_abort_is_waited_for) {
    model->abort_reads = 20;
    (void)rig_send(266, 1);
    TEST_ASSERT_EQUAL(1, rig_send(266, 2));
    rig_assert_on_bus(266, 2);
    rig_assert_nothing_waits();
}

TEST(test_fourth_frame_waits_for_a_free_mailbox) {
    (void)rig_send(266, 1);
    (void)rig_send(298, 1);
    TEST_ASSERT_EQUAL(1, rig_send(300, 1));
    TEST_ASSERT_EQUAL(0, rig_send(301, 1));
    rig_assert_on_bus(266, 1);
    TEST_ASSERT_EQUAL(1, rig_send(301, 1));
}

TEST(test_purge_aborts_all_frames) {
    (void)rig_send(266, 1);
    (void)rig_send(298, 1);
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    rig_assert_idle();
    assert_sent(266, 2);
}

TEST(test_echo_from_before_a_purge_is_dropped) {
    (void)rig_send(266, 1);
    rig_assert_on_bus(266, 1);
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    rig_assert_no_echo();
}

TEST(test_purge_retains_received_frames) {
    iw_can_frame_t frame;
    (void)rig_hear(0, 256, 4);
    (void)can_purge(driver);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &frame));
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, frame.kind);
}

TEST(test_frame_completed_during_a_purge_has_no_echo) {
    (void)rig_send(266, 1);
    begin_first();
    rig[0].on_read = send_frame_at_poll;
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    rig_assert_idle();
    assert_sent(266, 2);
}

static int mailbox_of(uint32_t id) {
    int found = MODEL_NONE;
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        found = (RIG_IS_PENDING(model, i) && RIG_ID_OF(model, i) == id) ? i : found;
    }
    TEST_ASSERT_NOT_EQUAL(MODEL_NONE, found);
    return found;
}

/// The right frame is sent when the interrupt has just been masked and no frame was aborted yet.
static bool send_right_at_masking(uint32_t offset) {
    if (offset != RIG_MASK_REGISTER) {
        return true;
    }
    const int mailbox = mailbox_of(298);
    can_model_begin(model, mailbox);
    can_model_end(model, mailbox, MODEL_SENT);
    return false;
}

static void fill_mailboxes(void) {
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    TEST_ASSERT_EQUAL(1, rig_send(298, 1));
    TEST_ASSERT_EQUAL(1, rig_send(300, 1));
}

TEST(test_purge_of_three_full_mailboxes_empties_them_all) {
    fill_mailboxes();
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    TEST_ASSERT_EQUAL(0, driver->resets);
    rig_assert_nothing_waits();
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, can_bus_state(driver));
    fill_mailboxes();
}

TEST(test_purge_while_a_frame_completes_leaves_no_echo_or_frame) {
    fill_mailboxes();
    rig[0].on_read = send_right_at_masking;
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    rig_assert_idle();
    TEST_ASSERT_EQUAL(0, driver->resets);
}

TEST(test_completion_during_another_abort_has_its_echo) {
    fill_mailboxes();
    rig[0].on_read = send_right_at_masking;
    TEST_ASSERT_EQUAL(1, rig_send(266, 2));
    rig_assert_echo(298, 1);
    rig_assert_no_echo();
    rig_assert_on_bus(266, 2);
    rig_assert_on_bus(300, 1);
    rig_assert_echo(266, 1);
    rig_assert_echo(266, 2);
    rig_assert_echo(300, 1);
    TEST_ASSERT_EQUAL(1, rig_send(298, 2));
}

TEST(test_purge_of_an_idle_device_succeeds) {
    TEST_ASSERT_EQUAL(1, can_purge(driver));
    TEST_ASSERT_EQUAL(1, can_purge(driver));
}

TEST(test_send_and_receive_of_a_stopped_device_fail) {
    iw_can_frame_t frame;
    rig_init(0, false);
    TEST_ASSERT_LESS_THAN(0, can_receive(driver, &frame));
    TEST_ASSERT_LESS_THAN(0, rig_send(266, 1));
}

/// Random sends, transmissions, failures and purges: one echo with the bytes of each accepted frame, no echo without an
/// acknowledgement, and never an older frame after a newer one.
TEST(test_random_traffic_has_one_echo_for_each_frame) {
    uint32_t chance = 12345;
    uint8_t mark = 0;
    uint8_t newest_sent[2] = {0, 0};
    uint8_t marks[2][2] = {{0, 0}, {0, 0}};
    int open[2] = {0, 0};
    for (int i = 0; i < 200000; i++) {
        model_frame_t frame;
        iw_can_frame_t echo;
        chance = chance * 1664525U + 1013904223U;
        const uint32_t side = (chance >> 8) & 1U;
        switch ((chance >> 16) % 6U) {
        case 0:
        case 1:
            mark = (uint8_t)(mark % 100U + 1U);
            if (rig_send((side == 0U) ? 266U : 298U, mark) > 0) {
                TEST_ASSERT_LESS_THAN_MESSAGE(2, open[side], "a third frame is on its way");
                marks[side][open[side]++] = mark;
                newest_sent[side] = mark;
            }
            break;
        case 2:
        case 3:
            if (rig_send_next(0, &frame)) {
                TEST_ASSERT_EQUAL(newest_sent[frame.id == 298U], frame.data[0]);
            }
            break;
        case 4:
            if (rig_attempt_next(0, MODEL_BIT_ERROR, &frame)) {
                model->tec = 0;
            }
            break;
        default:
            if ((chance >> 24) % 16U == 0U) {
                TEST_ASSERT_EQUAL(1, can_purge(driver));
                open[0] = 0;
                open[1] = 0;
            }
            break;
        }
        while (can_receive(driver, &echo) > 0) {
            const bool right = echo.id == 298U;
            TEST_ASSERT_GREATER_THAN_MESSAGE(0, open[right], "an echo too many");
            TEST_ASSERT_EQUAL(marks[right][0], echo.data[0]);
            marks[right][0] = marks[right][1];
            open[right]--;
        }
        if (can_model_offer(model, &frame) == MODEL_NONE) {
            TEST_ASSERT_EQUAL(0, open[0] + open[1]);
        }
    }
}
