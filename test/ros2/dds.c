// SPDX-License-Identifier: MIT
// The node itself, without a bridge: the sockets that it opens, as the kernel reports them.
#include "common/reach.h"
#include "free_domain.h"
#include "raw.h"
#include "ros.h"

#include "unity.h"

#include <stdlib.h>

static ros_settings_t settings;
static ros_t *ros;

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

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_dds_node_on_loopback_is_not_reached_from_outside);
    RUN_TEST(test_dds_node_on_a_network_is_reached_from_outside);
    RUN_TEST(test_dds_sample_that_cannot_be_read_is_a_request);
    RUN_TEST(test_dds_client_that_disposes_and_goes_is_no_request);
    RUN_TEST(test_dds_reply_waits_for_the_reader_of_its_caller);
    RUN_TEST(test_dds_replies_to_callers_without_reader_are_sent_later);
    return UNITY_END();
}
