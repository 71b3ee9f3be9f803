// SPDX-License-Identifier: MIT
// Daemon: replies, entries of the black box and warnings, in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include "iwheel_server/target.h"
#include <stdlib.h>
#include <string.h>

static uint64_t noted_so_far(void) {
    return blackbox_ring_written(daemon_rig.daemon->box.ring);
}

static blackbox_entry_t *found; ///< Result of the last `find_entries`.

/// Copies the entries of the black box from `*at` on. Sets `*at` to the first of them. Returns their number.
static size_t find_entries(uint64_t *at) {
    const blackbox_ring_t *ring = daemon_rig.daemon->box.ring;
    size_t count = 0;
    found = (blackbox_entry_t *)realloc(found, blackbox_ring_most(ring) * sizeof *found);
    TEST_ASSERT_NOT_NULL(found);
    *at = blackbox_ring_copy(ring, *at, noted_so_far(), found, &count);
    return count;
}

/// Returns the next entry of this kind in the black box, from `*at` on.
static blackbox_entry_t noted(blackbox_kind_t kind, uint64_t *at) {
    uint64_t first = *at;
    const size_t count = find_entries(&first);
    for (size_t i = 0; i < count; i++) {
        if (found[i].kind == kind) {
            *at = first + i + 1U;
            return found[i];
        }
    }
    TEST_FAIL_MESSAGE(blackbox_kind_name(kind));
    return (blackbox_entry_t){0};
}

TEST(test_blackbox_request_has_client_and_result) {
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

TEST(test_tare_reply_has_the_previous_offset_of_each_wheel) {
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

TEST(test_tare_of_one_wheel_replies_with_its_offset) {
    static const char *const sides[] = {"left", "right"};
    iw_force_t *force = daemon_rig.daemon->wheels.core.force;
    char line[64];
    char expected[32];
    for (unsigned side = 0; side < IW_SIDES; side++) {
        daemon_rig_run(3000);
        memset(daemon_rig.daemon->assumptions.tare, 0, sizeof daemon_rig.daemon->assumptions.tare);
        force[1U - side].offset_mN = 7777;
        (void)snprintf(line, sizeof line, "{\"cmd\":\"tare\",\"side\":\"%s\"}", sides[side]);
        const char *reply = daemon_rig_ask(client, line);
        (void)snprintf(expected, sizeof expected, "\"offset_mN\":%d,", (int)force[side].offset_mN);
        TEST_ASSERT_TRUE(force[side].offset_mN != 7777);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, expected), reply);
        TEST_ASSERT_NULL_MESSAGE(strstr(reply, "\"samples\":0,"), reply);
    }
}

/// The daemon does not step: the action of a request and its time come from the request alone.
static void carry_out(const char *line) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    daemon->wheels.now_us = daemon_rig.now_us - 5000U; // The cycle has already run for a while,
    daemon->wheels.time_used = true;                   // and it has already served a request.
    daemon->wheels.requested = false;
    daemon->clients.handler.carry_out(daemon->clients.handler.context, &daemon->clients.client[0], line, strlen(line));
}

TEST(test_request_has_its_own_time_and_triggers_a_step) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    daemon_rig_arm(client);
    carry_out("{\"cmd\":\"drive\",\"left_mm_s\":100,\"right_mm_s\":100}");
    TEST_ASSERT_TRUE(daemon->wheels.requested);
    carry_out("{\"cmd\":\"estop\"}");
    TEST_ASSERT_TRUE(daemon->wheels.requested);
    TEST_ASSERT_EQUAL_UINT64(daemon_rig.now_us, gw_wheels_snapshot(&daemon->wheels).seen_us[IW_CAUSE_ESTOP_SOFTWARE]);
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
    TEST_ASSERT_EQUAL_UINT64(daemon_rig.now_us, gw_wheels_snapshot(&daemon->wheels).stop->at_us);
    TEST_ASSERT_TRUE(daemon->wheels.requested);
}

TEST(test_reset_that_waited_during_a_stop_is_refused) {
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

TEST(test_blackbox_state_has_the_setpoint_of_each_wheel) {
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

TEST(test_blackbox_assumption_has_state_of_restored_item) {
    const iw_assumption_entry_t known = {IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
    uint64_t at = noted_so_far();
    gw_wheels_set_assumption(&daemon_rig.daemon->wheels, IW_ASSUMPTION_TRACK, &known);
    const blackbox_entry_t entry = noted(BLACKBOX_ASSUMPTION, &at);
    TEST_ASSERT_EQUAL_UINT8(IW_ASSUMPTION_TRACK, entry.a);
    TEST_ASSERT_EQUAL_UINT8(IW_CONFIRMED, entry.b);
}

/// At standstill the frames of a step have the time of the step.
TEST(test_blackbox_frames_have_the_time_of_their_step) {
    unsigned frames = 0;
    for (unsigned ms = 0; ms < 100U; ms++) {
        const iw_time_us_t begin_us = daemon_rig.now_us;
        uint64_t at = noted_so_far();
        daemon_rig_run(1);
        const size_t count = find_entries(&at);
        for (size_t i = 0; i < count; i++) {
            TEST_ASSERT_TRUE(found[i].at_us >= begin_us);
            frames += (found[i].kind == BLACKBOX_FRAME) ? 1U : 0U;
            TEST_ASSERT_FALSE(i > 0U && found[i].kind == BLACKBOX_FRAME && found[i - 1U].kind == BLACKBOX_STEP &&
                              found[i].at_us == found[i - 1U].at_us);
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(20U, frames);
}

TEST(test_reply_to_each_request_has_its_members) {
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

TEST(test_status_has_the_offset_samples_of_each_wheel) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    daemon->assumptions.known.offset[IW_LEFT].samples = 11;
    daemon->assumptions.known.offset[IW_RIGHT].samples = 22;
    const iw_snapshot_t seen = gw_wheels_snapshot(&daemon->wheels);
    const iwn_surroundings_t around = iwn_target_around(&daemon->answers.server, &seen);
    TEST_ASSERT_EQUAL_UINT32(11, around.zero[IW_LEFT].samples);
    TEST_ASSERT_EQUAL_UINT32(22, around.zero[IW_RIGHT].samples);
}

TEST(test_arm_is_answered_once) {
    daemon_rig_run(10);
    (void)daemon_rig_receive(client); // Bytes of before
    daemon_rig_send(client, "{\"cmd\":\"arm\"}\n");
    daemon_rig_run(20);
    const char *text = daemon_rig_receive(client);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1U, daemon_rig_count(text, "\"ok\":"), text);
}

TEST(test_twist_with_contradicted_track_is_denied_with_the_reason) {
    assert_reply("{\"cmd\":\"confirm\",\"item\":\"track\",\"value\":\"900\"}", "\"state\":\"contradicted\"");
    daemon_rig_arm(client);
    assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":100,\"yaw_mrad_s\":100}", "\"error\":\"denied\",\"message\":\"track");
    assert_reply("{\"cmd\":\"twist\",\"v_mm_s\":100,\"yaw_mrad_s\":0}", "\"ok\":true");
}

/// The port reports its changed state repeatedly: only the first report counts.
TEST(test_bus_facts_are_recorded_once_per_change) {
    daemon_rig.link.changes++;
    daemon_rig_run(20);
    uint64_t at = noted_so_far();
    const uint32_t warnings = daemon_rig.daemon->wheels.warnings;
    daemon_rig.link.changes++;
    daemon_rig_run(900);
    TEST_ASSERT_EQUAL_UINT32(warnings, daemon_rig.daemon->wheels.warnings);
    (void)noted(BLACKBOX_FACTS, &at);
    unsigned facts = 0;
    const size_t count = find_entries(&at);
    for (size_t i = 0; i < count; i++) {
        facts += (found[i].kind == BLACKBOX_FACTS) ? 1U : 0U;
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(1U, facts); // One entry per second is normal.
}

TEST(test_purge_by_the_port_is_logged_once) {
    static const char *const words[] = {[IWL_LINK_PURGE_DONE] = "set down and up again",
                                        [IWL_LINK_PURGE_NOT_ALLOWED] = "may not empty it; do: ip link",
                                        [IWL_LINK_PURGE_FAILED] = "could not be emptied; check it: ip"};
    daemon_rig_keep_log();
    for (unsigned purge = IWL_LINK_PURGE_DONE; purge <= IWL_LINK_PURGE_FAILED; purge++) {
        daemon_rig.link.purge = (iwl_link_purge_t)purge;
        daemon_rig_run(100);
    }
    for (unsigned purge = IWL_LINK_PURGE_DONE; purge <= IWL_LINK_PURGE_FAILED; purge++) {
        const char *expected = strstr(daemon_rig_log(), words[purge]);
        TEST_ASSERT_NOT_NULL_MESSAGE(expected, words[purge]);
        TEST_ASSERT_NULL(strstr(expected + 1, words[purge]));
    }
}

TEST(test_warnings_contain_left_setpoint_and_wrong_bitrate_once) {
    daemon_rig.link =
        (iwl_bus_link_t){.presence = IWL_LINK_UP, .echo_proven = true, .bitrate_hz = 500000, .changes = 7};
    daemon_rig.daemon->answers.server.reported.left_behind = true;
    gw_bus_facts_follow(&daemon_rig.daemon->facts, &daemon_rig.daemon->wheels, true);
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"status\"}");
    const char *warnings = strstr(reply, "\"warnings\":[");
    TEST_ASSERT_NOT_NULL_MESSAGE(warnings, reply);
    const char *left = strstr(warnings, "a setpoint is still in the controller");
    TEST_ASSERT_NOT_NULL_MESSAGE(left, warnings);
    TEST_ASSERT_NULL_MESSAGE(strstr(left + 1, "a setpoint is still in the controller"), "each warning once");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(warnings, "500000 bit/s"), warnings);
}

/// Checks the contacts in the status and in the log.
static void expect_contacts(int first, int second, const char *status, const char *expected) {
    daemon_rig.estop = first;
    daemon_rig.estop2 = second;
    daemon_rig_run(20);
    assert_reply("{\"cmd\":\"status\"}", status);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), expected), daemon_rig_log());
}

TEST(test_estop_two_contacts_status_names_pressed_and_disagreeing) {
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

TEST(test_refusal_names_the_affected_contact) {
    static const struct {
        int first;
        int second;
        const char *text;
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
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, cases[i].text), reply);
    }
    wheels->hal.two_contacts = false; // The last state of the second contact must not count.
    TEST_ASSERT_EQUAL_STRING("FIRST", gw_wheels_estop(wheels));
    daemon_rig.estop2 = -1;
    wheels->hal.contact_last[1] = -1;
    TEST_ASSERT_EQUAL_STRING("FIRST", gw_wheels_estop(wheels));
}

TEST(test_warning_that_persists_is_listed_once) {
    static iwl_estop_ops_t none;
    none = *daemon_rig.daemon->wheels.hal.estop_ops;
    none.present = false;
    daemon_rig.daemon->wheels.hal.estop_ops = &none;
    for (unsigned change = 0; change < 3U; change++) {
        daemon_rig.link.changes++;
        daemon_rig_run(1000);
    }
    const char *status_reply = strstr(daemon_rig_ask(client, "{\"cmd\":\"status\"}"), "there is no e-stop line");
    TEST_ASSERT_NOT_NULL(status_reply);
    TEST_ASSERT_NULL(strstr(status_reply + 1, "there is no e-stop line"));
}
