// SPDX-License-Identifier: MIT
// What the daemon answers, notes in the black box and warns of, in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include "iwheel_server/target.h"
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

static uint64_t noted_so_far(void) {
    return blackbox_ring_written(daemon_rig.daemon->box.ring);
}

static blackbox_entry_t *found; ///< By `look`, and kept until the next.

/// What the black box holds from `*at` on; `*at` is the first of it then. How many.
static size_t look(uint64_t *at) {
    const blackbox_ring_t *ring = daemon_rig.daemon->box.ring;
    size_t count = 0;
    found = (blackbox_entry_t *)realloc(found, blackbox_ring_most(ring) * sizeof *found);
    TEST_ASSERT_NOT_NULL(found);
    *at = blackbox_ring_copy(ring, *at, noted_so_far(), found, &count);
    return count;
}

/// The next entry of that kind in the black box, from `*at` on.
static blackbox_entry_t noted(blackbox_kind_t kind, uint64_t *at) {
    uint64_t first = *at;
    const size_t count = look(&first);
    for (size_t i = 0; i < count; i++) {
        if (found[i].kind == kind) {
            *at = first + i + 1U;
            return found[i];
        }
    }
    TEST_FAIL_MESSAGE(blackbox_kind_name(kind));
    return (blackbox_entry_t){0};
}

TEST(test_each_request_is_noted_with_who_asked_and_what_became_of_it) {
    const iw_client_t id = daemon_rig.daemon->clients.client[0].id;
    uint64_t at = noted_so_far();
    daemon_rig_arm(client);
    const blackbox_entry_t arm = noted(BLACKBOX_ARM, &at);
    TEST_ASSERT_EQUAL_UINT32(id, arm.number);
    TEST_ASSERT_EQUAL_UINT8(IW_REFUSE_NONE, arm.b);
    at = noted_so_far();
    assert_reply("{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":-50}", "\"ok\":true");
    const blackbox_entry_t drive = noted(BLACKBOX_DRIVE, &at);
    TEST_ASSERT_EQUAL_UINT32(id, drive.number);
    TEST_ASSERT_EQUAL_INT32(100, drive.as.drive.speed_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(-50, drive.as.drive.speed_mm_s[IW_RIGHT]);
    TEST_ASSERT_EQUAL_UINT32(0U, drive.as.drive.age_us);
    at = noted_so_far();
    assert_reply("{\"cmd\":\"estop\"}", "\"ok\":true");
    TEST_ASSERT_EQUAL_UINT32(id, noted(BLACKBOX_ESTOPPED, &at).number);
    daemon_rig_run(2000);
    at = noted_so_far();
    assert_reply("{\"cmd\":\"reset\"}", "\"ok\":true");
    TEST_ASSERT_EQUAL_UINT8(IW_REFUSE_NONE, noted(BLACKBOX_RESET, &at).b);
    at = noted_so_far();
    assert_reply("{\"cmd\":\"tare\",\"side\":\"right\"}", "\"ok\":true");
    const blackbox_entry_t tare = noted(BLACKBOX_TARE, &at);
    TEST_ASSERT_EQUAL_UINT8(IW_RIGHT, tare.a);
    TEST_ASSERT_EQUAL_UINT8(IW_TARE_OK, tare.b);
}

TEST(test_tare_tells_of_each_wheel_the_zero_it_had) {
    iw_force_t *force = daemon_rig.daemon->wheels.core.force;
    daemon_rig_run(3000);
    assert_reply("{\"cmd\":\"tare\"}", "\"ok\":true");
    force[IW_LEFT].offset_mN += 1110;
    force[IW_RIGHT].offset_mN -= 2220;
    char left[64];
    char right[64];
    (void)snprintf(left, sizeof left, "\"before_mN\":%d,", (int)force[IW_LEFT].offset_mN);
    (void)snprintf(right, sizeof right, "\"before_mN\":%d,", (int)force[IW_RIGHT].offset_mN);
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"tare\"}");
    const char *second = strstr(reply, "\"right\":{");
    TEST_ASSERT_NOT_NULL_MESSAGE(second, reply);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(second, right), reply);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, left), reply);
    TEST_ASSERT_TRUE_MESSAGE(strstr(reply, left) < second, reply);
}

TEST(test_tare_of_one_wheel_tells_of_that_wheel) {
    static const char *const sides[] = {"left", "right"};
    iw_force_t *force = daemon_rig.daemon->wheels.core.force;
    char line[64];
    char told[32];
    for (unsigned side = 0; side < IW_SIDES; side++) {
        daemon_rig_run(3000);
        memset(daemon_rig.daemon->assumptions.tare, 0, sizeof daemon_rig.daemon->assumptions.tare);
        force[1U - side].offset_mN = 7777;
        (void)snprintf(line, sizeof line, "{\"cmd\":\"tare\",\"side\":\"%s\"}", sides[side]);
        const char *reply = daemon_rig_ask(client, line);
        (void)snprintf(told, sizeof told, "\"offset_mN\":%d,", (int)force[side].offset_mN);
        TEST_ASSERT_TRUE(force[side].offset_mN != 7777);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, told), reply);
        TEST_ASSERT_NULL_MESSAGE(strstr(reply, "\"samples\":0,"), reply);
    }
}

/// The daemon's own steps stand still: what a request does, and at which time, is its own doing.
static void carry_out(const char *line) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    daemon->wheels.now_us = daemon_rig.now_us - 5000U; // Of a cycle that has gone on for a while,
    daemon->wheels.time_used = true;                   // and in which there was a request before.
    daemon->wheels.requested = false;
    daemon->clients.handler.carry_out(daemon->clients.handler.context, &daemon->clients.client[0], line, strlen(line));
}

TEST(test_request_happens_when_it_is_carried_out_and_asks_for_a_step) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    daemon_rig_arm(client);
    carry_out("{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":100}");
    TEST_ASSERT_TRUE(daemon->wheels.requested);
    carry_out("{\"cmd\":\"estop\"}");
    TEST_ASSERT_TRUE(daemon->wheels.requested);
    TEST_ASSERT_EQUAL_UINT64(daemon_rig.now_us, gw_wheels_look(&daemon->wheels).seen_us[IW_CAUSE_ESTOP_SOFTWARE]);
    daemon_rig_run(2000);
    carry_out("{\"cmd\":\"reset\"}");
    TEST_ASSERT_TRUE(daemon->wheels.requested);
    daemon_rig_arm(client);
    carry_out("{\"cmd\":\"stop\"}");
    TEST_ASSERT_TRUE(daemon->wheels.requested);
    daemon_rig_run(3000);
    daemon_rig_arm(client);
    daemon_rig_drive(client, 100, 100, 100);
    daemon->wheels.now_us = daemon_rig.now_us - 5000U;
    daemon->wheels.time_used = true;
    daemon->wheels.requested = false;
    daemon->clients.handler.leave(daemon->clients.handler.context, &daemon->clients.client[0]);
    TEST_ASSERT_EQUAL_UINT64(daemon_rig.now_us, gw_wheels_look(&daemon->wheels).stop->at_us);
    TEST_ASSERT_TRUE(daemon->wheels.requested);
}

TEST(test_reset_that_waited_through_a_stop_is_refused) {
    sock_client_t *own = &daemon_rig.daemon->clients.client[0];
    assert_reply("{\"cmd\":\"estop\"}", "\"ok\":true");
    daemon_rig_run(2000);
    own->stopped_us = own->caught_up_us + 1U;
    carry_out("{\"cmd\":\"reset\"}");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    own->stopped_us = own->caught_up_us;
    carry_out("{\"cmd\":\"reset\"}");
    TEST_ASSERT_TRUE(daemon_rig_state() != IW_STATE_LATCHED);
}

TEST(test_change_of_state_is_noted_with_what_each_wheel_was_told) {
    daemon_rig.daemon->wheels.core.config.asymmetric_current = true;
    daemon_rig_arm(client);
    for (unsigned i = 0; i < 50U; i++) {
        assert_reply("{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":100,\"left_mA\":500,\"right_mA\":900}",
                     "\"ok\":true");
        daemon_rig_run(20);
    }
    uint64_t at = noted_so_far();
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    const blackbox_entry_t state = noted(BLACKBOX_STATE, &at);
    TEST_ASSERT_GREATER_THAN_INT(200, state.as.drive.speed_mm_s[IW_LEFT]);
    TEST_ASSERT_INT_WITHIN(30, 100, state.as.drive.speed_mm_s[IW_RIGHT]);
    TEST_ASSERT_EQUAL_INT(500, state.as.drive.current_mA[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(900, state.as.drive.current_mA[IW_RIGHT]);
}

TEST(test_item_of_an_earlier_run_is_noted_as_it_is_from_then_on) {
    const iw_assumption_entry_t known = {IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
    uint64_t at = noted_so_far();
    gw_wheels_set_assumption(&daemon_rig.daemon->wheels, IW_ASSUMPTION_TRACK, &known);
    const blackbox_entry_t entry = noted(BLACKBOX_ASSUMPTION, &at);
    TEST_ASSERT_EQUAL_UINT8(IW_ASSUMPTION_TRACK, entry.a);
    TEST_ASSERT_EQUAL_UINT8(IW_CONFIRMED, entry.b);
}

/// At rest: a step with frames is noted by them, and they have its time.
TEST(test_frames_are_noted_at_the_time_of_the_step_that_took_them) {
    unsigned frames = 0;
    for (unsigned ms = 0; ms < 100U; ms++) {
        const iw_time_us_t begin_us = daemon_rig.now_us;
        uint64_t at = noted_so_far();
        daemon_rig_run(1);
        const size_t count = look(&at);
        for (size_t i = 0; i < count; i++) {
            TEST_ASSERT_TRUE(found[i].at_us >= begin_us);
            frames += (found[i].kind == BLACKBOX_FRAME) ? 1U : 0U;
            TEST_ASSERT_FALSE(i > 0U && found[i].kind == BLACKBOX_FRAME && found[i - 1U].kind == BLACKBOX_STEP &&
                              found[i].at_us == found[i - 1U].at_us);
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(20U, frames);
}

TEST(test_reply_to_each_request_is_whole) {
    static const char *const replies[][2] = {
        {"{\"cmd\":\"watch\",\"topics\":[\"stop\",\"bus\"],\"rate_hz\":7}",
         "\"topics\":[\"bus\",\"stop\"],\"rate_hz\":7,\"limited\":false"},
        {"{\"cmd\":\"confirm\",\"item\":\"track\",\"how\":\"tape\"}", "\"item\":\"track\",\"state\":\"confirmed\""},
        {"{\"cmd\":\"why\"}", "\"frames_before\":["},
        {"{\"cmd\":\"status\"}", "},\"gaps\":{\"limits_ms\":["},
        {"{\"cmd\":\"status\"}", "\"worst_us\":null},\"budget\":{"},
        {"{\"cmd\":\"arm\"}", "\"stop_budget_ms\":"},
        {"{\"cmd\":\"drive\",\"left_mm_s\":0,\"right_mm_s\":0}", "\"limited\":false"},
    };
    for (size_t i = 0; i < sizeof replies / sizeof replies[0]; i++) {
        assert_reply(replies[i][0], replies[i][1]);
    }
}

TEST(test_status_tells_of_each_wheel_its_own_zero) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    daemon->assumptions.known.offset[IW_LEFT].samples = 11;
    daemon->assumptions.known.offset[IW_RIGHT].samples = 22;
    const iw_snapshot_t seen = gw_wheels_look(&daemon->wheels);
    const iwn_surroundings_t around = iwn_target_around(&daemon->answers.server, &seen);
    TEST_ASSERT_EQUAL_UINT32(11, around.zero[IW_LEFT].samples);
    TEST_ASSERT_EQUAL_UINT32(22, around.zero[IW_RIGHT].samples);
}

TEST(test_arm_is_answered_once) {
    char text[8192];
    unsigned answers = 0;
    daemon_rig_run(10);
    while (recv(client, text, sizeof text, MSG_DONTWAIT) > 0) { // Of before.
    }
    static const char line[] = "{\"cmd\":\"arm\"}\n";
    TEST_ASSERT_EQUAL_INT((int)sizeof line - 1, (int)send(client, line, sizeof line - 1U, MSG_NOSIGNAL));
    daemon_rig_run(20);
    const ssize_t size = recv(client, text, sizeof text - 1U, MSG_DONTWAIT);
    TEST_ASSERT_GREATER_THAN_INT(0, (int)size);
    text[size] = '\0';
    for (const char *at = strstr(text, "\"ok\":"); at != NULL; at = strstr(at + 1, "\"ok\":")) {
        answers++;
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1U, answers, text);
}

TEST(test_turn_with_a_track_that_is_known_to_be_another_is_denied_with_the_reason) {
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"track\",\"value\":\"900\"}", "\"state\":\"contradicted\"");
    daemon_rig_arm(client);
    assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":100,\"yaw_mrad_s\":100}", "\"error\":\"denied\",\"message\":\"track");
    assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":100,\"yaw_mrad_s\":0}", "\"ok\":true");
}

/// Answers of the port that have changed, told again and again: they are news once.
TEST(test_facts_of_the_bus_are_taken_once_for_each_change) {
    daemon_rig.link.changes++;
    daemon_rig_run(20);
    uint64_t at = noted_so_far();
    const uint32_t warnings = daemon_rig.daemon->wheels.warnings;
    daemon_rig.link.changes++;
    daemon_rig_run(900);
    TEST_ASSERT_EQUAL_UINT32(warnings, daemon_rig.daemon->wheels.warnings);
    (void)noted(BLACKBOX_FACTS, &at);
    unsigned facts = 0;
    const size_t count = look(&at);
    for (size_t i = 0; i < count; i++) {
        facts += (found[i].kind == BLACKBOX_FACTS) ? 1U : 0U;
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(1U, facts); // And once a second.
}

TEST(test_purge_by_the_port_is_told_once_in_the_log) {
    static const char *const words[] = {[IWL_LINK_PURGE_DONE] = "taken down and up again",
                                        [IWL_LINK_PURGE_NOT_ALLOWED] = "may not empty it; do: ip link",
                                        [IWL_LINK_PURGE_FAILED] = "could not be emptied; look with: ip"};
    daemon_rig_keep_log();
    for (unsigned purge = IWL_LINK_PURGE_DONE; purge <= IWL_LINK_PURGE_FAILED; purge++) {
        daemon_rig.link.purge = (iwl_link_purge_t)purge;
        daemon_rig_run(100);
    }
    for (unsigned purge = IWL_LINK_PURGE_DONE; purge <= IWL_LINK_PURGE_FAILED; purge++) {
        const char *told = strstr(daemon_rig_log(), words[purge]);
        TEST_ASSERT_NOT_NULL_MESSAGE(told, words[purge]);
        TEST_ASSERT_NULL(strstr(told + 1, words[purge]));
    }
}

TEST(test_warnings_say_what_was_left_in_the_controller_and_what_is_wrong_with_the_link) {
    daemon_rig.link =
        (iwl_bus_link_t){.presence = IWL_LINK_UP, .echo_proven = true, .bitrate_hz = 500000, .changes = 7};
    daemon_rig.daemon->answers.server.told.left_behind = true;
    gw_bus_facts_follow(&daemon_rig.daemon->facts, &daemon_rig.daemon->wheels, true);
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"status\"}");
    const char *warnings = strstr(reply, "\"warnings\":[");
    TEST_ASSERT_NOT_NULL_MESSAGE(warnings, reply);
    const char *left = strstr(warnings, "a setpoint is still in the controller");
    TEST_ASSERT_NOT_NULL_MESSAGE(left, warnings);
    TEST_ASSERT_NULL_MESSAGE(strstr(left + 1, "a setpoint is still in the controller"), "each warning once");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(warnings, "500000 bit/s"), warnings);
}

/// The log names the contact too.
static void expect_contacts(int first, int second, const char *status, const char *told) {
    daemon_rig.estop = first;
    daemon_rig.estop2 = second;
    daemon_rig_run(20);
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"status\"}");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, status), reply);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), told), daemon_rig_log());
}

TEST(test_estop_of_two_contacts_says_which_is_pressed_and_that_they_disagree) {
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    TEST_ASSERT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"status\"}"), "pressed_at"));
    wheels->hal.two_contacts = true;
    wheels->estop2 = "ESTOP2";
    iw_estop_pair_init(&wheels->hal.pair, 200000U);
    daemon_rig_keep_log();
    expect_contacts(0, 1, "\"state\":\"pressed\",\"line2\":\"ESTOP2\",\"pressed_at\":\"line2\"",
                    "pressed, pressed at line2");
    expect_contacts(1, 1, "\"pressed_at\":\"both\"", "pressed, pressed at both");
    expect_contacts(1, 0, "\"pressed_at\":\"line\"", "pressed, pressed at line");
    daemon_rig_run(300);
    expect_contacts(0, 0, "\"state\":\"disagrees\",\"line2\":\"ESTOP2\",\"pressed_at\":\"neither\"",
                    "disagrees, pressed at neither");
    daemon_rig_run(2000);
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"reset\"}");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"cause_present\""), reply);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "estop_disagrees was seen"), reply);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "press and release the button"), reply);
    expect_contacts(1, 1, "\"state\":\"disagrees\"", "disagrees, pressed at both");
    expect_contacts(0, 0, "\"state\":\"released\"", "released, pressed at neither");
    daemon_rig_run(1500);
    reply = daemon_rig_ask(client, "{\"cmd\":\"reset\"}");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"ok\":true"), reply);
}

TEST(test_refusal_names_the_contact_that_is_meant) {
    static const struct {
        int first;
        int second;
        const char *said;
    } cases[] = {{0, -1, "the e-stop SECOND cannot be read"}, {1, -1, "the e-stop SECOND cannot be read"},
                 {-1, 0, "the e-stop FIRST cannot be read"},  {-1, 1, "the e-stop FIRST cannot be read"},
                 {-1, -1, "the e-stop FIRST cannot be read"}, {0, 1, "the e-stop SECOND is pressed"},
                 {1, 0, "the e-stop FIRST is pressed"},       {1, 1, "the e-stop FIRST is pressed"}};
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    wheels->hal.two_contacts = true;
    wheels->estop = "FIRST";
    wheels->estop2 = "SECOND";
    iw_estop_pair_init(&wheels->hal.pair, 200000U);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        daemon_rig.estop = cases[i].first;
        daemon_rig.estop2 = cases[i].second;
        daemon_rig_run(20);
        const char *reply = daemon_rig_ask(client, "{\"cmd\":\"reset\"}");
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, cases[i].said), reply);
    }
    wheels->hal.two_contacts = false; // What the second said last is worth nothing then.
    TEST_ASSERT_EQUAL_STRING("FIRST", gw_wheels_estop(wheels));
    daemon_rig.estop2 = -1;
    wheels->hal.contact_last[1] = -1;
    TEST_ASSERT_EQUAL_STRING("FIRST", gw_wheels_estop(wheels));
}

TEST(test_warning_that_goes_on_is_said_once) {
    static iwl_estop_ops_t none;
    none = *daemon_rig.daemon->wheels.hal.estop_ops;
    none.present = false;
    daemon_rig.daemon->wheels.hal.estop_ops = &none;
    for (unsigned change = 0; change < 3U; change++) {
        daemon_rig.link.changes++;
        daemon_rig_run(1000);
    }
    const char *said = strstr(daemon_rig_ask(client, "{\"cmd\":\"status\"}"), "there is no e-stop line");
    TEST_ASSERT_NOT_NULL(said);
    TEST_ASSERT_NULL(strstr(said + 1, "there is no e-stop line"));
}
