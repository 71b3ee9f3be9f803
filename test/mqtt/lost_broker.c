// SPDX-License-Identifier: MIT
// A lost broker while an MQTT client drives: the bridge's own code and the gateway's own loop in virtual time (hours_rig.h). There is no broker; the
// test calls the bridge with commands and with the loss, as its connection does.
#include "hours_rig.h"
#include "mqtt_bridge.h"

#include "unity.h"

#include <fcntl.h>
#include <mosquitto.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define PASS_MS 5U

static mqtt_bridge_t bridge;
static mqtt_settings_t settings;
static char folder[64];
static unsigned sequence;
static char key[MQTT_KEY_SIZE]; ///< Key of the lease.

static void pass(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        TEST_ASSERT_EQUAL_INT(0, mqtt_bridge_step(&bridge, daemon_rig.now_us));
        hours_run_gateway(PASS_MS);
    }
}

static void command_from(const char *from, const char *verb, const char *fields) {
    char topic[64];
    char payload[512];
    const mqtt_labels_t labels = {.expiry_s = 0};
    (void)snprintf(topic, sizeof topic, "iwheel/w1/cmd/%s", verb);
    (void)snprintf(payload, sizeof payload, "{\"boot\":\"%s\",\"t_us\":%llu,\"from\":\"%s\",\"seq\":%u%s}", bridge.boot,
                   (unsigned long long)bridge.now_us, from, ++sequence, fields);
    const struct mosquitto_message message = {
        .topic = topic, .payload = payload, .payloadlen = (int)strlen(payload), .qos = 0, .retain = false};
    mqtt_bridge_command(&bridge, &message, &labels);
}

static void command(const char *verb, const char *fields) {
    command_from("pad", verb, fields);
}

static void drive(unsigned for_ms) {
    char fields[128];
    (void)snprintf(fields, sizeof fields, ",\"left_mm_s\":100,\"right_mm_s\":100,\"key\":\"%s\"", key);
    for (unsigned ms = 0; ms < for_ms; ms += 50U) {
        command("drive", fields);
        pass(50);
    }
}

static void broker_is_lost(void) {
    bridge.broker.listener.down(bridge.broker.listener.context);
}

static iw_cause_t cause_of_the_stop(void) {
    return gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->cause;
}

void setUp(void) {
    (void)snprintf(folder, sizeof folder, "%s", "/tmp/iwheel-broker-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    daemon_rig_begin();
    settings = mqtt_settings_standard;
    (void)snprintf(settings.machine.id, sizeof settings.machine.id, "w1");
    (void)snprintf(settings.spool.directory, sizeof settings.spool.directory, "%s", folder);
    settings.drive.enabled = true;
    (void)snprintf(settings.gateway.socket, sizeof settings.gateway.socket, "/run/iwheel/gateway.sock");
    TEST_ASSERT_EQUAL_INT(0, mqtt_bridge_open(&bridge, &settings));
    bridge.broker.try_us = UINT64_MAX; // The bridge must not connect: a thread does that in real time.
    pass(500);
    command("arm", "");
    pass(200);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_NOT_NULL(bridge_lease_key(&bridge.lease));
    (void)snprintf(key, sizeof key, "%s", bridge_lease_key(&bridge.lease));
    drive(500);
    TEST_ASSERT_EQUAL_INT16(100, daemon_rig.commanded_mm_s[IW_LEFT]);
}

void tearDown(void) {
    char path[96];
    (void)snprintf(path, sizeof path, "%s/" MQTT_SPOOL_FILE, folder);
    TEST_ASSERT_TRUE(mqtt_bridge_close(&bridge));
    daemon_rig_end();
    (void)unlink(path);
    (void)rmdir(folder);
}

static void test_broker_lost_stops_the_wheels_with_the_cause_client_stop(void) {
    broker_is_lost();
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, cause_of_the_stop());
}

static void test_broker_lost_and_back_drives_nothing_without_arm(void) {
    broker_is_lost();
    pass(50);
    drive(300);
    pass(2000);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

static void test_sender_that_has_not_armed_drives_nothing(void) {
    command_from("other", "drive", ",\"left_mm_s\":-100,\"right_mm_s\":-100");
    pass(50);
    TEST_ASSERT_EQUAL_STRING(key, bridge_lease_key(&bridge.lease));
    TEST_ASSERT_EQUAL_INT16(100, daemon_rig.commanded_mm_s[IW_LEFT]);
}

/// The bridge cannot read its age.
static void test_stop_never_needs_json_while_a_sender_drives(void) {
    const mqtt_labels_t labels = {.expiry_s = 0};
    char payload[] = "{\"reason\":\"\\ud83d\"}";
    struct mosquitto_message message = {
        .topic = "iwheel/w1/cmd/stop", .payload = payload, .payloadlen = (int)strlen(payload), .retain = true};
    mqtt_bridge_command(&bridge, &message, &labels);
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    message.retain = false;
    mqtt_bridge_command(&bridge, &message, &labels);
    TEST_ASSERT_NULL(bridge_lease_key(&bridge.lease));
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, cause_of_the_stop());
    message.topic = "iwheel/w1/cmd/estop";
    mqtt_bridge_command(&bridge, &message, &labels);
    pass(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
}

static void test_sender_that_stopped_drives_nothing_without_arm(void) {
    char fields[128];
    (void)snprintf(fields, sizeof fields, ",\"left_mm_s\":100,\"right_mm_s\":100,\"key\":\"%s\"", key);
    command("stop", "");
    command("drive", fields); // This command comes before the gateway can reply.
    TEST_ASSERT_NULL(bridge_lease_key(&bridge.lease));
    pass(2000);
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
}

static void test_sender_has_no_lease_after_the_gateway_restarted(void) {
    daemon_rig_crash();
    pass(100);
    TEST_ASSERT_NULL(bridge_lease_key(&bridge.lease));
    pass(1000);
    daemon_rig_start();
    pass(6000);
    drive(100);
    TEST_ASSERT_NULL(bridge_lease_key(&bridge.lease));
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_TRUE(daemon_rig_commands_zero());
}

/// The end of a sentence is the fix.
static void test_stop_with_a_long_reason_has_its_whole_sentence(void) {
    char fields[IWN_REASON_MAX + 32U];
    char sentence[IWN_SENTENCE_SIZE];
    char reason[IWN_REASON_MAX + 1U];
    memset(reason, 'r', IWN_REASON_MAX);
    reason[IWN_REASON_MAX] = '\0';
    (void)snprintf(fields, sizeof fields, ",\"reason\":\"%s\"", reason);
    command("estop", fields);
    pass(50);
    const char *why = daemon_rig_ask(daemon_rig_connect(), "{\"cmd\":\"why\"}");
    const iwc_message_t reply = {.text = why, .length = strlen(why)};
    TEST_ASSERT_TRUE(iwc_text(&reply, "sentence", sentence, sizeof sentence));
    TEST_ASSERT_GREATER_THAN_size_t(256, strlen(sentence));
    TEST_ASSERT_EQUAL_STRING(sentence, bridge.stop.sentence);
}

/// The gateway hangs: its connection stays, and nothing arrives.
static void pass_hung(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        daemon_rig.now_us += MS(PASS_MS);
        TEST_ASSERT_EQUAL_INT(0, mqtt_bridge_step(&bridge, daemon_rig.now_us));
    }
}

static void test_gateway_silent_as_long_as_a_serial_relay_stays_online(void) {
    pass(3000);
    const uint64_t heard_us = bridge.heard_us;
    pass_hung((unsigned)((heard_us + MS(2500) - daemon_rig.now_us) / 1000U)); // One lost state, and a late one.
    TEST_ASSERT_TRUE(bridge.online);
    pass_hung(700); // As long as a relay waits for the line of its board.
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(heard_us, bridge.heard_us, "no state has arrived");
    TEST_ASSERT_TRUE(bridge.online);
    pass(1500);
    TEST_ASSERT_TRUE(bridge.online);
    TEST_ASSERT_GREATER_THAN_UINT64(heard_us, bridge.heard_us);
}

static void test_gateway_that_hangs_is_offline_after_3500_ms_until_its_state(void) {
    iwc_message_t state;
    TEST_ASSERT_TRUE(bridge.online);
    pass(3000);
    TEST_ASSERT_TRUE_MESSAGE(bridge.online, "states arrive once a second");
    const uint64_t heard_us = bridge.heard_us;
    pass_hung((unsigned)((heard_us + MQTT_HUNG_US - daemon_rig.now_us) / 1000U) - 2U * PASS_MS);
    TEST_ASSERT_TRUE(bridge.online);
    TEST_ASSERT_LESS_OR_EQUAL_INT((int)(3U * PASS_MS), mqtt_bridge_wait_ms(&bridge));
    pass_hung(3U * PASS_MS);
    TEST_ASSERT_FALSE(bridge.online);
    TEST_ASSERT_FALSE(mqtt_bridge_state(&bridge, &state));
    TEST_ASSERT_EQUAL_INT_MESSAGE(BRIDGE_LINK_HERE, bridge.link.state, "stops still use the connection");
    pass(1500);
    TEST_ASSERT_TRUE(bridge.online);
    TEST_ASSERT_TRUE(mqtt_bridge_state(&bridge, &state));
}

static atomic_bool readable;

/// After half a second the file is readable, and empty.
static void *make_readable(void *path) {
    int pipe = -1;
    (void)usleep(500000);
    atomic_store(&readable, true);
    while (pipe < 0) { // Until it has a reader.
        (void)usleep(1000);
        pipe = open(path, O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    }
    (void)close(pipe);
    return NULL;
}

static void test_tls_file_whose_disk_hangs_delays_no_round(void) {
    pthread_t writer;
    char path[96];
    (void)snprintf(path, sizeof path, "%s/ca.pem", folder);
    (void)snprintf(settings.broker.ca, sizeof settings.broker.ca, "%s", path);
    settings.broker.port = 1; // No broker.
    atomic_store(&readable, false);
    TEST_ASSERT_EQUAL_INT(0, mkfifo(path, 0600));
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&writer, NULL, make_readable, path));
    bridge.broker.try_us = 0;
    pass(PASS_MS);
    TEST_ASSERT_FALSE_MESSAGE(atomic_load(&readable), "the loop waited for the file");
    TEST_ASSERT_EQUAL_INT(MQTT_CONNECTING, bridge.broker.state);
    TEST_ASSERT_EQUAL_INT(0, pthread_join(writer, NULL));
    while (!atomic_load(&bridge.broker.caller.ended)) {
        (void)usleep(1000);
    }
    pass(PASS_MS);
    TEST_ASSERT_EQUAL_INT(MQTT_AWAY, bridge.broker.state);
    (void)unlink(path);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_broker_lost_stops_the_wheels_with_the_cause_client_stop);
    RUN_TEST(test_broker_lost_and_back_drives_nothing_without_arm);
    RUN_TEST(test_sender_that_has_not_armed_drives_nothing);
    RUN_TEST(test_stop_never_needs_json_while_a_sender_drives);
    RUN_TEST(test_sender_that_stopped_drives_nothing_without_arm);
    RUN_TEST(test_sender_has_no_lease_after_the_gateway_restarted);
    RUN_TEST(test_stop_with_a_long_reason_has_its_whole_sentence);
    RUN_TEST(test_gateway_silent_as_long_as_a_serial_relay_stays_online);
    RUN_TEST(test_gateway_that_hangs_is_offline_after_3500_ms_until_its_state);
    RUN_TEST(test_tls_file_whose_disk_hangs_delays_no_round);
    return UNITY_END();
}
