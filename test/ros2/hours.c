// SPDX-License-Identifier: MIT
// Hours of the bridge in virtual time: its own code and the gateway's own loop in one process, in the daemon's rig. ROS is another participant
// of the DDS domain. Heap, descriptors and DDS entities must not grow. See --help.
//
// hours_rig.h describes the virtual part. DDS itself runs in real time; between two
// participants of one process it delivers within the call, so nothing waits for it. The cost of participants that come and go, over sockets, is
// tested in real time (test_rides.py, publishers_come_and_go): DDS releases them after some seconds that cannot be shortened.
#include "free_domain.h"
#include "hours_rig.h"
#include "ros2_bridge.h"
#include "ros_parts.h"
#include "ros_types.h"

#include "unity.h"

#include <malloc.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PASS_MS   5U
#define MINUTE_MS 60000U
/// Permitted growth within an hour: buffers of DDS, samples in flight.
#define HEAP_SLACK 16384

typedef struct {
    dds_entity_t participant;
    dds_entity_t publishers[2];
    dds_entity_t commands; ///< The one that publishes.
    dds_entity_t asks;
    dds_entity_t odom;
    dds_entity_t diagnostics;
    uint64_t odoms;
    uint64_t diagnoses;
    uint64_t sent;
} peer_t;

typedef struct {
    size_t heap;
    unsigned descriptors;
    unsigned entities;
} size_of_all_t;

typedef struct {
    unsigned armed;
    unsigned resets;
    unsigned crashes;
    unsigned hangs;
    unsigned publishers;
    unsigned presses;
} tally_t;

static bridge_t bridge;
static peer_t peer;
static tally_t tally;
static double hours = 0.2;
static uint32_t dice = 1;

void setUp(void) {}

void tearDown(void) {}

// ---- the other participant ------------------------------------------------------------------------------------------

static dds_entity_t topic_of(const char *name, const dds_topic_descriptor_t *type) {
    const dds_entity_t topic = dds_create_topic(peer.participant, type, name, NULL, NULL);
    TEST_ASSERT_GREATER_THAN_INT32_MESSAGE(0, topic, name);
    return topic;
}

static dds_qos_t *reliable(void) {
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
    dds_qset_writer_data_lifecycle(qos, false);
    return qos;
}

static dds_entity_t writer_of(const char *name, const dds_topic_descriptor_t *type) {
    dds_qos_t *qos = reliable();
    const dds_entity_t writer = dds_create_writer(peer.participant, topic_of(name, type), qos, NULL);
    dds_delete_qos(qos);
    return writer;
}

static dds_entity_t reader_of(const char *name, const dds_topic_descriptor_t *type) {
    dds_qos_t *qos = reliable();
    const dds_entity_t reader = dds_create_reader(peer.participant, topic_of(name, type), qos, NULL);
    dds_delete_qos(qos);
    return reader;
}

static int64_t stamp_ns(int64_t late_ms) {
    return hours_wall_ns() - late_ms * 1000000;
}

static void command(double v, double yaw, int64_t late_ms) {
    const geometry_msgs_msg_dds__Twist_ twist = {.linear = {.x = v}, .angular = {.z = yaw}};
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write_ts(peer.commands, &twist, stamp_ns(late_ms)));
    peer.sent++;
}

static void ask(char *verb) {
    const std_msgs_msg_dds__String_ words = {.data = verb};
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write_ts(peer.asks, &words, stamp_ns(0)));
}

static uint64_t take_all(dds_entity_t reader) {
    void *samples[16] = {NULL};
    dds_sample_info_t infos[16];
    const dds_return_t count = dds_take(reader, samples, infos, 16, 16);
    if (count > 0) {
        (void)dds_return_loan(reader, samples, count);
    }
    return (count > 0) ? (uint64_t)count : 0U;
}

// ---- time -----------------------------------------------------------------------------------------------------------

static void pass(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        const iw_time_us_t until_us = daemon_rig.now_us + MS(PASS_MS);
        bridge_step(&bridge); // The step may have waited.
        if (daemon_rig.now_us < until_us) {
            hours_run_gateway((unsigned)((until_us - daemon_rig.now_us + 999U) / IW_US_PER_MS));
        }
        peer.odoms += take_all(peer.odom);
        peer.diagnoses += take_all(peer.diagnostics);
    }
}

/// Sends commands with a distance, for that long.
static void stream(double v, double yaw, unsigned every_ms, unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += every_ms) {
        command(v, yaw, 0);
        pass(every_ms);
    }
}

static void flood(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        for (unsigned i = 0; i < PASS_MS; i++) {
            command(0.2, 0.1, 0);
        }
        pass(PASS_MS);
    }
}

static unsigned roll(unsigned sides) {
    dice = dice * 1664525U + 1013904223U;
    return (dice >> 16) % sides;
}

// ---- the events -----------------------------------------------------------------------------------------------------

static void arm(void) {
    for (unsigned tries = 0; tries < 20U && daemon_rig_state() != IW_STATE_ARMED; tries++) {
        ask("arm");
        pass(300);
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(IW_STATE_ARMED, daemon_rig_state(), bridge.facts.commands.refusal);
    tally.armed++;
}

static void assert_commanded_zero(void) {
    pass(2500);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT16(0, daemon_rig.commanded_mm_s[IW_RIGHT]);
    TEST_ASSERT_NOT_EQUAL(IW_STATE_ARMED, daemon_rig_state());
}

static void reset(void) {
    for (unsigned tries = 0; tries < 20U && daemon_rig_state() == IW_STATE_LATCHED; tries++) {
        ask("reset");
        pass(500);
    }
    TEST_ASSERT_NOT_EQUAL(IW_STATE_LATCHED, daemon_rig_state());
    tally.resets++;
}

static void press_button(void) {
    daemon_rig.estop = 1;
    tally.presses++;
    assert_commanded_zero();
    daemon_rig.estop = 0;
    pass(200);
    reset();
}

static void crash_gateway(void) {
    daemon_rig_crash();
    stream(0.3, 0.0, 50, 1000U + roll(4000));
    daemon_rig_start();
    tally.crashes++;
    pass(6000); // The bridge has found it again, and the hold of the restart has ended.
}

static void hang_gateway(void) {
    hours_gateway_hangs = true;
    stream(0.3, 0.0, 50, 500U + roll(2000));
    hours_gateway_hangs = false;
    tally.hangs++;
    pass(5000);
    reset();
}

static void change_publisher(void) {
    assert_commanded_zero();
    peer.commands = (peer.commands == peer.publishers[0]) ? peer.publishers[1] : peer.publishers[0];
    tally.publishers++;
}

static void send_rubbish(void) {
    static const double rubbish[] = {NAN, INFINITY, 1e30, -1e30, 33.0};
    for (size_t i = 0; i < sizeof rubbish / sizeof rubbish[0]; i++) {
        command(rubbish[i], 0.0, 0);
        pass(20);
        command(0.1, rubbish[i], 0);
        pass(20);
        command(0.1, 0.1, 1000);
        pass(20);
    }
    assert_commanded_zero();
}

/// Drives for most of a minute, then makes an event happen.
static void minute(void) {
    arm();
    stream(0.05 * (double)roll(8), 0.1 * ((double)roll(7) - 3.0), 20U + 5U * roll(7), 40000);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    switch (roll(8)) {
    case 0:
        ask("stop");
        assert_commanded_zero();
        break;
    case 1:
        ask("estop");
        assert_commanded_zero();
        reset();
        break;
    case 2:
        press_button();
        break;
    case 3:
        crash_gateway();
        break;
    case 4:
        hang_gateway();
        break;
    case 5:
        change_publisher();
        break;
    case 6:
        send_rubbish();
        break;
    default:
        flood(2000);
        assert_commanded_zero();
        break;
    }
    pass(1000);
}

// ---- the size -------------------------------------------------------------------------------------------------------

static unsigned count_entities(dds_entity_t entity) {
    dds_entity_t children[128];
    const dds_return_t count = dds_get_children(entity, children, 128);
    unsigned sum = 1;
    for (dds_return_t i = 0; i < count && i < 128; i++) {
        sum += count_entities(children[i]);
    }
    return sum;
}

static size_of_all_t measure(void) {
    size_of_all_t size = {.heap = mallinfo2().uordblks, .descriptors = hours_descriptors()};
    size.entities = count_entities(bridge.ros->participant) + count_entities(peer.participant);
    return size;
}

static void test_ros2_bridge_in_hours_of_everything_does_not_grow(void) {
    const iw_time_us_t begin_us = daemon_rig.now_us;
    const iw_time_us_t end_us = begin_us + (iw_time_us_t)(hours * 3600e6);
    size_of_all_t first = {0};
    for (unsigned minutes = 1; daemon_rig.now_us < end_us; minutes++) {
        minute();
        // The first events allocate buffers: after five minutes all of them exist.
        if (first.entities == 0U && (minutes == 5U || daemon_rig.now_us - begin_us > (end_us - begin_us) / 2U)) {
            first = measure();
        }
        if (minutes % 60U == 0U) {
            const size_of_all_t now = measure();
            (void)printf("%5.2f h: heap %zu bytes, %u descriptors, %u DDS entities\n",
                         (double)(daemon_rig.now_us - begin_us) / 3600e6, now.heap, now.descriptors, now.entities);
            (void)fflush(stdout);
        }
    }
    const size_of_all_t last = measure();
    const double seconds = (double)(daemon_rig.now_us - begin_us) / 1e6;
    (void)printf(
        "%.2f h: %llu odom received, %llu commands sent, %llu passed on, %llu late, %llu bad; armed %u times, %u "
        "resets, %u e-stops, %u crashes and "
        "%u hangs of the gateway, %u changes of the publisher; heap %zu to %zu bytes\n",
        seconds / 3600.0, (unsigned long long)peer.odoms, (unsigned long long)peer.sent,
        (unsigned long long)bridge.facts.commands.passed, (unsigned long long)bridge.facts.commands.late,
        (unsigned long long)bridge.facts.commands.bad, tally.armed, tally.resets, tally.presses, tally.crashes,
        tally.hangs, tally.publishers, first.heap, last.heap);
    TEST_ASSERT_LESS_OR_EQUAL_size_t_MESSAGE(first.heap + HEAP_SLACK, last.heap, "the heap grows");
    TEST_ASSERT_EQUAL_UINT_MESSAGE(first.descriptors, last.descriptors, "descriptors");
    TEST_ASSERT_EQUAL_UINT_MESSAGE(first.entities, last.entities, "DDS entities");
    TEST_ASSERT_EQUAL_UINT32(0, daemon_rig.unmarked);
    TEST_ASSERT_GREATER_THAN_UINT64((uint64_t)(40.0 * seconds), peer.odoms);
    TEST_ASSERT_GREATER_THAN_UINT64((uint64_t)(0.9 * seconds), peer.diagnoses);
    TEST_ASSERT_GREATER_THAN_UINT64((uint64_t)(5.0 * seconds), bridge.facts.commands.passed);
}

static void begin(void) {
    ros_settings_t settings;
    daemon_rig_begin();
    settings = ros_settings_standard;
    settings.ros.loopback = true;
    settings.ros.domain = free_domain();
    TEST_ASSERT_NOT_EQUAL_UINT32(0, settings.ros.domain);
    settings.drive.allow_reset = true;
    settings.odometry.tf = true;
    TEST_ASSERT_EQUAL_INT(0, bridge_open(&bridge, &settings));
    peer.participant = dds_create_participant(settings.ros.domain, NULL, NULL);
    TEST_ASSERT_GREATER_THAN_INT32(0, peer.participant);
    peer.odom = reader_of("rt/odom", &nav_msgs_msg_dds__Odometry__desc);
    peer.diagnostics = reader_of("rt/diagnostics", &diagnostic_msgs_msg_dds__DiagnosticArray__desc);
    for (unsigned i = 0; i < 2U; i++) {
        peer.publishers[i] = writer_of("rt/cmd_vel", &geometry_msgs_msg_dds__Twist__desc);
    }
    peer.commands = peer.publishers[0];
    peer.asks = writer_of("rt/iwheel/ask", &std_msgs_msg_dds__String__desc);
    pass(2000);
}

int main(int count, char **arguments) {
    if (count > 1 && strcmp(arguments[1], "--help") == 0) {
        (void)puts("usage: ros2_hours [HOURS]\n\nThe bridge to ROS 2 and the gateway in virtual time: driving at 20 to "
                   "50 Hz with all events; default 0.2 "
                   "hours. Memory and descriptors must not grow.");
        return 0;
    }
    hours = (count > 1) ? strtod(arguments[1], NULL) : hours;
    UNITY_BEGIN();
    begin();
    RUN_TEST(test_ros2_bridge_in_hours_of_everything_does_not_grow);
    bridge_close(&bridge);
    (void)dds_delete(peer.participant);
    daemon_rig_end();
    return UNITY_END();
}
