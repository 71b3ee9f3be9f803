// SPDX-License-Identifier: MIT
// bringup: which answers, stops and states of the e-stop precede a movement. The test plays operator and gateway.
#include "bringup/bringup.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

#define ANSWERED_US 5000000
#define STEPS       8U
#define POLL_US     20000

/// One answer of the gateway to `status`. The last one repeats.
typedef struct {
    const char *state;
    const char *estop;
    bool turns;
} view_t;

void __wrap_talk_ask(bringup_t *self, const char *question, const char *otherwise,
                     char out_answer[BRINGUP_ANSWER_SIZE]);
bool __wrap_talk_yes(bringup_t *self, const char *question, bool otherwise);
bool __wrap_talk_key_pressed(void);
void __wrap_trial_start(bringup_t *self, const gateway_config_t *config);
bool __wrap_burst_show(bringup_t *self, const burst_t *burst, outcome_t *out_outcome);
void __wrap_burst_insist(bringup_t *self, const burst_t *burst, outcome_t *out_outcome);
json_t *__wrap_near_ask(ctl_t *ctl, json_t *request);
int64_t __wrap_client_now_us(void);

static bringup_t bringup;
static ctl_t ctl;
static view_t views[STEPS];
static unsigned polls;
static unsigned offline_polls; ///< So many answers without the left wheel.
static int64_t now_us;
static const char *cause;
static int64_t stop_us;
static bool resets_work;
static unsigned resets;
static json_int_t reset_stop;
static char why[256];
static char events[64]; ///< "?": a question, a digit: a movement with this type.
static const char *answers[STEPS];
static unsigned questions;
static bool done;
static bool key;

static void happened(char event) {
    const size_t length = strlen(events);
    TEST_ASSERT_LESS_THAN(sizeof events - 1U, length);
    events[length] = event;
}

void __wrap_talk_ask(bringup_t *self, const char *question, const char *otherwise,
                     char out_answer[BRINGUP_ANSWER_SIZE]) {
    (void)self;
    (void)question;
    (void)otherwise;
    happened('?');
    TEST_ASSERT_LESS_THAN(STEPS, questions);
    TEST_ASSERT_NOT_NULL_MESSAGE(answers[questions], "a question too many");
    (void)snprintf(out_answer, BRINGUP_ANSWER_SIZE, "%s", answers[questions++]);
}

bool __wrap_talk_yes(bringup_t *self, const char *question, bool otherwise) {
    (void)self;
    (void)question;
    (void)otherwise;
    return true;
}

bool __wrap_talk_key_pressed(void) {
    return key;
}

static int type_started;

void __wrap_trial_start(bringup_t *self, const gateway_config_t *config) {
    (void)self;
    type_started = config->core.setpoint_type;
}

/// Only type 3 turns the wheels. Unless `done` is true, the operator stops the first movement.
bool __wrap_burst_show(bringup_t *self, const burst_t *burst, outcome_t *out_outcome) {
    (void)self;
    (void)burst;
    happened((char)('0' + type_started));
    const int speed = (type_started == 3) ? BRINGUP_SPEED_MM_S : 0;
    *out_outcome = (outcome_t){.end = done ? BURST_DONE : BURST_ABORTED, .mean_mm_s = {speed, speed}};
    const bool was = done;
    done = true;
    return was;
}

void __wrap_burst_insist(bringup_t *self, const burst_t *burst, outcome_t *out_outcome) {
    (void)__wrap_burst_show(self, burst, out_outcome);
}

int64_t __wrap_client_now_us(void) {
    return now_us;
}

static json_t *wheel(bool online, bool turns) {
    return json_pack("{s:b,s:b}", "heard", online, "at_rest", online && !turns);
}

json_t *__wrap_near_ask(ctl_t *ctl_, json_t *request) {
    (void)ctl_;
    const char *cmd = text_word(request, "cmd");
    json_t *reply = NULL;
    if (strcmp(cmd, "status") == 0) {
        unsigned i = (polls < STEPS) ? polls : STEPS - 1U;
        while (i > 0 && views[i].state == NULL) {
            i--;
        }
        polls++;
        now_us += POLL_US;
        reply = json_pack("{s:s,s:{s:s},s:o,s:o,s:[]}", "state", views[i].state, "estop", "state", views[i].estop,
                          "left", wheel(polls > offline_polls, views[i].turns), "right", wheel(true, false), "present");
    } else if (strcmp(cmd, "why") == 0) {
        reply = json_pack("{s:i,s:s,s:I,s:s}", "number", (cause != NULL) ? 7 : 0, "cause",
                          (cause != NULL) ? cause : "none", "at_us", (json_int_t)stop_us, "sentence", "the sentence");
    } else {
        TEST_ASSERT_EQUAL_STRING("reset", cmd);
        resets++;
        reset_stop = json_integer_value(json_object_get(request, "stop"));
        if (resets_work) {
            views[0] = (view_t){.state = "listening", .estop = "released"};
        }
    }
    json_decref(request);
    return reply;
}

void setUp(void) {
    memset(&bringup, 0, sizeof bringup);
    memset(views, 0, sizeof views);
    memset(answers, 0, sizeof answers);
    memset(events, 0, sizeof events);
    gateway_config_default(&bringup.config);
    bringup.ctl = &ctl;
    bringup.known_us = ANSWERED_US;
    views[0] = (view_t){.state = "listening", .estop = "released"};
    polls = resets = questions = offline_polls = 0;
    now_us = ANSWERED_US;
    cause = NULL;
    stop_us = reset_stop = 0;
    resets_work = true;
    done = true;
    key = false;
    why[0] = '\0';
}

/// A stop by this cause, this long after the last answer.
static void latched(const char *cause_, int64_t after_us) {
    views[0] = (view_t){.state = "latched", .estop = "released"};
    cause = cause_;
    stop_us = ANSWERED_US + after_us;
}

static void refused(const char *expected) {
    TEST_ASSERT_FALSE(ready_to_move(&bringup, why, sizeof why));
    TEST_ASSERT_EQUAL_STRING(expected, why);
    TEST_ASSERT_EQUAL_UINT(0, resets);
}

TEST(test_move_with_wheels_ready_is_permitted) {
    TEST_ASSERT_TRUE(ready_to_move(&bringup, why, sizeof why));
    TEST_ASSERT_EQUAL_UINT(0, resets);
}

TEST(test_move_with_estop_pressed_is_refused_immediately) {
    views[0] = (view_t){.state = "latched", .estop = "pressed"};
    views[1] = (view_t){.state = "listening", .estop = "released"};
    refused("the e-stop is pressed; release it before you answer");
    TEST_ASSERT_EQUAL_UINT(1, polls);
}

TEST(test_move_with_estop_unreadable_is_refused_immediately) {
    views[0] = (view_t){.state = "latched", .estop = "unreadable"};
    views[1] = (view_t){.state = "listening", .estop = "released"};
    refused("the e-stop cannot be read; check its wire before you answer");
    TEST_ASSERT_EQUAL_UINT(1, polls);
}

TEST(test_move_with_contacts_that_disagree_is_refused) {
    views[0] = (view_t){.state = "latched", .estop = "disagrees"};
    views[1] = (view_t){.state = "listening", .estop = "released"};
    refused("the two contacts of the e-stop disagree; press and release it before you answer");
}

TEST(test_move_with_estop_pressed_during_the_wait_is_refused) {
    views[0] = (view_t){.state = "listening", .estop = "released", .turns = true};
    views[1] = (view_t){.state = "latched", .estop = "pressed"};
    views[2] = (view_t){.state = "listening", .estop = "released"};
    refused("the e-stop is pressed; release it before you answer");
    TEST_ASSERT_EQUAL_UINT(2, polls);
}

TEST(test_move_after_an_estop_between_two_polls_is_refused) {
    latched("estop_line", 1);
    refused("the e-stop was pressed after your last answer");
}

TEST(test_move_after_a_later_fault_is_refused_with_it) {
    latched("wheel_lost", 1);
    refused("the sentence");
}

TEST(test_move_after_an_earlier_stop_resets_that_stop) {
    latched("estop_line", -1);
    TEST_ASSERT_TRUE(ready_to_move(&bringup, why, sizeof why));
    TEST_ASSERT_EQUAL_UINT(1, resets);
    TEST_ASSERT_EQUAL_INT64(7, reset_stop);
}

/// The release of an e-stop may switch a wheel on.
TEST(test_move_of_a_wheel_that_was_offline_is_refused) {
    offline_polls = 30;
    refused("the left wheel is offline (power, cable)");
    TEST_ASSERT_LESS_THAN(offline_polls, polls);
}

TEST(test_move_waits_until_a_new_gateway_receives_the_wheels) {
    offline_polls = 10;
    TEST_ASSERT_TRUE(ready_to_move(&bringup, why, sizeof why));
}

TEST(test_move_with_a_wheel_that_turns_on_is_refused) {
    views[0].turns = true;
    refused("a wheel turns");
}

TEST(test_move_after_a_key_is_refused) {
    latched("estop_line", -1);
    key = true;
    TEST_ASSERT_FALSE(ready_to_move(&bringup, why, sizeof why));
    TEST_ASSERT_EQUAL_UINT(0, resets);
}

TEST(test_move_after_an_estop_of_the_ended_gateway_is_refused) {
    views[0].state = "stopping";
    views[2] = (view_t){.state = "latched", .estop = "released"};
    cause = "estop_line";
    stop_us = ANSWERED_US + 1;
    ready_retain_estop(&bringup);
    TEST_ASSERT_EQUAL_UINT(3, polls);
    views[2] = views[0] = (view_t){.state = "listening", .estop = "released"};
    refused("the e-stop was pressed after your last answer");
    bringup.known_us = stop_us;
    TEST_ASSERT_TRUE(ready_to_move(&bringup, why, sizeof why));
}

TEST(test_hands_on_wheels_of_a_latched_gateway_reset_nothing) {
    latched("estop_line", 1);
    ready_by_hand(&bringup);
    TEST_ASSERT_EQUAL_UINT(0, resets);
}

TEST(test_types_are_tried_until_one_turns_the_wheels) {
    answers[0] = "1-4";
    bringup_type(&bringup);
    TEST_ASSERT_EQUAL_STRING("?123", events);
}

TEST(test_types_after_a_stopped_one_wait_for_an_answer) {
    done = false;
    answers[0] = "1-4";
    answers[1] = "3";
    bringup_type(&bringup);
    TEST_ASSERT_EQUAL_STRING("?1?3", events);
}

TEST(test_role_is_tried_after_a_question) {
    answers[0] = "go";
    answers[1] = "limit";
    bringup.config.core.setpoint_type = 3;
    bringup_role(&bringup);
    TEST_ASSERT_EQUAL_STRING("?3333?", events);
}
