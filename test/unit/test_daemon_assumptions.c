// SPDX-License-Identifier: MIT
// State of an earlier run compared with this run: in the loop of the daemon, with a file process that the test plays.
#include "answers/answers.h"
#include "daemon_rig.h"
#include "inspect/assumption.h"
#include "sockets/sock_clients.h"

#include "unit.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

static int client;
static gw_stored_t stored;
static gw_file_store_news_t news;
static char text[GW_ASSUMPTIONS_FILE_SIZE];
static size_t length;
static unsigned writes;
static bool set_aside;
static char status_before[SOCK_REPLY_MAX]; ///< Last status that was compared

int gw_file_store_open(gw_file_store_t *self, const char *directory, const char *name) {
    (void)directory;
    (void)name;
    *self = (gw_file_store_t){.child = {.fd = -1}};
    return 0;
}

bool gw_file_store_write(gw_file_store_t *self, const char *written, size_t size) {
    (void)self;
    memcpy(text, written, size);
    length = size;
    writes++;
    return true;
}

void gw_file_store_set_aside(gw_file_store_t *self) {
    (void)self;
    set_aside = true;
}

gw_file_store_news_t gw_file_store_receive(gw_file_store_t *self, const char **out_text, size_t *out_length,
                                           int *out_error) {
    const gw_file_store_news_t now = news;
    (void)self;
    *out_length = length;
    *out_error = 0;
    *out_text = text;
    news = GW_FILE_STORE_NO_NEWS;
    return now;
}

void gw_file_store_close(gw_file_store_t *self) {
    (void)self;
}

static const iw_config_t *config(void) {
    return &daemon_rig.daemon->wheels.core.config;
}

static const iw_assumption_entry_t *entry(iw_assumption_item_t item) {
    return &daemon_rig.daemon->wheels.core.assumptions.entry[item];
}

/// Stores a finding of an earlier run for the configured value.
static void store(iw_assumption_item_t item, iw_assumption_state_t state, iw_source_t source) {
    gw_stored_item_t *known = &stored.item[item];
    const bool measured = source == IW_SOURCE_BUS; // A confirmation by the operator has no figure.
    known->entry = (iw_assumption_entry_t){.state = state, .source = source, .figure = measured ? 1000 : 0};
    known->since_wall_us = 1700000000000000;
    inspect_assumption_value(&daemon_rig.daemon->assumptions.configured, item, known->value);
}

static void store_offset(iw_side_t side, iw_force_unit_t unit, int32_t offset_mN) {
    stored.offset[side] = (gw_stored_offset_t){
        .from = IW_OFFSET_OPERATOR, .unit = unit, .offset_mN = offset_mN, .samples = 40, .wall_us = 1700000000000000};
}

static void observe(void) {
    const iw_snapshot_t seen = gw_wheels_snapshot(&daemon_rig.daemon->wheels);
    gw_assumptions_observe(&daemon_rig.daemon->assumptions, &seen);
}

/// The file process sends the text as soon as the loop runs.
static void print_stored(void) {
    length = gw_assumptions_file_write(&stored, daemon_rig.daemon->config.bus.interface, text, sizeof text);
    news = GW_FILE_STORE_READ;
    daemon_rig.daemon->assumptions.answered = false;
    daemon_rig.daemon->assumptions.start_us = daemon_rig.now_us;
    daemon_rig_run(20);
    TEST_ASSERT_TRUE(daemon_rig.daemon->assumptions.answered);
    TEST_ASSERT_FALSE(set_aside);
}

void setUp(void) {
    memset(&stored, 0, sizeof stored);
    news = GW_FILE_STORE_NO_NEWS;
    writes = 0;
    set_aside = false;
    status_before[0] = '\0';
    daemon_rig_begin();
    client = daemon_rig_connect();
}

void tearDown(void) {
    (void)close(client);
    daemon_rig_end();
}

TEST(test_stored_finding_for_the_configured_value_is_applied) {
    store(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED, IW_SOURCE_BUS);
    print_stored();
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, entry(IW_ASSUMPTION_GEAR_RATIO)->state);
    TEST_ASSERT_EQUAL_INT(IW_SOURCE_BUS, entry(IW_ASSUMPTION_GEAR_RATIO)->source);
}

TEST(test_stored_finding_for_another_value_is_dropped) {
    store(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED, IW_SOURCE_OPERATOR);
    (void)strcpy(stored.item[IW_ASSUMPTION_GEAR_RATIO].value, "7");
    print_stored();
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, entry(IW_ASSUMPTION_GEAR_RATIO)->state);
}

TEST(test_stored_contradiction_denies_arm) {
    store(IW_ASSUMPTION_SETPOINT_TYPE, IW_CONTRADICTED, IW_SOURCE_OPERATOR);
    print_stored();
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, entry(IW_ASSUMPTION_SETPOINT_TYPE)->state);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "\"error\":\"denied\""));
}

/// A contradiction is read at arm, so the file must come first.
TEST(test_arm_before_the_store_has_answered_is_denied) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    assumptions->answered = false;
    assumptions->start_us = daemon_rig.now_us;
    daemon_rig_run(GW_ASSUMPTIONS_PATIENCE_US / IW_US_PER_MS / 2U);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "\"error\":\"denied\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(daemon_rig.reply, "try again in a second"), daemon_rig.reply);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
    store(IW_ASSUMPTION_MOUNT_SIGN_LEFT, IW_CONTRADICTED, IW_SOURCE_OPERATOR);
    print_stored();
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "mount_sign_left is contradicted"));
}

TEST(test_arm_after_the_patience_needs_no_store) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    assumptions->answered = false;
    assumptions->start_us = daemon_rig.now_us;
    daemon_rig_run(GW_ASSUMPTIONS_PATIENCE_US / IW_US_PER_MS + 100U);
    daemon_rig_arm(client);
}

TEST(test_stored_contradiction_that_comes_late_is_reported) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    daemon_rig_keep_log();
    assumptions->store.waits = true;
    store(IW_ASSUMPTION_MOUNT_SIGN_LEFT, IW_CONTRADICTED, IW_SOURCE_OPERATOR);
    length = gw_assumptions_file_write(&stored, daemon_rig.daemon->config.bus.interface, text, sizeof text);
    news = GW_FILE_STORE_READ;
    daemon_rig_run(50);
    assumptions->store.waits = false;
    TEST_ASSERT_EQUAL_UINT(1, daemon_rig_logged("assumption mount_sign_left = no is contradicted by the operator"));
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "mount_sign_left is contradicted"));
}

/// The file process waits for the disk, and this run does not: what a person does meanwhile is newer than the file.
TEST(test_late_file_does_not_replace_what_the_operator_did) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    daemon_rig_run(3000);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"tare\"}"), "\"ok\":true"));
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"confirm\",\"item\":\"mount_sign_left\"}"),
                                "\"state\":\"confirmed\""));
    const int32_t tared_mN = assumptions->known.offset[IW_LEFT].offset_mN;
    store(IW_ASSUMPTION_MOUNT_SIGN_LEFT, IW_CONTRADICTED, IW_SOURCE_OPERATOR);
    store(IW_ASSUMPTION_MOUNT_SIGN_RIGHT, IW_CONFIRMED, IW_SOURCE_OPERATOR);
    store_offset(IW_LEFT, config()->force_unit[IW_LEFT], tared_mN + 9000);
    assumptions->store.waits = true;
    length = gw_assumptions_file_write(&stored, daemon_rig.daemon->config.bus.interface, text, sizeof text);
    news = GW_FILE_STORE_READ;
    daemon_rig_run(50);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, entry(IW_ASSUMPTION_MOUNT_SIGN_LEFT)->state);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, entry(IW_ASSUMPTION_MOUNT_SIGN_RIGHT)->state);
    TEST_ASSERT_EQUAL_INT32(tared_mN, assumptions->known.offset[IW_LEFT].offset_mN);
    TEST_ASSERT_EQUAL_INT32(tared_mN, daemon_rig.daemon->wheels.core.force[IW_LEFT].offset_mN);
}

/// The file has values that this run does not know.
TEST(test_close_before_the_file_is_read_does_not_overwrite_it) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    daemon_rig_run(3000);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"tare\"}"), "\"ok\":true"));
    writes = 0;
    for (unsigned loading = 0; loading < 2U; loading++) {
        assumptions->changed = true;
        assumptions->state = (loading == 0U) ? GW_ASSUMPTIONS_LOADING : GW_ASSUMPTIONS_STORED;
        gw_assumptions_close(assumptions);
        TEST_ASSERT_EQUAL_UINT(loading, writes);
    }
}

/// No cause of a stop names a contradiction: docs/developer/ledger.md promises the next arm.
TEST(test_contradiction_during_a_drive_takes_effect_at_the_next_arm) {
    daemon_rig_begin_driving(client);
    TEST_ASSERT_NOT_NULL(
        strstr(daemon_rig_ask(client, "{\"cmd\":\"confirm\",\"item\":\"mount_sign_left\",\"value\":\"yes\"}"),
               "\"state\":\"contradicted\""));
    daemon_rig_drive(client, 500, 500, 300);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    (void)daemon_rig_ask(client, "{\"cmd\":\"stop\"}");
    daemon_rig_run(3000);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"arm\"}"), "mount_sign_left is contradicted"));
}

TEST(test_stored_confirmation_does_not_lift_a_contradiction) {
    store(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED, IW_SOURCE_OPERATOR);
    iw_assumption_contradict(&daemon_rig.daemon->wheels.core.assumptions, IW_ASSUMPTION_GEAR_RATIO, IW_SOURCE_BUS,
                             3000);
    print_stored();
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, entry(IW_ASSUMPTION_GEAR_RATIO)->state);
}

static bool is_warned_of(const char *what) {
    const gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    for (uint32_t i = 0; i < wheels->warnings; i++) {
        if (strstr(wheels->warning[i], what) != NULL) {
            return true;
        }
    }
    return false;
}

TEST(test_stored_button_proof_removes_the_warning) {
    const gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    print_stored();
    daemon_rig_run(50);
    TEST_ASSERT_TRUE(wheels->estop_untried);
    TEST_ASSERT_EQUAL_INT64(0, wheels->estop_tried_us);
    TEST_ASSERT_TRUE(is_warned_of("was never seen to work on this wiring"));
    stored.tried = (gw_tried_t){.wall_us = 1700000000000000, .contact = {{.active_high = true, .line = "ESTOP"}}};
    print_stored();
    daemon_rig_run(50);
    TEST_ASSERT_FALSE(wheels->estop_untried);
    TEST_ASSERT_EQUAL_INT64(1700000000000000, wheels->estop_tried_us);
    TEST_ASSERT_FALSE(is_warned_of("was never seen to work on this wiring"));
}

static const iwl_estop_seen_t *see_line(const void *self) {
    static const iwl_estop_seen_t line = {.chip = "chip", .line = "ESTOP"};
    (void)self;
    return &line;
}

/// The file may arrive after the first poll of the button: it is compared with the wiring anyway, and does not replace
/// a newer proof.
TEST(test_stored_button_proof_of_another_wiring_is_void) {
    static iwl_estop_ops_t ops;
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    ops = *wheels->hal.estop_ops;
    ops.seen = see_line;
    wheels->hal.estop_ops = &ops;
    daemon_rig_run(50);
    stored.tried = (gw_tried_t){.wall_us = 1700000000000000,
                                .contact = {{.active_high = true, .line = "OTHER", .seen = *see_line(NULL)}}};
    print_stored();
    daemon_rig_run(50);
    TEST_ASSERT_TRUE(wheels->estop_untried);
    TEST_ASSERT_TRUE(is_warned_of("was never seen to work on this wiring"));
    (void)strcpy(stored.tried.contact[0].line, "ESTOP");
    print_stored();
    stored.tried.wall_us = 1600000000000000;
    print_stored();
    daemon_rig_run(50);
    TEST_ASSERT_EQUAL_INT64(1700000000000000, wheels->estop_tried_us);
}

/// A battery below its threshold causes a report and a warning, but no stop.
TEST(test_battery_below_threshold_is_a_fault_and_no_stop) {
    gw_wheels_t *wheels = &daemon_rig.daemon->wheels;
    wheels->health.limits.battery_low_dV = 254;
    daemon_rig_begin_driving(client);
    for (unsigned i = 0; i < 60U; i++) {
        (void)daemon_rig_ask(client, "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}");
        daemon_rig_run(100);
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_TRUE(wheels->health.present[IW_LEFT][GW_BATTERY_LOW]);
    TEST_ASSERT_TRUE(is_warned_of("the right wheel's battery has "));
    TEST_ASSERT_FALSE(is_warned_of("degC"));
    wheels->health.present[IW_RIGHT][GW_BATTERY_LOW] = false;
    wheels->health.changes++;
    daemon_rig_run(50);
    TEST_ASSERT_TRUE(is_warned_of("the left wheel's battery has "));
    TEST_ASSERT_FALSE(is_warned_of("the right wheel's battery has "));
}

TEST(test_stored_offset_is_restored_for_the_same_side_and_unit) {
    store_offset(IW_LEFT, config()->force_unit[IW_LEFT], 1234);
    store_offset(IW_RIGHT, (config()->force_unit[IW_RIGHT] == IW_FORCE_CN) ? IW_FORCE_DN : IW_FORCE_CN, 4321);
    print_stored();
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_OPERATOR, daemon_rig.daemon->wheels.core.force[IW_LEFT].provenance);
    TEST_ASSERT_EQUAL_INT32(1234, daemon_rig.daemon->wheels.core.force[IW_LEFT].offset_mN);
    TEST_ASSERT_NOT_EQUAL(IW_OFFSET_OPERATOR, daemon_rig.daemon->wheels.core.force[IW_RIGHT].provenance);
    TEST_ASSERT_NOT_EQUAL(4321, daemon_rig.daemon->wheels.core.force[IW_RIGHT].offset_mN);
}

TEST(test_stored_offset_retains_its_time) {
    store_offset(IW_LEFT, IW_FORCE_CN, 4321);
    print_stored();
    daemon_rig_run(3000);
    const gw_stored_offset_t *found_entry = &daemon_rig.daemon->assumptions.known.offset[IW_LEFT];
    TEST_ASSERT_EQUAL_INT32(4321, found_entry->offset_mN);
    TEST_ASSERT_EQUAL_INT64(1700000000000000, found_entry->wall_us);
}

TEST(test_tare_is_stored_with_the_figures_of_its_wheel) {
    daemon_rig_run(3000);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"tare\",\"side\":\"right\"}"), "\"ok\":true"));
    const gw_stored_t *known = &daemon_rig.daemon->assumptions.known;
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_OPERATOR, known->offset[IW_RIGHT].from);
    TEST_ASSERT_GREATER_THAN_UINT32(20, known->offset[IW_RIGHT].samples);
    TEST_ASSERT_EQUAL_INT32(daemon_rig.daemon->wheels.core.force[IW_RIGHT].offset_mN,
                            known->offset[IW_RIGHT].offset_mN);
    TEST_ASSERT_NOT_EQUAL(IW_OFFSET_OPERATOR, known->offset[IW_LEFT].from);
}

TEST(test_store_is_written_at_most_once_a_second) {
    daemon_rig.daemon->assumptions.write_us = 0;
    daemon_rig_run(3000);
    const unsigned before = writes;
    for (unsigned i = 0; i < 10U; i++) {
        TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"tare\"}"), "\"ok\":true"));
        daemon_rig_run(290);
    }
    TEST_ASSERT_UINT_WITHIN(1, 3, writes - before);
}

// Stored bytes of the assumptions in a status -------------------------------------------------------------------------

static gw_assumptions_written_t *written(void) {
    return &daemon_rig.daemon->assumptions.written;
}

static const char *write_status(char out_line[SOCK_REPLY_MAX]) {
    iwn_server_t *const server = &daemon_rig.daemon->answers.server;
    iwn_out_t json = iwn_server_begin_event(server, "state");
    iwn_server_write_status(server, iwn_server_snapshot(server), &json);
    iwn_out_close(&json, '}');
    const size_t end = iwn_out_finish(&json);
    TEST_ASSERT_GREATER_THAN_size_t(1, end);
    memcpy(out_line, json.data, end - 1U);
    out_line[end - 1U] = '\0';
    return out_line;
}

/// Checks that the next status equals one without stored bytes, and that it differs from the previous one.
static void expect_new_status(const char *changed) {
    static char next[SOCK_REPLY_MAX];
    static char renewed[SOCK_REPLY_MAX];
    (void)write_status(next);
    written()->length = 0;
    (void)write_status(renewed);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(renewed, next, changed);
    TEST_ASSERT_TRUE_MESSAGE(strcmp(status_before, next) != 0, changed);
    TEST_ASSERT_GREATER_THAN_size_t(0, written()->length);
    memcpy(status_before, next, sizeof status_before);
}

/// Changes an item from its initial state through all states.
static void change_item(iw_assumption_item_t item) {
    iw_assumption_store_t *assumptions = &daemon_rig.daemon->wheels.core.assumptions;
    gw_stored_item_t *known = &daemon_rig.daemon->assumptions.known.item[item];
    const inspect_word_t word = {"", "a tape"};
    iwn_refusal_t refusal;
    *known = (gw_stored_item_t){0}; // The first frames may have settled some items.
    assumptions->entry[item] = (iw_assumption_entry_t){0};
    iw_assumption_confirm(assumptions, item, IW_SOURCE_BUS, 1000);
    expect_new_status("confirmed by the bus");
    iw_assumption_confirm(assumptions, item, IW_SOURCE_BUS, -2500);
    expect_new_status("another figure");
    observe();
    expect_new_status("noted");
    known->since_wall_us++;
    expect_new_status("noted later");
    (void)strcpy(known->word.found, "yes");
    expect_new_status("found");
    (void)strcpy(known->word.how, "bringup");
    expect_new_status("how");
    known->word.how[6] = 'q';
    expect_new_status("how, in its last letter");
    iw_assumption_contradict(assumptions, item, IW_SOURCE_BUS, 1000);
    expect_new_status("contradicted by the bus");
    TEST_ASSERT_TRUE(gw_assumptions_confirm(&daemon_rig.daemon->assumptions, item, &word, &refusal));
    expect_new_status("confirmed by the operator");
    assumptions->entry[item] = (iw_assumption_entry_t){0};
    expect_new_status("as if it had never been asked");
}

TEST(test_store_failed_write_is_repeated_after_the_retry_time) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    assumptions->write_us = 0;
    daemon_rig_run(3000);
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"tare\"}"), "\"ok\":true"));
    daemon_rig_run(1500);
    const unsigned before = writes;
    assumptions->store.waits = true;
    news = GW_FILE_STORE_FAILED;
    daemon_rig_run(50);
    assumptions->store.waits = false;
    TEST_ASSERT_EQUAL_INT(GW_ASSUMPTIONS_FAILED, assumptions->state);
    daemon_rig_run(GW_ASSUMPTIONS_RETRY_US / IW_US_PER_MS - 200U);
    TEST_ASSERT_EQUAL_UINT(before, writes);
    daemon_rig_run(400);
    TEST_ASSERT_EQUAL_UINT(before + 1U, writes);
}

TEST(test_store_without_process_reports_failure) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    assumptions->store.waits = true;
    news = GW_FILE_STORE_GONE;
    daemon_rig_run(50);
    assumptions->store.waits = false;
    TEST_ASSERT_EQUAL_INT(GW_ASSUMPTIONS_FAILED, assumptions->state);
    TEST_ASSERT_EQUAL_INT(ECHILD, assumptions->error);
}

TEST(test_store_contains_the_offset_that_a_wheel_sent) {
    iw_force_t *force = &daemon_rig.daemon->wheels.core.force[IW_LEFT];
    force->provenance = IW_OFFSET_WHEEL;
    force->offset_us = daemon_rig.now_us;
    force->offset_mN = 1200;
    observe();
    const gw_stored_offset_t *found_entry = &daemon_rig.daemon->assumptions.known.offset[IW_LEFT];
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_WHEEL, found_entry->from);
    TEST_ASSERT_EQUAL_INT32(1200, found_entry->offset_mN);
}

TEST(test_store_drops_the_operators_value_after_a_bus_finding) {
    gw_assumptions_t *assumptions = &daemon_rig.daemon->assumptions;
    const iw_assumption_item_t item = IW_ASSUMPTION_GEAR_RATIO;
    (void)snprintf(assumptions->known.item[item].word.found, IWN_VALUE_SIZE, "27/2");
    iw_snapshot_t seen = gw_wheels_snapshot(&daemon_rig.daemon->wheels);
    iw_assumption_entry_t assumed[IW_ASSUMPTION_ITEMS];
    memcpy(assumed, seen.assumed, sizeof assumed);
    assumed[item] = (iw_assumption_entry_t){.state = IW_CONFIRMED, .source = IW_SOURCE_BUS, .figure = 1000};
    seen.assumed = assumed;
    seen.assumed_changes++;
    gw_assumptions_observe(assumptions, &seen);
    TEST_ASSERT_EQUAL_STRING("", assumptions->known.item[item].word.found);
}

TEST(test_status_after_change_of_an_item_is_current) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        change_item((iw_assumption_item_t)item);
    }
}

TEST(test_status_after_change_of_the_configuration_is_current) {
    iw_config_t *core = &daemon_rig.daemon->config.core;
    core->setpoint_type++;
    expect_new_status("setpoint_type");
    core->setpoint_type_set = false;
    expect_new_status("setpoint_type not set");
    core->current_role = (core->current_role == IW_ROLE_LIMIT) ? IW_ROLE_SETPOINT : IW_ROLE_LIMIT;
    expect_new_status("current_role");
    core->radius_mm++;
    expect_new_status("radius_mm");
    core->gear_turns++;
    expect_new_status("gear_ratio, turns");
    core->gear_per++;
    expect_new_status("gear_ratio, per");
    core->rpm_of_rotor = !core->rpm_of_rotor;
    expect_new_status("rpm_of");
    daemon_rig.daemon->assumptions.configured.track_mm++;
    expect_new_status("track_mm");
    for (unsigned side = 0; side < IW_SIDES; side++) {
        core->invert[side] = !core->invert[side];
        expect_new_status("invert");
        core->force_unit[side] = (core->force_unit[side] == IW_FORCE_CN) ? IW_FORCE_DN : IW_FORCE_CN;
        expect_new_status("force_unit");
    }
}

TEST(test_status_after_tare_or_restored_file_is_current) {
    daemon_rig_run(3000);
    expect_new_status("three seconds later");
    TEST_ASSERT_NOT_NULL(strstr(daemon_rig_ask(client, "{\"cmd\":\"tare\",\"side\":\"right\"}"), "\"ok\":true"));
    expect_new_status("right wheel tared");
    store(IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED, IW_SOURCE_OPERATOR);
    store_offset(IW_LEFT, config()->force_unit[IW_LEFT], 1234);
    print_stored();
    expect_new_status("what an earlier run stored");
    TEST_ASSERT_NOT_NULL(strstr(status_before, "\"since_wall_us\":1700000000000000"));
}

TEST(test_status_without_change_reuses_the_stored_bytes) {
    static char next[SOCK_REPLY_MAX];
    (void)write_status(next);
    char *const found_entry =
        (char *)memchr(written()->text, 's', written()->length); // First letter of "setpoint_type"
    TEST_ASSERT_NOT_NULL(found_entry);
    *found_entry = 'S';
    TEST_ASSERT_NOT_NULL(strstr(write_status(next), "\"ledger\":{\"Setpoint_type\""));
}

TEST(test_status_with_too_long_assumptions_stores_no_bytes) {
    static char first[SOCK_REPLY_MAX];
    static char again[SOCK_REPLY_MAX];
    (void)write_status(first);
    TEST_ASSERT_GREATER_THAN_size_t(0, written()->length);
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) { // Control characters are escaped: six bytes for one.
        gw_stored_item_t *known = &daemon_rig.daemon->assumptions.known.item[item];
        known->entry = (iw_assumption_entry_t){IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
        memset(known->word.how, 0x7F, sizeof known->word.how - 1U);
        daemon_rig.daemon->wheels.core.assumptions.entry[item] = known->entry;
    }
    (void)write_status(first);
    TEST_ASSERT_EQUAL_size_t(0, written()->length);
    TEST_ASSERT_NOT_NULL(strstr(first, "\"how\":\"\\u007F\\u007F"));
    TEST_ASSERT_EQUAL_STRING(first, write_status(again));
}

TEST(test_status_that_overflows_stores_no_bytes) {
    char line[64];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_server_t *const server = &daemon_rig.daemon->answers.server;
    written()->length = 0;
    iwn_server_write_status(server, iwn_server_snapshot(server), &json);
    TEST_ASSERT_TRUE(json.overflow);
    TEST_ASSERT_EQUAL_size_t(0, written()->length);
}

TEST(test_button_uses_the_configured_lines) {
    const gateway_config_t *config = &daemon_rig.daemon->config;
    TEST_ASSERT_EQUAL_STRING(config->estop.line, daemon_rig.daemon->assumptions.button.contact[0].line);
    TEST_ASSERT_EQUAL_STRING(config->estop.line2, daemon_rig.daemon->assumptions.button.contact[1].line);
    TEST_ASSERT_EQUAL(config->estop.active2_high, daemon_rig.daemon->assumptions.button.contact[1].active_high);
    TEST_ASSERT_EQUAL(config->estop.active_high, daemon_rig.daemon->assumptions.button.contact[0].active_high);
}
