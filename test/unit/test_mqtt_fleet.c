// SPDX-License-Identifier: MIT
// The rows of the fleet console, from messages of machines and of other clients at the broker.
#include "fleet.h"

#include "iwheel_northbound/why.h"
#include "unit.h"

#include <stdlib.h>
#include <string.h>

static fleet_t fleet;
static char *shown;
static size_t shown_size;

void setUp(void) {
    TEST_ASSERT_TRUE(fleet_open(&fleet));
}

void tearDown(void) {
    fleet_close(&fleet);
    free(shown);
    shown = NULL;
}

static void receive(const char *topic, const char *payload) {
    fleet_take(&fleet, topic, payload, strlen(payload), 1000000U);
}

static const char *show(void (*how)(const fleet_t *self, uint64_t now_us, FILE *out)) {
    free(shown);
    FILE *out = open_memstream(&shown, &shown_size);
    how(&fleet, 3000000U, out);
    (void)fclose(out);
    return shown;
}

static const char state[] =
    "{\"boot\":\"1\",\"event\":\"state\",\"version\":\"0.2.0\",\"state\":\"latched\",\"left\":{\"battery_dV\":240,"
    "\"offset_provenance\":\"operator\",\"offset_contaminated\":false},\"right\":{\"battery_dV\":null,"
    "\"offset_provenance\":\"estimated\",\"offset_contaminated\":true},\"ledger\":{\"radius\":{\"state\":"
    "\"contradicted\"},\"track\":{\"state\":\"confirmed\"}}}";

TEST(test_fleet_machines_are_sorted_and_counted) {
    receive("iwheel/w2/availability", "online");
    receive("iwheel/w10/availability", "offline");
    receive("iwheel/w1/availability", "online");
    TEST_ASSERT_EQUAL_size_t(3, fleet.count);
    TEST_ASSERT_EQUAL_STRING("w1", fleet.machines[0].id);
    TEST_ASSERT_EQUAL_STRING("w10", fleet.machines[1].id);
    TEST_ASSERT_FALSE(fleet.machines[1].online);
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_show), "3 machines, 2 online\n"));
}

TEST(test_fleet_row_has_state_battery_zero_and_unknown_values) {
    receive("iwheel/w1/availability", "online");
    receive("iwheel/w1/state", state);
    const char *text = show(fleet_show);
    TEST_ASSERT_NOT_NULL(strstr(text, "online   latched      24.0     -- operator   doubted    0.2.0"));
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_print), "\"left_battery_dV\":240,\"right_battery_dV\":null,"));
    TEST_ASSERT_NOT_NULL(strstr(shown, "\"cause\":null,\"stop_wall_us\":null,"));
    TEST_ASSERT_NOT_NULL(strstr(shown, "\"heard_ms\":2000}"));
}

TEST(test_fleet_contradictions_are_counted_across_machines) {
    receive("iwheel/w1/state", state);
    receive("iwheel/w2/state", state);
    receive("iwheel/w3/availability", "online");
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_show), "contradicted: radius on 2 of 3\n"));
    TEST_ASSERT_NULL(strstr(shown, "track"));
}

TEST(test_fleet_stop_has_its_cause_without_control_characters) {
    receive("iwheel/w1/event/stop",
            "{\"event\":\"stop\",\"cause\":\"wheel_\\u001b[2Jlost\",\"wall_us\":1760000000000000,"
            "\"sentence\":\"left wheel\"}");
    const char *text = show(fleet_show);
    TEST_ASSERT_NULL(strchr(text, '\033'));
    TEST_ASSERT_NOT_NULL(strstr(text, "wheel_"));
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_print), "\"stop_wall_us\":1760000000000000,\"sentence\":\"left wheel\""));
}

TEST(test_fleet_stop_has_the_longest_sentence) {
    char sentence[IWN_SENTENCE_SIZE];
    char payload[IWN_SENTENCE_SIZE + 128U];
    memset(sentence, 's', sizeof sentence);
    sentence[sizeof sentence - 1U] = '\0';
    (void)snprintf(payload, sizeof payload, "{\"event\":\"stop\",\"cause\":\"client\",\"sentence\":\"%s\"}", sentence);
    receive("iwheel/w1/event/stop", payload);
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_print), sentence));
}

static const char *row(void) {
    return show(fleet_print);
}

TEST(test_fleet_last_stop_is_the_latest_received_one_first) {
    receive("iwheel/w1/info", "{\"last_stop\":null}");
    TEST_ASSERT_NOT_NULL(strstr(row(), "\"stop_from\":null"));
    receive("iwheel/w1/info",
            "{\"last_stop\":{\"number\":1,\"cause\":\"client\",\"wall_us\":2000,\"sentence\":\"s\"}}");
    TEST_ASSERT_NOT_NULL(
        strstr(row(), "\"cause\":\"client\",\"stop_wall_us\":2000,\"sentence\":\"s\",\"stop_from\":\"info\""));
    TEST_ASSERT_NOT_NULL(strstr(shown, "\"heard_ms\":null"));
    const char *stored = "{\"event\":\"stop\",\"cause\":\"wheel_lost\",\"wall_us\":1000}";
    fleet_take_stored(&fleet, "iwheel/w1/event/stop", stored, strlen(stored));
    TEST_ASSERT_NOT_NULL(strstr(row(), "\"stop_from\":\"info\""));
    stored = "{\"event\":\"stop\",\"cause\":\"wheel_lost\",\"wall_us\":3000}";
    fleet_take_stored(&fleet, "iwheel/w1/event/stop", stored, strlen(stored));
    TEST_ASSERT_NOT_NULL(strstr(row(), "\"stop_wall_us\":3000,\"sentence\":null,\"stop_from\":\"stream\""));
    receive("iwheel/w1/event/stop", "{\"event\":\"stop\",\"cause\":\"estop_line\",\"wall_us\":500}");
    receive("iwheel/w1/info", "{\"last_stop\":{\"number\":1,\"cause\":\"client\",\"wall_us\":9000}}");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(row(), "\"stop_wall_us\":500,"), "a clock that was set back makes it no older");
    fleet_take_stored(&fleet, "iwheel/w1/event/stop", "[", 1);
    TEST_ASSERT_EQUAL_UINT64(1, fleet.left_out);
}

TEST(test_fleet_table_names_the_source_of_the_last_stops) {
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_show), "last stops: from each machine's info"));
    fleet.stream = "n1";
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_show), "last stops: from the stream at n1"));
}

TEST(test_fleet_garbage_is_ignored_and_counted) {
    static const char *const topics[] = {"iwheel/", "iwheel//state", "iwheel/a b/state", "other/w1/state", "iwheel/w1"};
    for (size_t i = 0; i < sizeof topics / sizeof topics[0]; i++) {
        receive(topics[i], state);
    }
    TEST_ASSERT_EQUAL_size_t(0, fleet.count);
    receive("iwheel/w1/state", "{\"state\":");
    receive("iwheel/w1/state", "[]");
    receive("iwheel/w1/state", "");
    TEST_ASSERT_EQUAL_UINT64(8, fleet.left_out);
    TEST_ASSERT_EQUAL_STRING("", fleet.machines[0].state);
    receive("iwheel/w1/state", "{\"ledger\":7,\"left\":[],\"state\":null}");
    TEST_ASSERT_NOT_NULL(strstr(show(fleet_print), "\"state\":null"));
}

TEST(test_fleet_machines_beyond_the_limit_are_counted_only) {
    char topic[64];
    for (unsigned i = 0; i < FLEET_MACHINES + 5U; i++) {
        (void)snprintf(topic, sizeof topic, "iwheel/m%u/availability", i);
        receive(topic, "online");
    }
    TEST_ASSERT_EQUAL_size_t(FLEET_MACHINES, fleet.count);
    TEST_ASSERT_EQUAL_UINT64(5, fleet.left_out);
}
