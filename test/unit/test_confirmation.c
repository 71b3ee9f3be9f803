// SPDX-License-Identifier: MIT
// Account of sent and echoed frames, compared with a model in every sequence of events.
#include <string.h>

#include "iwheel/codec.h"
#include "iwheel/private/transmit.h"
#include "unit.h"

static iw_confirmation_t account;

void setUp(void) {
    memset(&account, 0, sizeof account);
    iw_confirmation_clear(&account);
}

static iw_can_frame_t setpoint(iw_side_t side, int16_t speed_mm_s, int16_t current_mA) {
    const iw_codec_setpoint_t value = {speed_mm_s, current_mA, 7};
    iw_can_frame_t frame;
    (void)iw_codec_encode_setpoint(side, &value, IW_DLC_SETPOINT, &frame);
    return frame;
}

static void sent_value(iw_side_t side, iw_time_us_t now_us, int16_t speed_mm_s, int16_t current_mA) {
    const iw_can_frame_t frame = setpoint(side, speed_mm_s, current_mA);
    iw_confirmation_sent(&account, side, now_us, &frame, true);
}

static void echo_value(iw_side_t side, int16_t speed_mm_s, int16_t current_mA) {
    const iw_can_frame_t frame = setpoint(side, speed_mm_s, current_mA);
    iw_confirmation_echo(&account, side, &frame);
}

/// Sends the same bytes in every call.
static void sent(iw_side_t side, iw_time_us_t now_us, bool accepted) {
    const iw_can_frame_t frame = setpoint(side, 0, 0);
    iw_confirmation_sent(&account, side, now_us, &frame, accepted);
}

static void echo(iw_side_t side) {
    echo_value(side, 0, 0);
}

static bool may_send(iw_side_t side, bool zero) {
    return ((iw_confirmation_may_send(&account, zero) >> side) & IW_SIDES_LEFT) != 0U;
}

/// Model of one wheel as the header describes it. Times are steps of the walk, from 1; 0: none.
typedef struct {
    unsigned pending;
    uint32_t sent[2];
    uint32_t waiting; ///< An echo also ends the wait of earlier refused frames.
    uint32_t proven;  ///< Time of the newest frame that an echo has confirmed since the last clear.
    uint32_t stray;
} model_t;

typedef enum { SEND_ZERO, SEND_NONZERO, REFUSED, ECHO, CLEAR, EVENTS } event_t;

static bool model_may_send(const model_t *model, bool zero) {
    return model->pending == 0 || (model->pending == 1 && zero);
}

static void model_sent(model_t *model, uint32_t now, bool accepted) {
    model->waiting = (model->waiting == 0) ? now : model->waiting;
    if (accepted) {
        model->sent[model->pending] = now;
        model->pending++;
    }
}

static void model_echo(model_t *model) {
    if (model->pending == 0) {
        model->stray++;
        return;
    }
    model->proven = model->sent[0];
    model->sent[0] = model->sent[1];
    model->pending--;
    model->waiting = (model->pending > 0) ? model->sent[0] : 0;
}

static void model_clear(model_t *model) {
    model->pending = 0;
    model->waiting = 0;
    model->proven = 0;
}

/// Applies the event to the account and the model. A frame that may not be sent is not sent: this is the contract of
/// the caller.
static void apply(iw_side_t side, event_t event, uint32_t now, model_t *models) {
    model_t *model = &models[side];
    const bool sends = event <= REFUSED;
    if (sends && model_may_send(model, event != SEND_NONZERO)) {
        sent(side, now, event != REFUSED);
        model_sent(model, now, event != REFUSED);
    } else if (event == ECHO) {
        echo(side);
        model_echo(model);
    } else if (event == CLEAR) {
        iw_confirmation_clear(&account);
        model_clear(&models[IW_LEFT]);
        model_clear(&models[IW_RIGHT]);
    }
}

static uint32_t earlier(uint32_t a, uint32_t b) {
    return (a == 0) ? b : (b == 0) ? a : (a < b) ? a : b;
}

/// Returns true if the account and the model return the same results to a caller.
static bool agrees(const model_t *models, uint32_t now) {
    for (int zero = 0; zero <= 1; zero++) {
        const uint32_t left = model_may_send(&models[IW_LEFT], zero != 0) ? IW_SIDES_LEFT : IW_SIDES_NONE;
        const uint32_t right = model_may_send(&models[IW_RIGHT], zero != 0) ? IW_SIDES_RIGHT : IW_SIDES_NONE;
        if (iw_confirmation_may_send(&account, zero != 0) != (left | right)) {
            return false;
        }
    }
    for (uint32_t since = 1; since <= now + 1; since++) {
        const bool proven = models[IW_LEFT].proven >= since && models[IW_RIGHT].proven >= since;
        if ((iw_confirmation_proven_us(&account) >= since) != proven) {
            return false;
        }
    }
    const uint32_t waiting = earlier(models[IW_LEFT].waiting, models[IW_RIGHT].waiting);
    return iw_confirmation_waiting_us(&account) == ((waiting == 0) ? IW_NEVER : waiting) &&
           account.stray == models[IW_LEFT].stray + models[IW_RIGHT].stray;
}

static char path
    [9]; ///< Events so far, for the message of a failure: events of the left wheel from 0, of the right wheel from 5.

/// Walks every sequence of `length` events of these wheels, from event number `now` on. A common prefix is walked once.
/// Returns the number of sequences.
static uint32_t walk(iw_side_t first, iw_side_t last, const model_t *before, uint32_t now, uint32_t length) {
    const iw_confirmation_t account_before = account;
    uint32_t walked = 0;
    for (int i = (int)first * EVENTS; i < ((int)last + 1) * EVENTS; i++) {
        model_t models[IW_SIDES];
        memcpy(models, before, sizeof models);
        account = account_before;
        path[now - 1] = (char)('0' + i);
        path[now] = 0;
        apply((iw_side_t)(i / EVENTS), (event_t)(i % EVENTS), now, models);
        TEST_ASSERT_TRUE_MESSAGE(agrees(models, now), path);
        walked += (now < length) ? walk(first, last, models, now + 1, length) : 1U;
    }
    return walked;
}

static uint32_t walk_all(iw_side_t first, iw_side_t last, uint32_t length) {
    static const model_t nothing[IW_SIDES];
    setUp();
    return walk(first, last, nothing, 1, length);
}

TEST(test_confirmation_every_8_events_of_one_wheel_match_model) {
    TEST_ASSERT_EQUAL_UINT32(390625, walk_all(IW_LEFT, IW_LEFT, 8));
    TEST_ASSERT_EQUAL_UINT32(390625, walk_all(IW_RIGHT, IW_RIGHT, 8));
}

TEST(test_confirmation_every_6_events_of_both_wheels_match_model) {
    TEST_ASSERT_EQUAL_UINT32(1000000, walk_all(IW_LEFT, IW_RIGHT, 6));
}

TEST(test_confirmation_init_has_no_pending_frame) {
    TEST_ASSERT_TRUE(may_send(IW_LEFT, false));
    TEST_ASSERT_TRUE(may_send(IW_RIGHT, false));
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == IW_NEVER);
    TEST_ASSERT_FALSE((iw_confirmation_proven_us(&account) >= 1));
    TEST_ASSERT_EQUAL_UINT32(0, account.stray);
}

TEST(test_may_send_allows_one_zero_after_an_unconfirmed_frame) {
    sent(IW_LEFT, 100, true);
    TEST_ASSERT_FALSE(may_send(IW_LEFT, false));
    TEST_ASSERT_TRUE(may_send(IW_LEFT, true));
    sent(IW_LEFT, 200, true);
    TEST_ASSERT_FALSE(may_send(IW_LEFT, true));
    TEST_ASSERT_TRUE(may_send(IW_RIGHT, false));
}

TEST(test_waiting_refused_frame_waits_from_the_first_refusal) {
    sent(IW_RIGHT, 1000, false);
    sent(IW_RIGHT, 2000, false);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 1000);
    sent(IW_RIGHT, 3000, true);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 1000);
    echo(IW_RIGHT);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == IW_NEVER);
}

TEST(test_confirmation_rest_ends_the_wait_of_refused_frames) {
    sent(IW_LEFT, 1000, false);
    sent(IW_RIGHT, 1000, false);
    iw_confirmation_rest(&account);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == IW_NEVER);
    TEST_ASSERT_TRUE(may_send(IW_LEFT, false));
}

TEST(test_confirmation_rest_retains_accepted_frames) {
    sent(IW_LEFT, 1000, false);
    sent(IW_LEFT, 2000, true);
    sent(IW_RIGHT, 500, false);
    iw_confirmation_rest(&account);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 1000);
    TEST_ASSERT_FALSE(may_send(IW_LEFT, false));
    echo(IW_LEFT);
    TEST_ASSERT_TRUE((iw_confirmation_proven_us(&account) >= 1) == false);
    sent(IW_RIGHT, 3000, true);
    iw_confirmation_rest(&account);
    echo(IW_RIGHT);
    TEST_ASSERT_TRUE((iw_confirmation_proven_us(&account) >= 2000));
}

TEST(test_waiting_is_the_longest_of_both_wheels) {
    sent(IW_LEFT, 2000, true);
    sent(IW_RIGHT, 1000, true);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 1000);
    echo(IW_RIGHT);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 2000);
}

TEST(test_proven_since_needs_both_wheels) {
    sent(IW_LEFT, 5000, true);
    sent(IW_RIGHT, 5001, true);
    echo(IW_LEFT);
    TEST_ASSERT_FALSE((iw_confirmation_proven_us(&account) >= 5000));
    echo(IW_RIGHT);
    TEST_ASSERT_TRUE((iw_confirmation_proven_us(&account) >= 5000));
    TEST_ASSERT_FALSE((iw_confirmation_proven_us(&account) >= 5001));
}

TEST(test_proven_since_echo_of_old_frame_does_not_prove_newer_one) {
    sent(IW_LEFT, 1000, true);
    sent(IW_LEFT, 9000, true);
    sent(IW_RIGHT, 9000, true);
    echo(IW_RIGHT);
    echo(IW_LEFT);
    TEST_ASSERT_FALSE((iw_confirmation_proven_us(&account) >= 1001));
    echo(IW_LEFT);
    TEST_ASSERT_TRUE((iw_confirmation_proven_us(&account) >= 9000));
}

TEST(test_echo_after_clear_is_stray_and_proves_nothing) {
    sent(IW_LEFT, 1000, true);
    sent(IW_RIGHT, 1000, true);
    iw_confirmation_clear(&account);
    echo(IW_LEFT);
    echo(IW_RIGHT);
    TEST_ASSERT_EQUAL_UINT32(2, account.stray);
    TEST_ASSERT_FALSE((iw_confirmation_proven_us(&account) >= 1000));
    TEST_ASSERT_TRUE(may_send(IW_LEFT, false));
}

TEST(test_echo_of_frame_before_clear_does_not_confirm_later_frame) {
    sent_value(IW_LEFT, 1000, 0, 2000);
    iw_confirmation_clear(&account);
    sent_value(IW_LEFT, 2000, 300, 2000);
    echo_value(IW_LEFT, 0, 2000);
    TEST_ASSERT_EQUAL_UINT32(1, account.stray);
    TEST_ASSERT_FALSE(may_send(IW_LEFT, false));
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 2000);
    echo_value(IW_LEFT, 300, 2000);
    TEST_ASSERT_TRUE(may_send(IW_LEFT, false));
}

TEST(test_echo_that_differs_in_one_byte_is_stray) {
    const int16_t others[][2] = {
        {0x0201, 0x0304}, {0x0102, 0x0304}, {0x0203, 0x0304}, {0x0202, 0x0305}, {0x0202, 0x0404}};
    sent_value(IW_RIGHT, 1000, 0x0202, 0x0304);
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        echo_value(IW_RIGHT, others[i][0], others[i][1]);
        TEST_ASSERT_EQUAL_UINT32(i + 1U, account.stray);
    }
    echo_value(IW_RIGHT, 0x0202, 0x0304);
    TEST_ASSERT_TRUE(may_send(IW_RIGHT, false));
}

TEST(test_echo_of_setpoint_does_not_confirm_the_zero_after_it) {
    sent_value(IW_LEFT, 1000, 300, 2000);
    sent_value(IW_LEFT, 2000, 0, 2000);
    echo_value(IW_LEFT, 300, 2000);
    echo_value(IW_LEFT, 300, 2000);
    TEST_ASSERT_EQUAL_UINT32(1, account.stray);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == 2000);
    echo_value(IW_LEFT, 0, 2000);
    TEST_ASSERT_TRUE(iw_confirmation_waiting_us(&account) == IW_NEVER);
}
