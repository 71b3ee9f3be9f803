// SPDX-License-Identifier: MIT
// The node itself, without a bridge: the sockets that it opens, as the kernel reports them.
#include "common/reach.h"
#include "free_domain.h"
#include "raw.h"
#include "ros.h"
#include "ros_types.h"

#include "unity.h"

#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

static ros_settings_t settings;
static ros_t *ros;
static uint64_t set_us; ///< The time of the bridge; 0: the real one.

void setUp(void) {
    static uint32_t domain;
    domain = (domain == 0U) ? free_domain() : domain;
    TEST_ASSERT_NOT_EQUAL_UINT32(0, domain);
    settings = ros_settings_standard;
    settings.ros.domain = domain;
}

void tearDown(void) {
    if (ros != NULL) {
        ros_close(ros);
    }
    ros = NULL;
    set_us = 0;
}

static void test_dds_node_on_loopback_is_not_reached_from_outside(void) {
    char text[BRIDGE_REACH_TEXT];
    ros = ros_open(&settings, NULL, NULL, stderr);
    TEST_ASSERT_NOT_NULL(ros);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, bridge_reach_count(NULL, 0, text), text);
}

static void test_dds_node_on_a_network_is_reached_from_outside(void) {
    char text[BRIDGE_REACH_TEXT];
    settings.ros.loopback = false;
    (void)setenv("CYCLONEDDS_URI", "<General><AllowMulticast>false</AllowMulticast></General>", 1);
    ros = ros_open(&settings, NULL, NULL, stderr);
    TEST_ASSERT_NOT_NULL(ros);
    TEST_ASSERT_GREATER_THAN_UINT(0, bridge_reach_count(NULL, 0, text));
}

// ---- requests ---------------------------------------------------------------------------------------------------------

static dds_entity_t peer;

/// A writer of requests to a service, in a separate participant.
static dds_entity_t client_of(const char *service) {
    char name[64];
    (void)snprintf(name, sizeof name, "rq/iwheel/%sRequest", service);
    ros = ros_open(&settings, NULL, NULL, stderr);
    TEST_ASSERT_NOT_NULL(ros);
    peer = dds_create_participant(settings.ros.domain, NULL, NULL);
    const dds_entity_t topic = ros_raw_topic(peer, name, "std_srvs::srv::dds_::Trigger_Request_");
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    const dds_entity_t writer = dds_create_writer(peer, topic, qos, NULL);
    dds_delete_qos(qos);
    dds_publication_matched_status_t status = {0};
    for (unsigned i = 0; i < 1000U && status.current_count == 0U; i++) {
        dds_sleepfor(DDS_MSECS(5));
        (void)dds_get_publication_matched_status(writer, &status);
    }
    TEST_ASSERT_EQUAL_UINT32(1, status.current_count);
    return writer;
}

/// Waits for a request. Returns false if none came in this time.
static bool await_request(ros_request_t *out_request, unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += 5U) {
        if (ros_take_request(ros, out_request)) {
            return true;
        }
        dds_sleepfor(DDS_MSECS(5));
    }
    return false;
}

static void test_dds_sample_that_cannot_be_read_is_a_request(void) {
    static const ros_raw_t raw = {.size = 60, .bytes = {0, 1, 0, 0, 50, 0, 0, 0, 'n', 'o'}};
    ros_request_t request;
    const dds_entity_t writer = client_of("stop");
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write(writer, &raw));
    TEST_ASSERT_TRUE(await_request(&request, 2000));
    TEST_ASSERT_EQUAL_INT(ROS_STOP, request.verb);
    TEST_ASSERT_EQUAL_INT(ROS_FORM_UNREADABLE, request.caller.form);
    TEST_ASSERT_FALSE(await_request(&request, 100));
    (void)dds_delete(peer);
}

static void test_dds_client_that_disposes_and_goes_is_no_request(void) {
    static const ros_raw_t raw = {.size = 5, .bytes = {0, 1}};
    ros_request_t request;
    const dds_entity_t writer = client_of("estop");
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write(writer, &raw));
    TEST_ASSERT_TRUE(await_request(&request, 2000));
    TEST_ASSERT_EQUAL_INT(ROS_FORM_IDENTITY, request.caller.form);
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_dispose(writer, &raw));
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_unregister_instance(writer, &raw));
    TEST_ASSERT_FALSE(await_request(&request, 200));
    (void)dds_delete(peer);
    TEST_ASSERT_FALSE(await_request(&request, 200));
}

/// A reader of replies that is created only now, after the request was written.
static dds_entity_t reader_of(const char *service) {
    char name[64];
    (void)snprintf(name, sizeof name, "rr/iwheel/%sReply", service);
    const dds_entity_t topic = ros_raw_topic(peer, name, "std_srvs::srv::dds_::Trigger_Response_");
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 20);
    const dds_entity_t reader = dds_create_reader(peer, topic, qos, NULL);
    dds_delete_qos(qos);
    return reader;
}

/// Returns the number of replies that come in this time.
static unsigned count_replies(dds_entity_t reader, unsigned for_ms) {
    unsigned count = 0;
    for (unsigned ms = 0; ms < for_ms; ms += 5U) {
        ros_raw_t raw;
        void *sample = &raw;
        dds_sample_info_t info;
        ros_woken(ros);
        count += (dds_take(reader, &sample, &info, 1, 1) == 1) ? 1U : 0U;
        dds_sleepfor(DDS_MSECS(5));
    }
    return count;
}

static void test_dds_reply_waits_for_the_reader_of_its_caller(void) {
    static const ros_raw_t raw = {.size = 5, .bytes = {0, 1}};
    ros_request_t request;
    const dds_entity_t writer = client_of("arm");
    for (unsigned i = 0; i < 3U; i++) {
        TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write(writer, &raw));
        TEST_ASSERT_TRUE(await_request(&request, 2000));
        ros_answer(ros, &request, true, "armed");
    }
    TEST_ASSERT_EQUAL_UINT(3, count_replies(reader_of("arm"), 500));
    (void)dds_delete(peer);
}

static void test_dds_replies_to_callers_without_reader_are_sent_later(void) {
    static const ros_raw_t raw = {.size = 5, .bytes = {0, 1}};
    ros_request_t request;
    const dds_entity_t writer = client_of("arm");
    for (unsigned i = 0; i < 12U; i++) { // More than can wait together.
        TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write(writer, &raw));
        TEST_ASSERT_TRUE(await_request(&request, 2000));
        ros_answer(ros, &request, true, "armed");
    }
    dds_sleepfor(DDS_MSECS(1050));
    ros_woken(ros); // These replies have no reader.
    const dds_entity_t reader = reader_of("arm");
    TEST_ASSERT_EQUAL_UINT(0, count_replies(reader, 300));
    TEST_ASSERT_EQUAL_INT32(DDS_RETCODE_OK, dds_write(writer, &raw));
    TEST_ASSERT_TRUE(await_request(&request, 2000));
    ros_answer(ros, &request, true, "armed");
    TEST_ASSERT_EQUAL_UINT(1, count_replies(reader, 500));
    (void)dds_delete(peer);
}

static bool await_used(bool used) {
    for (unsigned i = 0; i < 1000U && ros_is_used(ros) != used; i++) {
        dds_sleepfor(DDS_MSECS(5));
    }
    return ros_is_used(ros) == used;
}

static void test_dds_node_is_used_by_a_reader_or_a_caller_only(void) {
    (void)client_of("stop");
    TEST_ASSERT_TRUE(await_used(true));
    (void)dds_delete(peer);
    TEST_ASSERT_TRUE(await_used(false));
    peer = dds_create_participant(settings.ros.domain, NULL, NULL);
    const dds_entity_t names =
        ros_raw_topic(peer, "ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_");
    TEST_ASSERT_GREATER_THAN_INT32(0, dds_create_reader(peer, names, NULL, NULL));
    dds_sleepfor(DDS_MSECS(300));
    TEST_ASSERT_FALSE(ros_is_used(ros));
    const dds_entity_t odom = ros_raw_topic(peer, "rt/odom", "nav_msgs::msg::dds_::Odometry_");
    TEST_ASSERT_GREATER_THAN_INT32(0, dds_create_reader(peer, odom, NULL, NULL));
    TEST_ASSERT_TRUE(await_used(true));
    (void)dds_delete(peer);
}

// ---- publishers that do not match -------------------------------------------------------------------------------------

uint64_t __real_bridge_now_us(void);
uint64_t __wrap_bridge_now_us(void);

uint64_t __wrap_bridge_now_us(void) {
    return (set_us != 0U) ? set_us : __real_bridge_now_us();
}

/// Calls the search after this time. Returns true if it searched.
static bool searches(ros_unmatched_t *unmatched, unsigned after_ms) {
    set_us += 1000U * (uint64_t)after_ms;
    unmatched->wanted = NULL; // A search writes it.
    ros_find_unmatched(ros, unmatched);
    return unmatched->wanted != NULL;
}

/// Returns true if the searches end: DDS can repeat an announcement.
static bool await_rest(ros_unmatched_t *unmatched) {
    for (unsigned i = 0; i < 1000U && searches(unmatched, 3000); i++) {
        dds_sleepfor(DDS_MSECS(5));
    }
    return !searches(unmatched, 100);
}

static bool await_count(ros_unmatched_t *unmatched, unsigned count) {
    for (unsigned i = 0; i < 3000U && unmatched->count != count; i++) {
        dds_sleepfor(DDS_MSECS(5));
        ros_find_unmatched(ros, unmatched);
    }
    return unmatched->count == count;
}

/// Configuration for this machine only, as the bridge has it.
static const char local[] =
    "<General><Interfaces><NetworkInterface name=\"lo\" multicast=\"false\"/></Interfaces><AllowMulticast>false"
    "</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32"
    "</MaxAutoParticipantIndex><Peers><Peer address=\"localhost\"/></Peers></Discovery>";

#define TWIST &geometry_msgs_msg_dds__Twist__desc

/// QoS of a publisher; each value is the one policy that does not match.
typedef enum { COMMON = 0, PARTITION, OWNERSHIP, REPRESENTATION } quality_t;

static dds_qos_t *quality_of(quality_t quality) {
    static const char *partitions[] = {"other"};
    static const dds_data_representation_id_t newer = DDS_DATA_REPRESENTATION_XCDR2;
    dds_qos_t *qos = dds_create_qos();
    if (quality == PARTITION) {
        dds_qset_partition(qos, 1, partitions);
    } else if (quality == OWNERSHIP) {
        dds_qset_ownership(qos, DDS_OWNERSHIP_EXCLUSIVE);
    } else if (quality == REPRESENTATION) {
        dds_qset_data_representation(qos, 1, &newer);
    }
    return qos;
}

static const struct {
    const dds_topic_descriptor_t *type;
    quality_t quality;
    const char *seen_type;
    const char *seen_policy;
} publishers[] = {{&std_msgs_msg_dds__String__desc, COMMON, "std_msgs/msg/String", ""},
                  {TWIST, PARTITION, "geometry_msgs/msg/Twist", "partition"},
                  {TWIST, OWNERSHIP, "geometry_msgs/msg/Twist", "ownership"},
                  {TWIST, REPRESENTATION, "geometry_msgs/msg/Twist", "data representation"}};
#define PUBLISHERS (sizeof publishers / sizeof publishers[0])

/// Publishes on cmd_vel in a separate process: each byte of `orders` starts or ends the next publisher of the table.
static _Noreturn void publish_unmatched(int orders) {
    char order;
    bool good = true;
    (void)setenv("CYCLONEDDS_URI", local, 1);
    for (size_t i = 0; i < PUBLISHERS; i++) {
        if (read(orders, &order, 1) != 1) { // The test has ended.
            _exit(1);
        }
        const dds_entity_t other = dds_create_participant(settings.ros.domain, NULL, NULL);
        const dds_entity_t topic = dds_create_topic(other, publishers[i].type, "rt/cmd_vel", NULL, NULL);
        dds_qos_t *qos = quality_of(publishers[i].quality);
        good = dds_create_writer(other, topic, qos, NULL) > 0 && good;
        dds_delete_qos(qos);
        good = read(orders, &order, 1) == 1 && good;
        (void)dds_delete(other);
    }
    _exit(good ? 0 : 1);
}

static void test_dds_search_of_publishers_follows_announcements(void) {
    ros_unmatched_t unmatched = {.count = 0};
    int orders[2];
    int status = 1;
    TEST_ASSERT_EQUAL_INT(0, pipe(orders));
    const pid_t child = fork(); // Before this process has threads of DDS.
    if (child == 0) {
        (void)close(orders[1]);
        publish_unmatched(orders[0]);
    }
    ros = ros_open(&settings, NULL, NULL, stderr);
    TEST_ASSERT_NOT_NULL(ros);
    set_us = __real_bridge_now_us();
    TEST_ASSERT_TRUE(searches(&unmatched, 0));
    TEST_ASSERT_FALSE(searches(&unmatched, 2100));
    TEST_ASSERT_FALSE(searches(&unmatched, 7000));
    TEST_ASSERT_TRUE(searches(&unmatched, 1000)); // 10 s after the last search.
    for (size_t i = 0; i < PUBLISHERS; i++) {
        TEST_ASSERT_TRUE(await_rest(&unmatched));
        TEST_ASSERT_EQUAL_INT(1, write(orders[1], "1", 1));
        TEST_ASSERT_TRUE_MESSAGE(await_count(&unmatched, 1), publishers[i].seen_policy);
        TEST_ASSERT_EQUAL_STRING(publishers[i].seen_type, unmatched.type);
        TEST_ASSERT_EQUAL_STRING(publishers[i].seen_policy, unmatched.policy);
        TEST_ASSERT_TRUE(searches(&unmatched, 3000)); // Until it has gone.
        TEST_ASSERT_EQUAL_INT(1, write(orders[1], "2", 1));
        TEST_ASSERT_TRUE_MESSAGE(await_count(&unmatched, 0), publishers[i].seen_policy);
    }
    TEST_ASSERT_EQUAL_INT(child, waitpid(child, &status, 0));
    TEST_ASSERT_EQUAL_INT(0, status);
    (void)close(orders[0]);
    (void)close(orders[1]);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_dds_search_of_publishers_follows_announcements);
    RUN_TEST(test_dds_node_on_loopback_is_not_reached_from_outside);
    RUN_TEST(test_dds_node_on_a_network_is_reached_from_outside);
    RUN_TEST(test_dds_sample_that_cannot_be_read_is_a_request);
    RUN_TEST(test_dds_client_that_disposes_and_goes_is_no_request);
    RUN_TEST(test_dds_reply_waits_for_the_reader_of_its_caller);
    RUN_TEST(test_dds_replies_to_callers_without_reader_are_sent_later);
    RUN_TEST(test_dds_node_is_used_by_a_reader_or_a_caller_only);
    return UNITY_END();
}
