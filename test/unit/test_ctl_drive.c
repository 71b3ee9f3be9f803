// SPDX-License-Identifier: MIT
// Arm of `iwheelctl drive` and of bringup while the wheels are not at standstill, with a model of the gateway and a stop
// of another client between any two requests.
#include "bringup/bringup.h"

#include "unit.h"

#include <stdint.h>
#include <string.h>

#define AGE_US     300000 ///< `max_age_ms` of the model. The wait of `drive` exceeds it.
#define REQUEST_US 1000   ///< Time from one request to the next.
#define NO_STOP    1000U

int64_t __wrap_client_now_us(void);
iwc_result_t __wrap_client_receive(client_t *self, int64_t deadline_us, json_t **out_line);
iwc_result_t __wrap_client_ask(client_t *self, json_t *request, json_t **out_reply);
bool __wrap_talk_key_pressed(void);
bool __wrap_talk_yes(bringup_t *self, const char *question, bool otherwise);

static int64_t now_us, rest_us, stop_us, begin_us;
static unsigned requests, arms, stop_before;
static bool granted, stamped;

void setUp(void) {
    now_us = 5000000;
    rest_us = now_us + 600000;
    stop_us = begin_us = 0;
    requests = arms = 0;
    stop_before = NO_STOP;
    granted = false;
    stamped = true;
}

int64_t __wrap_client_now_us(void) {
    return now_us;
}

iwc_result_t __wrap_client_receive(client_t *self, int64_t deadline_us, json_t **out_line) {
    (void)self;
    *out_line = NULL;
    now_us = deadline_us;
    return IWC_TIMEOUT;
}

static json_t *refused(const char *error) {
    return json_pack("{s:b,s:s,s:s}", "ok", 0, "error", error, "message", "a test refuses it");
}

/// Judges as the gateway does: first the time, then standstill. A granted arm ends the connection, and with it the test.
static json_t *reply_to_arm(const json_t *request) {
    const json_t *t_us = json_object_get(request, "t_us");
    arms++;
    stamped = stamped && json_is_integer(t_us);
    if (json_integer_value(t_us) < stop_us || json_integer_value(t_us) < now_us - AGE_US) {
        return refused("stale_command");
    }
    granted = now_us >= rest_us;
    return granted ? NULL : refused("not_at_rest");
}

/// A wheel whose telemetry is late is at standstill in the status, but not yet for arm.
static json_t *reply_to_others(const char *cmd) {
    if (strcmp(cmd, "status") == 0 && arms == 0) {
        begin_us = now_us;
    }
    return json_pack("{s:b,s:I,s:s,s:{s:s},s:{s:b,s:b},s:{s:b,s:b}}", "ok", 1, "t_us", now_us, "state", "listening",
                     "estop", "state", "none", "left", "heard", 1, "at_rest", 1, "right", "heard", 1, "at_rest", 1);
}

iwc_result_t __wrap_client_ask(client_t *self, json_t *request, json_t **out_reply) {
    (void)self;
    const char *cmd = json_string_value(json_object_get(request, "cmd"));
    now_us += REQUEST_US;
    requests++;
    stop_us = (requests == stop_before) ? now_us : stop_us;
    *out_reply = (strcmp(cmd, "arm") == 0) ? reply_to_arm(request) : reply_to_others(cmd);
    json_decref(request);
    return (*out_reply == NULL) ? IWC_CLOSED : IWC_OK;
}

bool __wrap_talk_key_pressed(void) {
    return false;
}

bool __wrap_talk_yes(bringup_t *self, const char *question, bool otherwise) {
    (void)self;
    (void)question;
    (void)otherwise;
    return false;
}

static int drive(void) {
    char left[] = "200";
    char right[] = "200";
    char *words[] = {left, right, NULL};
    ctl_t ctl = {.client = {.open = true}};
    return verb_drive(&ctl, 2, words);
}

TEST(test_drive_waits_for_standstill_longer_than_max_age) {
    TEST_ASSERT_EQUAL_INT(CTL_UNAVAILABLE, drive());
    TEST_ASSERT_TRUE(granted);
    TEST_ASSERT_TRUE(stamped);
}

TEST(test_drive_that_waits_is_ended_by_a_stop_at_any_time) {
    unsigned stops = 0;
    for (;; stops++) {
        setUp();
        stop_before = stops + 1U;
        const int code = drive();
        if (stop_us == 0) {
            break;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE((stop_us > begin_us) ? CTL_NO : CTL_UNAVAILABLE, code,
                                      "before or after its begin");
        TEST_ASSERT_TRUE(granted != (stop_us > begin_us));
    }
    TEST_ASSERT_GREATER_THAN_UINT(20, stops);
}

TEST(test_drive_waits_for_standstill_for_one_second) {
    rest_us = INT64_MAX;
    TEST_ASSERT_EQUAL_INT(CTL_NO, drive());
    TEST_ASSERT_FALSE(granted);
    TEST_ASSERT_INT_WITHIN(100000, 1000000, (int)(now_us - begin_us));
}

static void burst(void) {
    ctl_t ctl = {.client = {.open = true}};
    bringup_t bringup = {.ctl = &ctl};
    const burst_t ahead = {.speed_mm_s = {100, 100}, .for_ms = 500};
    outcome_t outcome;
    TEST_ASSERT_FALSE(burst_show(&bringup, &ahead, &outcome));
}

TEST(test_bringup_that_arms_again_is_ended_by_a_stop) {
    unsigned stops = 0;
    for (;; stops++) {
        setUp();
        rest_us = now_us + 13 * REQUEST_US; // Three attempts.
        stop_before = stops + 1U;
        burst();
        TEST_ASSERT_TRUE(stamped);
        if (stop_us == 0) {
            break;
        }
        TEST_ASSERT_TRUE(granted != (stop_us > begin_us));
    }
    TEST_ASSERT_TRUE(granted);
    TEST_ASSERT_GREATER_THAN_UINT(10, stops);
}
