// SPDX-License-Identifier: MIT
// Replies and events of a machine without a daemon: it has no time of day and no process names.
#include "gateway_rig.h"
#include "unit.h"

#include "iwheel_northbound/contents.h"

#include <string.h>

static gateway_rig_t rig;
static iwn_surroundings_t around;
static char text[8192];
static iwn_out_t json;

void setUp(void) {
    gateway_rig_init(&rig);
    around = (iwn_surroundings_t){.wall_us = IWN_WALL_UNKNOWN,
                                  .version = "1.2.3",
                                  .bus = {.name = "bxcan", .timing = "confirmed", .bitrate_hz = 1000000U},
                                  .estop = {.line = "PA0", .present = true}};
    iwn_out_init(&json, text, sizeof text);
    iwn_out_open(&json, NULL, '{');
}

void tearDown(void) {
    TEST_ASSERT_NULL_MESSAGE(rig.judge.violation, rig.judge.violation);
}

static iw_snapshot_t snapshot(void) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(&rig.gateway, rig.now_us, &seen);
    return seen;
}

static void assert_contains(const char *words) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, words), words);
}

/// Closes the object, which must be valid and fit.
static void finish(void) {
    iwn_out_close(&json, '}');
    TEST_ASSERT_GREATER_THAN_size_t(0, iwn_out_finish(&json));
}

static void status(void) {
    const iw_snapshot_t seen = snapshot();
    iwn_write_machine(&seen, &around, &json);
    iwn_write_rest(&seen, &around, &json);
    finish();
}

TEST(test_status_without_a_time_of_day_has_null) {
    status();
    assert_contains("\"wall_us\":null");
    assert_contains("\"version\":\"1.2.3\"");
    assert_contains("\"sample_point_permille\":null"); // A value that is not reported is null, not 0.
    assert_contains("\"load_permille\":null");
    assert_contains("\"warnings\":[]");
}

TEST(test_status_before_telemetry_of_a_wheel_has_null_values) {
    status();
    assert_contains("\"left\":{\"heard\":false,\"at_rest\":null,\"speed_rpm\":null,\"speed_mm_s\":null");
    assert_contains("\"battery_dV\":null");
    assert_contains("\"force_net_mN\":null");
    assert_contains("\"offset_age_ms\":null");
}

TEST(test_status_holder_without_name_or_process_has_its_number) {
    gateway_rig_arm(&rig);
    (void)gateway_rig_cruise(&rig, 300, 300, 200000U);
    around.holder = (iwn_holder_t){.client = HOLDER};
    status();
    assert_contains("\"lease\":{\"holder\":7,\"name\":null,\"pid\":null,\"remaining_ms\":");
    assert_contains("\"state\":\"armed\"");
    assert_contains("\"commanded_mm_s\":300");
}

TEST(test_status_estop_has_its_second_contact_only_if_configured) {
    status();
    assert_contains("\"estop\":{\"line\":\"PA0\",\"state\":\"released\",\"simulated\":false");
    around.estop.line2 = "PA1";
    around.estop.pressed_at = "line2";
    around.estop.answer = IW_ESTOP_DISAGREES;
    status();
    assert_contains("\"state\":\"disagrees\",\"line2\":\"PA1\",\"pressed_at\":\"line2\",\"simulated\":false");
    around.estop = (iwn_estop_t){.line = "PA0", .present = true};
}

TEST(test_status_warnings_are_in_order) {
    around.warning[0] = "one";
    around.warning[1] = "two";
    around.warnings = 2;
    status();
    assert_contains("\"warnings\":[\"one\",\"two\"]");
}

TEST(test_stop_without_a_time_of_day_has_its_age) {
    gateway_rig_arm(&rig);
    (void)gateway_rig_cruise(&rig, 300, 300, 200000U);
    gateway_rig_press(&rig, true);
    gateway_rig_run(&rig, 500000U);
    const iw_snapshot_t seen = snapshot();
    iwn_stop_note_t note = {.stop = *seen.stop, .wall_us = IWN_WALL_UNKNOWN, .sentence = "pressed"};
    iwn_write_stop(&note, rig.now_us, &json);
    finish();
    assert_contains("\"cause\":\"estop_line\"");
    assert_contains("\"wall_us\":null");
    assert_contains("\"age_ms\":499");
}

TEST(test_stop_that_never_happened_has_only_its_number) {
    const iwn_stop_note_t none = {.wall_us = IWN_WALL_UNKNOWN};
    iwn_write_stop(&none, rig.now_us, &json);
    finish();
    assert_contains("\"number\":0,\"cause\":null,\"side\":null,\"detail\":null");
    assert_contains("\"at_us\":null,\"wall_us\":null,\"age_ms\":null");
}

TEST(test_lease_event_has_gained_moved_or_lost) {
    const struct {
        iw_client_t holder;
        iw_client_t former;
        const char *words;
    } rows[] = {{7, IW_CLIENT_NONE, "\"change\":\"gained\",\"holder\":7,\"name\":\"me\",\"former\":null"},
                {7, 8, "\"change\":\"moved\",\"holder\":7,\"name\":\"me\",\"former\":8"},
                {IW_CLIENT_NONE, 8, "\"change\":\"lost\",\"holder\":null,\"name\":null,\"former\":8"}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const iwn_holder_t holder = {.client = rows[i].holder, .name = "me"};
        json = iwn_write_event(text, sizeof text, "lease");
        iwn_write_lease(&holder, rows[i].former, &json);
        finish();
        assert_contains(rows[i].words);
    }
}

TEST(test_reply_that_does_not_fit_is_empty) {
    const iwn_id_t id = {.kind = IWN_ID_NUMBER, .number = 5};
    const iwn_refusal_t refusal = {.error = IWN_BUSY, .message = "somebody else drives"};
    char line[128];
    const size_t length = iwn_write_refusal(line, sizeof line, &id, &refusal);
    TEST_ASSERT_EQUAL_STRING_LEN("{\"id\":5,\"ok\":false,\"error\":\"busy\",\"message\":\"somebody else drives\"}\n",
                                 line, length);
    for (size_t size = 0; size < length; size++) {
        TEST_ASSERT_EQUAL_size_t(0, iwn_write_refusal(line, size, &id, &refusal));
    }
}
