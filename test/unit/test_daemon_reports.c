// SPDX-License-Identifier: MIT
// Reports of the daemon about itself and their times: to watchers, in the log and in refusals, in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include "iwheel_server/target.h"
#include "start/start_report.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

TEST(test_bus_that_cannot_be_opened_is_named) {
    const gateway_config_t *config = &daemon_rig.daemon->config;
    char *text = NULL;
    size_t length = 0;
    FILE *err = open_memstream(&text, &length);
    TEST_ASSERT_NOT_NULL(err);
    gw_report_unopened(config, config->bus.interface, ENODEV, err);
    (void)fclose(err);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, config->bus.interface), text);
    free(text);
}

/// Before this time the first telemetry may still arrive.
TEST(test_wheel_without_power_is_a_fault_one_second_after_start) {
    const uint32_t lost = 1U << IW_CAUSE_WHEEL_LOST;
    sim_world_power(&daemon_rig.world, daemon_rig.now_us, false);
    daemon_rig_crash();
    daemon_rig_start();
    daemon_rig_run(IWN_FIRST_TELEMETRY_US / IW_US_PER_MS - 50U);
    TEST_ASSERT_EQUAL_UINT32(0U, daemon_rig.daemon->answers.server.reported.present & lost);
    daemon_rig_run(100);
    TEST_ASSERT_EQUAL_UINT32(lost, daemon_rig.daemon->answers.server.reported.present & lost);
}

TEST(test_status_has_at_most_the_maximum_of_warnings) {
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    iw_snapshot_t seen = gw_wheels_snapshot(wheels);
    seen.holding = seen.rolling = true;
    for (wheels->warnings = IWN_WARNINGS - 2U; wheels->warnings <= IWN_WARNINGS; wheels->warnings++) {
        const iwn_surroundings_t around = iwn_target_around(&daemon_rig.daemon->answers.server, &seen);
        TEST_ASSERT_EQUAL_UINT32(IWN_WARNINGS, around.warnings);
    }
}

TEST(test_hello_has_the_time_of_its_cycle) {
    daemon_rig_run(7);
    const iw_time_us_t before_us = daemon_rig.now_us;
    const int other = daemon_rig_connect();
    daemon_rig_run(5);
    const char *text = daemon_rig_receive(other);
    const char *found = strstr(text, "\"t_us\":");
    TEST_ASSERT_NOT_NULL_MESSAGE(found, text);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64(before_us, strtoull(found + strlen("\"t_us\":"), NULL, 10));
    (void)close(other);
}

TEST(test_arm_without_a_setpoint_type_names_the_section) {
    daemon_rig.daemon->wheels.core.config.setpoint_type_set = false;
    assert_reply("{\"cmd\":\"arm\"}", "under [wheels] in the configuration");
}

TEST(test_arm_without_a_track_names_key_section_and_command) {
    daemon_rig.daemon->wheels.core.config.track_mm = 0;
    assert_reply("{\"cmd\":\"arm\"}", "\"error\":\"track_not_set\"");
    assert_reply("{\"cmd\":\"arm\"}",
                 "\"track_mm not configured, and every limit of turning depends on it; set it under "
                 "[wheels] in the configuration (iwheelctl bringup measures it)\"");
}

TEST(test_log_of_estop_is_warning_if_pressed_info_if_released) {
    daemon_rig_keep_log();
    daemon_rig.estop = 1;
    daemon_rig_run(20);
    daemon_rig.estop = 0;
    daemon_rig_run(20);
    const char *pressed = strstr(daemon_rig_log(), "warning: e-stop ");
    TEST_ASSERT_NOT_NULL_MESSAGE(pressed, daemon_rig_log());
    TEST_ASSERT_NULL_MESSAGE(strstr(pressed + 1, "warning: e-stop "), daemon_rig_log());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(pressed, "info: e-stop "), daemon_rig_log());
}

/// Sends a line, waits for 30 ms, and returns all received bytes.
static const char *said_after(const char *line) {
    daemon_rig_send(client, line);
    daemon_rig_run(30);
    return daemon_rig_receive(client);
}

/// Checks that an event with this name has arrived and contains `part`.
static void assert_reported(const char *text_sent, const char *name, const char *part) {
    char begin[64];
    char line[8192];
    (void)snprintf(begin, sizeof begin, "{\"event\":\"%s\",", name);
    const char *event = strstr(text_sent, begin);
    TEST_ASSERT_NOT_NULL_MESSAGE(event, begin);
    (void)snprintf(line, sizeof line, "%.*s", (int)strcspn(event, "\n"), event);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line, part), line);
    TEST_ASSERT_EQUAL_CHAR('}', line[strlen(line) - 1U]);
}

TEST(test_events_are_complete_and_do_not_wait_for_the_rate) {
    (void)said_after("{\"cmd\":\"watch\",\"topics\":[\"bus\",\"lease\",\"stop\",\"state\"],\"rate_hz\":1}\n");
    daemon_rig_run(1000);
    do {
        (void)said_after("");
    } while (daemon_rig.daemon->answers.served[0].client.next_us < daemon_rig.now_us + MS(500));
    const char *text_sent = said_after("{\"cmd\":\"arm\",\"name\":\"pendant\"}\n");
    assert_reported(text_sent, "lease", "\"change\":\"gained\"");
    assert_reported(text_sent, "lease", "\"name\":\"pendant\"");
    assert_reported(text_sent, "state", "\"state\":\"armed\"");
    text_sent = said_after("{\"cmd\":\"stop\"}\n");
    assert_reported(text_sent, "stop", "\"cause\":\"client_stop\"");
    assert_reported(text_sent, "stop", "\"client_name\":\"pendant\"");
    assert_reported(text_sent, "lease", "\"change\":\"lost\"");
    daemon_rig.bus = IW_BUS_OFF;
    assert_reported(said_after(""), "bus", "\"state\":\"bus_off\"");
}

TEST(test_log_has_holder_of_a_lease_and_sentence_of_a_stop) {
    char sentence[1024];
    daemon_rig_keep_log();
    assert_reply("{\"cmd\":\"arm\",\"name\":\"pendant\"}", "\"ok\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), "lease gained: \"pendant\" (client"), daemon_rig_log());
    assert_reply("{\"cmd\":\"stop\"}", "\"ok\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), "lease lost: no holder"), daemon_rig_log());
    const iwn_stop_note_t *note = &daemon_rig.daemon->answers.server.last_stop;
    (void)snprintf(sentence, sizeof sentence, "stop %u: %s\n", (unsigned)note->stop.number, note->sentence);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), sentence), daemon_rig_log());
}

/// The report must precede the next step, because the client may have ended then.
TEST(test_stop_is_reported_with_its_request) {
    static const char line[] = "{\"cmd\":\"stop\"}";
    gw_daemon_t *daemon = daemon_rig.daemon;
    const sock_handler_t *handler = &daemon->clients.handler;
    daemon_rig_arm(client);
    daemon_rig_drive(client, 100, 100, 200);
    const uint32_t before = daemon->answers.server.reported.stop_number;
    handler->carry_out(handler->context, &daemon->clients.client[0], line, sizeof line - 1U);
    TEST_ASSERT_EQUAL_UINT32(before + 1U, daemon->answers.server.reported.stop_number);
}

TEST(test_arm_ended_by_estop_is_refused_with_id_and_reason) {
    const int other = daemon_rig_connect();
    daemon_rig_run(20);
    daemon_rig_keep_log();
    daemon_rig_send(client, "{\"id\":41,\"cmd\":\"arm\"}\n");
    daemon_rig_send(other, "{\"cmd\":\"estop\",\"reason\":\"smoke\"}\n");
    const char *text_sent = said_after("");
    TEST_ASSERT_NOT_NULL_MESSAGE(
        strstr(text_sent, "\"id\":41,\"ok\":false,\"error\":\"cause_present\",\"message\":\"estop_software"),
        text_sent);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig_log(), "smoke"), daemon_rig_log());
    (void)close(other);
}

TEST(test_tare_replies_with_the_window_of_each_wheel) {
    static const char *const sides[IW_SIDES] = {"left", "right"};
    char found[64];
    daemon_rig_run(3000);
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"tare\"}");
    const iw_force_quality_t *stored = daemon_rig.daemon->assumptions.tare;
    const iw_force_t *force = daemon_rig.daemon->wheels.core.force;
    TEST_ASSERT_NOT_EQUAL_INT(stored[IW_LEFT].deviation_mN, stored[IW_RIGHT].deviation_mN);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(iw_force_measure(&force[side]).deviation_mN, stored[side].deviation_mN);
        (void)snprintf(found, sizeof found, "\"%s\":{\"offset_mN\":%d,\"samples\":%d,\"deviation_mN\":%d,", sides[side],
                       (int)force[side].offset_mN, (int)stored[side].samples, (int)stored[side].deviation_mN);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, found), reply);
    }
}

TEST(test_request_after_an_arm_is_answered_after_it) {
    (void)said_after("");
    const char *text_sent = said_after("{\"id\":1,\"cmd\":\"arm\"}\n{\"id\":2,\"cmd\":\"hello\"}\n");
    const char *first = strstr(text_sent, "\"id\":1,\"ok\":true");
    TEST_ASSERT_NOT_NULL_MESSAGE(first, text_sent);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(first, "\"id\":2,\"ok\":true"), text_sent);
}

TEST(test_refusal_of_recordings_and_arm_has_the_reason) {
    assert_reply("{\"cmd\":\"recordings\"}", "nothing is recorded: [record] blackbox_s is 0");
    iw_assumption_contradict(&daemon_rig.daemon->wheels.core.assumptions, IW_ASSUMPTION_SETPOINT_TYPE,
                             IW_SOURCE_OPERATOR, 0);
    assert_reply("{\"cmd\":\"arm\"}", "setpoint_type");
}

TEST(test_battery_low_names_its_wheel_and_fault_is_reported_once) {
    static const char *const sentences[IW_SIDES] = {"the left wheel's battery", "the right wheel's battery"};
    gw_health_t *health = &daemon_rig.daemon->wheels.health;
    (void)said_after("{\"cmd\":\"watch\",\"topics\":[\"stop\"]}\n");
    daemon_rig_keep_log();
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const unsigned other = 1U - side;
        const unsigned before[IW_SIDES] = {daemon_rig_logged(sentences[IW_LEFT]),
                                           daemon_rig_logged(sentences[IW_RIGHT])};
        health->limits.battery_low_dV = 255;
        health->present[other][GW_BATTERY_LOW] = true; // Reported before
        daemon_rig_run(GW_HEALTH_US / IW_US_PER_MS + 200U);
        TEST_ASSERT_EQUAL_UINT(before[side] + 1U, daemon_rig_logged(sentences[side]));
        TEST_ASSERT_EQUAL_UINT(before[other], daemon_rig_logged(sentences[other]));
        TEST_ASSERT_EQUAL_UINT(0, daemon_rig_logged("fault: battery_low"));
        health->limits.battery_low_dV = 1;
        health->present[side][GW_BATTERY_LOW] = false;
        daemon_rig_run(GW_HEALTH_US / IW_US_PER_MS + 200U);
        TEST_ASSERT_EQUAL_UINT(side + 1U, daemon_rig_logged("fault gone: battery_low"));
        assert_reported(said_after(""), "fault", "\"cause\":\"battery_low\",\"present\":false");
    }
}

TEST(test_frame_event_is_complete) {
    (void)said_after("{\"cmd\":\"watch\",\"topics\":[\"frame\"]}\n");
    daemon_rig_run(200);
    const char *text_sent = said_after("");
    assert_reported(text_sent, "frame", "\"data\":");
}

TEST(test_button_uses_the_configured_debounce_time) {
    const gw_daemon_t *daemon = daemon_rig.daemon;
    TEST_ASSERT_NOT_EQUAL_UINT(0, daemon->config.estop.debounce_ms);
    TEST_ASSERT_EQUAL_UINT64(MS(daemon->config.estop.debounce_ms), daemon->assumptions.button.debounce_us);
}
