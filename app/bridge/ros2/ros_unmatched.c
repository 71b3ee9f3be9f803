// SPDX-License-Identifier: MIT
// Finds publishers of cmd_vel that DDS does not connect to the bridge. ROS connects only equal types and compatible
// QoS, and reports no error.
#include "common/bridge_service.h"
#include "ros_parts.h"
#include "ros_types.h"

#include <string.h>

#define BATCH 16U
/// Time in which DDS processes an announcement, on a busy machine too.
#define SETTLED_US 2000000
/// A search without an announcement, in case one came in a form that the bridge does not detect.
#define AGAIN_US 10000000

typedef struct {
    ros_t *self;
    char name[ROS_NAME_SIZE]; ///< The DDS name of cmd_vel.
    ros_unmatched_t *out;
} search_t;

static bool is_twist(const char *type) {
    return strcmp(type, geometry_msgs_msg_dds__Twist__desc.m_typename) == 0 ||
           strcmp(type, geometry_msgs_msg_dds__TwistStamped__desc.m_typename) == 0;
}

static bool is_received_type(const ros_t *self, const char *type) {
    return is_twist(type) && self->commands[(strstr(type, "Stamped") != NULL) ? 1 : 0] > 0;
}

static bool is_matched(const ros_t *self, dds_instance_handle_t writer) {
    bool found = false;
    for (unsigned i = 0; i < ROS_COMMAND_READERS && !found; i++) {
        dds_builtintopic_endpoint_t *endpoint =
            (self->commands[i] > 0) ? dds_get_matched_publication_data(self->commands[i], writer) : NULL;
        found = endpoint != NULL;
        if (found) {
            dds_builtintopic_free_endpoint(endpoint);
        }
    }
    return found;
}

/// Returns the policy that does not match. The reader requests less than every ROS program offers, so it can only be a
/// policy that ROS does not set.
static const char *policy_of(const dds_qos_t *qos) {
    uint32_t count = 0;
    char **partitions = NULL;
    dds_ownership_kind_t ownership = DDS_OWNERSHIP_SHARED;
    const bool has = dds_qget_partition(qos, &count, &partitions);
    for (uint32_t i = 0; has && i < count; i++) {
        dds_free(partitions[i]);
    }
    dds_free(partitions);
    if (count > 0U) {
        return "partition";
    }
    return (dds_qget_ownership(qos, &ownership) && ownership != DDS_OWNERSHIP_SHARED) ? "ownership"
                                                                                      : "data representation";
}

static bool ends_with_cmd_vel(const char *topic) {
    static const char end[] = "cmd_vel";
    const size_t length = strlen(topic);
    return strncmp(topic, "rt/", 3) == 0 && length >= sizeof end &&
           strcmp(topic + length - (sizeof end - 1U), end) == 0;
}

static void judge_writer(search_t *search, const dds_builtintopic_endpoint_t *writer, dds_instance_handle_t handle) {
    ros_unmatched_t *out = search->out;
    if (strcmp(writer->topic_name, search->name) != 0) {
        if (is_twist(writer->type_name) && ends_with_cmd_vel(writer->topic_name)) {
            ros_facts_type_name(writer->topic_name + 2, out->elsewhere, sizeof out->elsewhere);
        }
        return;
    }
    const bool is_type = is_received_type(search->self, writer->type_name);
    if (is_type && is_matched(search->self, handle)) {
        return;
    }
    out->count++;
    out->policy = is_type ? policy_of(writer->qos) : "";
    ros_facts_type_name(writer->type_name, out->type, sizeof out->type);
}

/// Returns true if a search can have another result than the last one.
static bool is_search_due(const ros_t *self, const ros_unmatched_t *last, int64_t now) {
    return self->searched_us == 0 || last->count > 0U || last->elsewhere[0] != '\0' ||
           now - ros_announced_us() < SETTLED_US || now - self->searched_us >= AGAIN_US;
}

void ros_find_unmatched(ros_t *self, ros_unmatched_t *out) {
    static const char *const wanted[] = {"nothing", "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped",
                                         "geometry_msgs/msg/Twist or TwistStamped"};
    search_t search = {.self = self, .out = out};
    void *samples[BATCH] = {NULL};
    dds_sample_info_t infos[BATCH];
    const int64_t now = (int64_t)bridge_now_us();
    if (!is_search_due(self, out, now)) {
        return;
    }
    self->searched_us = now;
    *out = (ros_unmatched_t){.policy = "", .wanted = wanted[self->settings.drive.command & ROS_COMMAND_BOTH]};
    if (!self->settings.drive.enabled) {
        return;
    }
    ros_name(self, "cmd_vel", "rt", "", search.name);
    ros_facts_type_name(search.name + 2, out->topic, sizeof out->topic);
    const dds_entity_t reader = dds_create_reader(self->participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, NULL, NULL);
    dds_return_t count = (reader > 0) ? dds_take(reader, samples, infos, BATCH, BATCH) : 0;
    while (count > 0) {
        for (dds_return_t i = 0; i < count; i++) {
            if (infos[i].valid_data && infos[i].instance_state == DDS_IST_ALIVE) {
                judge_writer(&search, samples[i], infos[i].instance_handle);
            }
        }
        (void)dds_return_loan(reader, samples, count);
        memset(samples, 0, sizeof samples);
        count = dds_take(reader, samples, infos, BATCH, BATCH);
    }
    (void)dds_delete(reader);
}
