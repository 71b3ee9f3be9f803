// SPDX-License-Identifier: MIT
// Mailboxes, echoes, replacing and taking back: section 7.1, and the port's contract in iwheel/hal.h.
#include "bxcan_rig.h"
#include "unit.h"

static brd_bxcan_t *const driver = &rig[0].driver;
static bxcan_model_t *const model = &rig[0].model;

void setUp(void);
void tearDown(void);

void setUp(void) {
    rig_reset();
    rig_start(0);
}

void tearDown(void) {
    rig_assert_no_violation();
}

static int send(uint32_t id, uint8_t mark) {
    const iw_can_frame_t frame = rig_frame(id, mark);
    return brd_bxcan_send(driver, &frame, 1);
}

static void assert_on_bus(uint32_t id, uint8_t mark) {
    model_frame_t frame;
    TEST_ASSERT_TRUE_MESSAGE(rig_send_next(0, &frame), "nothing waits to be sent");
    TEST_ASSERT_EQUAL(id, frame.id);
    TEST_ASSERT_EQUAL(mark, frame.data[0]);
}

static void assert_nothing_waits(void) {
    model_frame_t frame;
    TEST_ASSERT_FALSE(rig_send_next(0, &frame));
}

static void assert_echo(uint32_t id, uint8_t mark) {
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL_MESSAGE(1, brd_bxcan_receive(driver, &echo), "no echo");
    TEST_ASSERT_EQUAL(IW_CAN_ECHO, echo.kind);
    TEST_ASSERT_EQUAL(id, echo.id);
    TEST_ASSERT_EQUAL(mark, echo.data[0]);
}

static void assert_no_echo(void) {
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL(0, brd_bxcan_receive(driver, &echo));
}

TEST(test_frame_arrives_byte_for_byte) {
    const uint8_t bytes[8] = {0x81, 0x02, 0xF3, 0x04, 0x95, 0x06, 0xA7, 0x08};
    iw_can_frame_t frame = {.id = 0x7FF, .dlc = 8};
    model_frame_t on_bus;
    for (size_t i = 0; i < 8; i++) {
        frame.data[i] = bytes[i];
    }
    TEST_ASSERT_EQUAL(1, brd_bxcan_send(driver, &frame, 1));
    TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
    TEST_ASSERT_EQUAL(0x7FF, on_bus.id);
    TEST_ASSERT_EQUAL(0, on_bus.extended);
    TEST_ASSERT_EQUAL(0, on_bus.remote);
    TEST_ASSERT_EQUAL(8, on_bus.dlc);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, on_bus.data, 8);
}

TEST(test_every_dlc_is_sent) {
    for (uint8_t dlc = 0; dlc <= 8; dlc++) {
        const iw_can_frame_t frame = {.id = 266, .dlc = dlc};
        model_frame_t on_bus;
        TEST_ASSERT_EQUAL(1, brd_bxcan_send(driver, &frame, 1));
        TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
        TEST_ASSERT_EQUAL(dlc, on_bus.dlc);
    }
}

TEST(test_what_is_no_plain_data_frame_is_refused) {
    const iw_can_frame_t wrong[] = {
        {.id = 266U | IW_CAN_EXTENDED, .dlc = 5},
        {.id = 266U | IW_CAN_REMOTE, .dlc = 5},
        {.id = 266U | IW_CAN_ERROR, .dlc = 5},
        {.id = 0x800, .dlc = 5},
        {.id = 266, .dlc = 9},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_LESS_THAN(0, brd_bxcan_send(driver, &wrong[i], 1));
    }
    assert_nothing_waits();
}

TEST(test_echo_comes_only_with_the_acknowledgement) {
    model_frame_t frame;
    TEST_ASSERT_EQUAL(1, send(266, 1));
    assert_no_echo();
    for (int i = 0; i < 50; i++) {
        const int mailbox = bxcan_model_offer(model, &frame);
        bxcan_model_begin(model, mailbox);
        bxcan_model_end(model, mailbox, (i % 2 == 0) ? MODEL_NO_ACKNOWLEDGEMENT : MODEL_LOST_ARBITRATION);
        assert_no_echo();
    }
    assert_on_bus(266, 1);
    assert_echo(266, 1);
    assert_no_echo();
}

TEST(test_left_leaves_before_right_whatever_the_order) {
    (void)send(298, 2);
    (void)send(266, 1);
    assert_on_bus(266, 1);
    assert_on_bus(298, 2);
    assert_echo(266, 1);
    assert_echo(298, 2);
}

/// Bytes and id of every mailbox are there before the first one is requested: of both frames, the left one's mailbox is still not
/// pending when the right one's data is written.
static uint32_t written[64];
static uint32_t writes;

static void note_write(uint32_t offset) {
    written[writes++ % 64U] = offset;
}

static int send_pair(uint8_t left_mark, uint8_t right_mark) {
    const iw_can_frame_t pair[] = {rig_frame(266, left_mark), rig_frame(298, right_mark)};
    return brd_bxcan_send(driver, pair, 2);
}

TEST(test_pair_fills_both_mailboxes_before_it_requests_one) {
    writes = 0;
    rig[0].on_write = note_write;
    TEST_ASSERT_EQUAL(2, send_pair(1, 2));
    rig[0].on_write = NULL;
    TEST_ASSERT_GREATER_THAN(2, writes);
    for (uint32_t i = 0; i < writes; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(i >= writes - 2U, (written[i] & 0x18FU) == 0x180U,
                                  "requests come last, both of them");
    }
    assert_on_bus(266, 1);
    assert_on_bus(298, 2);
    assert_nothing_waits();
    assert_echo(266, 1);
    assert_echo(298, 2);
    assert_no_echo();
}

TEST(test_pair_takes_the_places_of_the_waiting_one) {
    TEST_ASSERT_EQUAL(2, send_pair(1, 2));
    TEST_ASSERT_EQUAL(2, send_pair(3, 4));
    TEST_ASSERT_EQUAL(0, send_pair(5, 6));
    assert_on_bus(266, 3);
    assert_on_bus(298, 4);
    assert_nothing_waits();
    assert_echo(266, 1);
    assert_echo(266, 3);
    assert_echo(298, 2);
    assert_echo(298, 4);
    assert_no_echo();
}

TEST(test_pair_with_a_wrong_frame_is_refused_whole) {
    const iw_can_frame_t left_wrong[] = {rig_frame(0x800, 1), rig_frame(298, 2)};
    const iw_can_frame_t right_wrong[] = {rig_frame(266, 1), rig_frame(0x800, 2)};
    TEST_ASSERT_LESS_THAN(0, brd_bxcan_send(driver, left_wrong, 2));
    TEST_ASSERT_LESS_THAN(0, brd_bxcan_send(driver, right_wrong, 2));
    assert_nothing_waits();
    assert_no_echo();
}

TEST(test_pair_whose_right_frame_finds_no_place_leaves_the_left_one) {
    const iw_can_frame_t right = rig_frame(298, 2);
    (void)send(298, 1);
    (void)brd_bxcan_send(driver, &right, 1);
    TEST_ASSERT_EQUAL(1, send_pair(3, 4));
    assert_on_bus(266, 3);
    assert_on_bus(298, 2);
    assert_nothing_waits();
    assert_echo(266, 3);
}

/// Whatever waits gets through when the interrupt has just been masked: the abort comes too late.
static bool send_all_at_masking(uint32_t offset) {
    model_frame_t frame;
    for (int i = bxcan_model_offer(model, &frame); offset == 0x14U && i >= 0; i = bxcan_model_offer(model, &frame)) {
        bxcan_model_begin(model, i);
        bxcan_model_end(model, i, MODEL_SENT);
    }
    return true;
}

/// Both old frames get through while the new ones take their places: the first one's mailbox is free again for the second one.
TEST(test_pair_finds_places_though_both_old_frames_leave_meanwhile) {
    TEST_ASSERT_EQUAL(2, send_pair(1, 2));
    rig[0].on_read = send_all_at_masking;
    TEST_ASSERT_EQUAL(2, send_pair(3, 4));
    rig[0].on_read = NULL;
    assert_echo(266, 1);
    assert_echo(298, 2);
    assert_no_echo();
    assert_on_bus(266, 3);
    assert_on_bus(298, 4);
    assert_nothing_waits();
    assert_echo(266, 3);
    assert_echo(298, 4);
    assert_no_echo();
}

TEST(test_call_places_no_more_frames_than_wheels) {
    const iw_can_frame_t three[] = {rig_frame(266, 1), rig_frame(298, 2), rig_frame(300, 3)};
    TEST_ASSERT_EQUAL(2, brd_bxcan_send(driver, three, 3));
    assert_on_bus(266, 1);
    assert_on_bus(298, 2);
    assert_nothing_waits();
}

TEST(test_newer_frame_takes_the_place_of_the_waiting_one) {
    (void)send(266, 1);
    (void)send(298, 1);
    TEST_ASSERT_EQUAL(1, send(266, 2));
    assert_on_bus(266, 2);
    assert_on_bus(298, 1);
    assert_nothing_waits();
    assert_echo(266, 1); // One for each that was handed over, with its own bytes ...
    assert_echo(266, 2); // ... once the newer is acknowledged.
    assert_echo(298, 1);
    assert_no_echo();
}

TEST(test_third_frame_of_an_id_must_wait_and_changes_nothing) {
    (void)send(298, 1);
    (void)send(298, 2);
    TEST_ASSERT_EQUAL(0, send(298, 3));
    assert_on_bus(298, 2);
    assert_nothing_waits();
    assert_echo(298, 1);
    assert_echo(298, 2);
    assert_no_echo();
    TEST_ASSERT_EQUAL(1, send(298, 3));
}

/// The frame under way ends while the driver polls TSR.
static bool end_frame_on_bus(uint32_t offset) {
    if (offset != 0x08U) {
        return true;
    }
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        if (model->mailbox[i].on_bus) {
            bxcan_model_end(model, i, MODEL_SENT);
        }
    }
    return false;
}

static bool lose_frame_on_bus(uint32_t offset) {
    if (offset != 0x08U) {
        return true;
    }
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        if (model->mailbox[i].on_bus) {
            bxcan_model_end(model, i, MODEL_BIT_ERROR);
        }
    }
    return false;
}

static void begin_first(void) {
    model_frame_t frame;
    bxcan_model_begin(model, bxcan_model_offer(model, &frame));
}

TEST(test_old_frame_that_gets_through_while_being_replaced_has_its_own_echo) {
    (void)send(266, 1);
    begin_first();
    rig[0].on_read = end_frame_on_bus;
    TEST_ASSERT_EQUAL(1, send(266, 2));
    assert_echo(266, 1);
    assert_no_echo();
    assert_on_bus(266, 2);
    assert_echo(266, 2);
    assert_no_echo();
}

TEST(test_old_frame_that_fails_while_being_replaced_never_comes) {
    (void)send(266, 1);
    begin_first();
    rig[0].on_read = lose_frame_on_bus;
    TEST_ASSERT_EQUAL(1, send(266, 2));
    assert_no_echo();
    assert_on_bus(266, 2);
    assert_nothing_waits();
    assert_echo(266, 1);
    assert_echo(266, 2);
    assert_no_echo();
}

static void join_again(void) {
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, brd_bxcan_bus_state(driver));
    (void)brd_bxcan_bus_state(driver);
    bxcan_model_recessive(model, 11);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, brd_bxcan_bus_state(driver));
}

TEST(test_frame_that_never_ends_is_waited_for_with_a_bound) {
    (void)send(266, 1);
    begin_first();
    TEST_ASSERT_EQUAL(0, send(266, 2));
    (void)lose_frame_on_bus(0x08);
    (void)rig_read_esr(0); // The interrupt strikes.
    assert_nothing_waits();
    assert_no_echo();
    TEST_ASSERT_EQUAL(1, send(266, 3));
    assert_on_bus(266, 3);
    assert_echo(266, 3);
    assert_no_echo();
}

TEST(test_purge_that_does_not_end_resets_the_controller_and_tells_a_loss_of_the_bus) {
    (void)send(266, 1);
    (void)send(298, 1);
    begin_first();
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    TEST_ASSERT_EQUAL(1, driver->resets);
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, rig[0].reset, "the device is let go again");
    TEST_ASSERT_LESS_THAN(0, send(266, 2));
    join_again();
    assert_nothing_waits();
    assert_no_echo();
    TEST_ASSERT_EQUAL(1, send(266, 3));
    assert_on_bus(266, 3);
    assert_echo(266, 3);
    assert_no_echo();
}

/// Sent and confirmed, but the core has not asked for it yet when the other frame has to be purged by force.
TEST(test_purge_that_resets_the_controller_keeps_echoes_of_before_from_the_core) {
    iw_can_frame_t echo;
    (void)send(266, 1);
    assert_on_bus(266, 1);
    (void)send(298, 1);
    model->abort_reads = UINT32_MAX;
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    TEST_ASSERT_EQUAL(1, driver->resets);
    TEST_ASSERT_EQUAL(-1, brd_bxcan_receive(driver, &echo));
}

TEST(test_purge_of_a_controller_that_ignores_aborts_resets_it) {
    (void)send(266, 1);
    model->abort_reads = UINT32_MAX;
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    assert_nothing_waits();
    join_again();
    assert_nothing_waits();
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    TEST_ASSERT_EQUAL(1, driver->resets);
}

TEST(test_purge_on_a_bus_held_dominant_within_our_frame_leaves_nothing) {
    (void)send(266, 1);
    (void)send(298, 1);
    begin_first();
    (void)lose_frame_on_bus(0x08);
    bxcan_model_hold(model, 50, true);
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    TEST_ASSERT_EQUAL(0, driver->resets);
    bxcan_model_recessive(model, 11);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, brd_bxcan_bus_state(driver));
    assert_nothing_waits();
    assert_no_echo();
}

/// ALST and TERR of an attempt stay readable after the abort of the mailbox: they are no echo, and no obstacle to the next frame.
TEST(test_failed_attempts_before_an_abort_are_no_echo) {
    const model_end_t ends[] = {MODEL_LOST_ARBITRATION, MODEL_BIT_ERROR, MODEL_NO_ACKNOWLEDGEMENT};
    for (size_t i = 0; i < 3; i++) {
        model_frame_t frame;
        (void)send(266, 1);
        const int mailbox = bxcan_model_offer(model, &frame);
        bxcan_model_begin(model, mailbox);
        bxcan_model_end(model, mailbox, ends[i]);
        TEST_ASSERT_NOT_EQUAL(0, model->tsr & (0x0C0C0CU));
        TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
        assert_no_echo();
        TEST_ASSERT_EQUAL(1, send(266, 2));
        assert_on_bus(266, 2);
        assert_echo(266, 2);
        assert_no_echo();
    }
}

TEST(test_slow_abort_is_awaited) {
    model->abort_reads = 20;
    (void)send(266, 1);
    TEST_ASSERT_EQUAL(1, send(266, 2));
    assert_on_bus(266, 2);
    assert_nothing_waits();
}

TEST(test_fourth_frame_waits_for_a_free_mailbox) {
    (void)send(266, 1);
    (void)send(298, 1);
    TEST_ASSERT_EQUAL(1, send(300, 1));
    TEST_ASSERT_EQUAL(0, send(301, 1));
    assert_on_bus(266, 1);
    TEST_ASSERT_EQUAL(1, send(301, 1));
}

TEST(test_purge_takes_everything_back) {
    (void)send(266, 1);
    (void)send(298, 1);
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    assert_nothing_waits();
    assert_no_echo();
    TEST_ASSERT_EQUAL(1, send(266, 2));
    assert_on_bus(266, 2);
    assert_echo(266, 2);
    assert_no_echo();
}

TEST(test_echo_from_before_a_purge_never_comes) {
    (void)send(266, 1);
    assert_on_bus(266, 1);
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    assert_no_echo();
}

TEST(test_purge_keeps_what_was_received) {
    iw_can_frame_t frame;
    (void)rig_hear(0, 256, 4);
    (void)brd_bxcan_purge(driver);
    TEST_ASSERT_EQUAL(1, brd_bxcan_receive(driver, &frame));
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, frame.kind);
}

TEST(test_frame_that_completes_during_a_purge_has_no_echo_afterwards) {
    (void)send(266, 1);
    begin_first();
    rig[0].on_read = end_frame_on_bus;
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    assert_no_echo();
    assert_nothing_waits();
    (void)send(266, 2);
    assert_on_bus(266, 2);
    assert_echo(266, 2);
    assert_no_echo();
}

static int mailbox_of(uint32_t id) {
    int found = MODEL_NONE;
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        found = (model->mailbox[i].pending && model->mailbox[i].tir >> 21 == id) ? i : found;
    }
    TEST_ASSERT_NOT_EQUAL(MODEL_NONE, found);
    return found;
}

/// The right frame gets through when the interrupt has just been masked and nothing was aborted yet.
static bool send_right_at_masking(uint32_t offset) {
    if (offset != 0x14U) {
        return true;
    }
    const int mailbox = mailbox_of(298);
    bxcan_model_begin(model, mailbox);
    bxcan_model_end(model, mailbox, MODEL_SENT);
    return false;
}

static void fill_mailboxes(void) {
    TEST_ASSERT_EQUAL(1, send(266, 1));
    TEST_ASSERT_EQUAL(1, send(298, 1));
    TEST_ASSERT_EQUAL(1, send(300, 1));
}

TEST(test_purge_of_three_full_mailboxes_empties_them_all) {
    fill_mailboxes();
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    TEST_ASSERT_EQUAL(0, driver->resets);
    assert_nothing_waits();
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, brd_bxcan_bus_state(driver));
    fill_mailboxes();
}

TEST(test_purge_of_three_while_one_completes_leaves_no_echo_and_nothing_waiting) {
    fill_mailboxes();
    rig[0].on_read = send_right_at_masking;
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    assert_no_echo();
    assert_nothing_waits();
    TEST_ASSERT_EQUAL(0, driver->resets);
}

TEST(test_completion_while_another_mailbox_is_withdrawn_is_not_lost) {
    fill_mailboxes();
    rig[0].on_read = send_right_at_masking;
    TEST_ASSERT_EQUAL(1, send(266, 2));
    assert_echo(298, 1);
    assert_no_echo();
    assert_on_bus(266, 2);
    assert_on_bus(300, 1);
    assert_echo(266, 1);
    assert_echo(266, 2);
    assert_echo(300, 1);
    TEST_ASSERT_EQUAL(1, send(298, 2));
}

TEST(test_purge_of_an_idle_device_succeeds) {
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
    TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
}

TEST(test_receive_of_a_stopped_device_is_broken) {
    iw_can_frame_t frame;
    rig_init(0, false);
    TEST_ASSERT_LESS_THAN(0, brd_bxcan_receive(driver, &frame));
    TEST_ASSERT_LESS_THAN(0, send(266, 1));
}

/// Random hands-over, transmissions, failures, purges: an echo with the bytes of each frame handed over, none without acknowledgement, and
/// never an older frame after a newer one.
TEST(test_random_traffic_keeps_the_account) {
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
            if (send((side == 0U) ? 266U : 298U, mark) > 0) {
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
            if (bxcan_model_offer(model, &frame) != MODEL_NONE) {
                begin_first();
                (void)lose_frame_on_bus(0x08);
                model->tec = 0;
            }
            break;
        default:
            if ((chance >> 24) % 16U == 0U) {
                TEST_ASSERT_EQUAL(1, brd_bxcan_purge(driver));
                open[0] = 0;
                open[1] = 0;
            }
            break;
        }
        while (brd_bxcan_receive(driver, &echo) > 0) {
            const bool right = echo.id == 298U;
            TEST_ASSERT_GREATER_THAN_MESSAGE(0, open[right], "an echo too many");
            TEST_ASSERT_EQUAL(marks[right][0], echo.data[0]);
            marks[right][0] = marks[right][1];
            open[right]--;
        }
        if (bxcan_model_offer(model, &frame) == MODEL_NONE) {
            TEST_ASSERT_EQUAL(0, open[0] + open[1]);
        }
    }
}
