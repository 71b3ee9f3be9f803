// SPDX-License-Identifier: MIT
#include "ros_parts.h"

#include "common/reach.h"
#include "ros_types.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/// Most endpoints of a node.
#define ENDPOINTS_MAX 24U
#define HASH(hex)     "typehash=RIHS01_" hex ";"

/// Configuration of CycloneDDS. It requests a missing sample again every 50 ms, not every 3 s: Fast DDS can ignore the
/// first request for a sample that it has just written, and that sample can be a stop.
#define REQUEST_AGAIN                                                                                                  \
    "<CycloneDDS><Domain Id=\"any\"><Internal><NackDelay>50 ms</NackDelay>"                                            \
    "<AutoReschedNackDelay>50 ms</AutoReschedNackDelay></Internal></Domain></CycloneDDS>"

/// Configuration for this machine only. It disables multicast, because lo has none on a machine without a network.
static const char LOOPBACK[] = REQUEST_AGAIN
    ",<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" "
    "multicast=\"false\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address=\"localhost\"/></Peers></Discovery>"
    "</Domain></CycloneDDS>";

#define HASH_TWIST       HASH("9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a")
#define HASH_STAMPED     HASH("5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64")
#define HASH_STRING      HASH("df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18")
#define HASH_ODOMETRY    HASH("3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0")
#define HASH_JOINTS      HASH("a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e")
#define HASH_TF          HASH("e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087")
#define HASH_WRENCH      HASH("8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77")
#define HASH_BATTERY     HASH("4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741")
#define HASH_BOOL        HASH("feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9")
#define HASH_GRAPH       HASH("e725f4a506958c79f95dd693b965722c57b19cd18e7eff984f49561b93dc985d")
#define HASH_DIAGNOSTICS HASH("5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e")

static const ros_topic_t written[WRITERS] = {
    [WRITES_ODOM] = {"odom", &nav_msgs_msg_dds__Odometry__desc, HASH_ODOMETRY, false},
    [WRITES_JOINTS] = {"joint_states", &sensor_msgs_msg_dds__JointState__desc, HASH_JOINTS, false},
    [WRITES_TF] = {"/tf", &tf2_msgs_msg_dds__TFMessage__desc, HASH_TF, false},
    [WRITES_LEFT_WRENCH] = {"left/wrench", &geometry_msgs_msg_dds__WrenchStamped__desc, HASH_WRENCH, false},
    [WRITES_RIGHT_WRENCH] = {"right/wrench", &geometry_msgs_msg_dds__WrenchStamped__desc, HASH_WRENCH, false},
    [WRITES_LEFT_BATTERY] = {"left/battery_state", &sensor_msgs_msg_dds__BatteryState__desc, HASH_BATTERY, false},
    [WRITES_RIGHT_BATTERY] = {"right/battery_state", &sensor_msgs_msg_dds__BatteryState__desc, HASH_BATTERY, false},
    [WRITES_DIAGNOSTICS] = {"/diagnostics", &diagnostic_msgs_msg_dds__DiagnosticArray__desc, HASH_DIAGNOSTICS, false},
    [WRITES_STATE] = {"iwheel/state", &std_msgs_msg_dds__String__desc, HASH_STRING, true},
    [WRITES_ANSWER] = {"iwheel/answer", &std_msgs_msg_dds__String__desc, HASH_STRING, false},
    [WRITES_ESTOP] = {"iwheel/emergency_stop", &std_msgs_msg_dds__Bool__desc, HASH_BOOL, true},
};
static const ros_topic_t commanded[ROS_COMMAND_READERS] = {
    {"cmd_vel", &geometry_msgs_msg_dds__Twist__desc, HASH_TWIST, false},
    {"cmd_vel", &geometry_msgs_msg_dds__TwistStamped__desc, HASH_STAMPED, false}};
static const ros_topic_t asked = {"iwheel/ask", &std_msgs_msg_dds__String__desc, HASH_STRING, false};

dds_qos_t *ros_qos(const char *user_data, int32_t depth, bool reliable, bool retained) {
    const dds_data_representation_id_t classic = DDS_DATA_REPRESENTATION_XCDR1;
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
    dds_qset_durability(qos, retained ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    dds_qset_writer_data_lifecycle(qos, false);
    dds_qset_data_representation(qos, 1, &classic);
    dds_qset_userdata(qos, user_data, strlen(user_data));
    return qos;
}

void ros_name(const ros_t *self, const char *name, const char *prefix, const char *suffix, char out[ROS_NAME_SIZE]) {
    const char *space = (name[0] == '/') ? "" : ros_settings_space(&self->settings);
    (void)snprintf(out, ROS_NAME_SIZE, "%s%s%s/%s%s", prefix, (space[0] != '\0') ? "/" : "", space,
                   name + ((name[0] == '/') ? 1 : 0), suffix);
}

static dds_entity_t topic_of(const ros_t *self, const ros_topic_t *topic) {
    char name[ROS_NAME_SIZE];
    ros_name(self, topic->name, "rt", "", name);
    return dds_create_topic(self->participant, topic->type, name, NULL, NULL);
}

void ros_wake(dds_entity_t reader, void *context) {
    const uint64_t one = 1;
    const ros_t *self = context;
    (void)reader;
    (void)!write(self->fd, &one, sizeof one);
}

/// Forwards a command in this thread of DDS if possible, because waking the other thread takes longer.
static void take_or_wake(dds_entity_t reader, void *context) {
    const ros_t *self = context;
    if (self->came == NULL || !self->came(self->context)) {
        ros_wake(reader, context);
    }
}

dds_entity_t ros_reader(ros_t *self, dds_entity_t topic, dds_qos_t *qos, dds_on_data_available_fn react) {
    dds_listener_t *listener = dds_create_listener(self);
    dds_lset_data_available(listener, react);
    const dds_entity_t reader = dds_create_reader(self->participant, topic, qos, listener);
    dds_delete_listener(listener);
    dds_delete_qos(qos);
    return reader;
}

dds_entity_t ros_writer(ros_t *self, dds_entity_t topic, dds_qos_t *qos) {
    const dds_entity_t writer = dds_create_writer(self->participant, topic, qos, NULL);
    dds_delete_qos(qos);
    return writer;
}

static bool open_topics(ros_t *self) {
    bool good = true;
    for (unsigned i = 0; i < WRITERS; i++) {
        const ros_topic_t *topic = &written[i];
        if (i == WRITES_TF && !self->settings.odometry.tf) {
            continue;
        }
        self->writers[i] = ros_writer(self, topic_of(self, topic),
                                      ros_qos(topic->hash, topic->retained ? 1 : 10, true, topic->retained));
        good = good && self->writers[i] > 0;
    }
    for (unsigned i = 0; i < ROS_COMMAND_READERS && self->settings.drive.enabled; i++) {
        const ros_topic_t *topic = &commanded[i];
        if ((self->settings.drive.command & (1U << i)) != 0U) {
            // Best effort matches every publisher, and DDS does not deliver a lost command later.
            self->commands[i] =
                ros_reader(self, topic_of(self, topic), ros_qos(topic->hash, 1, false, false), take_or_wake);
            good = good && self->commands[i] > 0;
        }
    }
    self->asks = ros_reader(self, topic_of(self, &asked), ros_qos(asked.hash, 10, true, false), ros_wake);
    for (unsigned verb = 0; verb < ROS_VERBS; verb++) {
        good = ros_open_service(self, (ros_verb_t)verb) && good;
    }
    return good && self->asks > 0;
}

typedef rmw_dds_common_msg_dds__Gid_ gid_bytes_t;
typedef rmw_dds_common_humble_msg_dds__Gid_ old_gid_bytes_t;
typedef rmw_dds_common_msg_dds__ParticipantEntitiesInfo_ node_info_t;
typedef rmw_dds_common_humble_msg_dds__ParticipantEntitiesInfo_ old_node_info_t;

static uint32_t gids_of(const dds_entity_t *entities, size_t count, size_t size, uint8_t *out) {
    uint32_t used = 0;
    dds_guid_t guid;
    for (size_t i = 0; i < count && used < ENDPOINTS_MAX; i++) {
        if (entities[i] > 0 && dds_get_guid(entities[i], &guid) == DDS_RETCODE_OK) {
            memcpy(out + used * size, guid.v, sizeof guid.v);
            used++;
        }
    }
    return used;
}

/// Announces the name of the node for `ros2 node list`. DDS stores the announcement for programs that start later.
static bool announce(ros_t *self) {
    const bool old = self->settings.ros.humble;
    const size_t size = old ? sizeof(old_gid_bytes_t) : sizeof(gid_bytes_t);
    uint8_t readers[ENDPOINTS_MAX * sizeof(old_gid_bytes_t)] = {0};
    uint8_t writers[sizeof readers] = {0};
    char space[80];
    const dds_entity_t inputs[ROS_COMMAND_READERS + 1U] = {self->commands[0], self->commands[1], self->asks};
    uint32_t reading = gids_of(self->requests, ROS_VERBS, size, readers);
    reading += gids_of(inputs, ROS_COMMAND_READERS + 1U, size, readers + reading * size);
    uint32_t writing = gids_of(self->writers, WRITERS, size, writers);
    writing += gids_of(self->replies, ROS_VERBS, size, writers + writing * size);
    (void)snprintf(space, sizeof space, "/%s", ros_settings_space(&self->settings));

    dds_topic_descriptor_t type = old ? rmw_dds_common_humble_msg_dds__ParticipantEntitiesInfo__desc
                                      : rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc;
    type.m_typename = rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc.m_typename;
    const dds_entity_t topic = dds_create_topic(self->participant, &type, "ros_discovery_info", NULL, NULL);
    self->graph = ros_writer(self, topic, ros_qos(old ? "" : HASH_GRAPH, 1, true, true));

    // The two types of node differ only in the size of the entries of these buffers.
    rmw_dds_common_msg_dds__NodeEntitiesInfo_ node = {
        .node_namespace = space,
        .node_name = self->settings.ros.node,
        .reader_gid_seq = {._length = reading, ._buffer = (gid_bytes_t *)(void *)readers},
        .writer_gid_seq = {._length = writing, ._buffer = (gid_bytes_t *)(void *)writers}};
    dds_guid_t guid;
    node_info_t info = {.node_entities_info_seq = {._length = 1, ._buffer = &node}};
    old_node_info_t old_info = {.node_entities_info_seq = {._length = 1, ._buffer = (void *)&node}};
    (void)dds_get_guid(self->participant, &guid);
    memcpy(info.gid.data, guid.v, sizeof guid.v);
    memcpy(old_info.gid.data, guid.v, sizeof guid.v);
    return self->graph > 0 &&
           dds_write(self->graph, old ? (const void *)&old_info : (const void *)&info) == DDS_RETCODE_OK;
}

/// Creates the domain and binds its sockets to `lo`. CycloneDDS sends from the interface of its configuration, but its
/// receiving sockets have the address 0.0.0.0. It opens them with the domain. There is no reader yet, so DDS discards
/// everything that came before the sockets are bound.
static bool keep_local(ros_t *self, FILE *err) {
    self->domain = dds_create_domain(self->settings.ros.domain, LOOPBACK);
    if (self->domain > 0 && !bridge_reach_bind_lo()) {
        (void)fprintf(
            err,
            "iwheel-ros2: cannot limit the DDS sockets to this machine: %s; it needs Linux 5.7 and the interface "
            "lo up, or set [ros] network = default\n",
            strerror(errno));
        return false;
    }
    return true;
}

/// Creates the domain with the configuration of the user, if there is one; it comes last, so it decides.
static void follow_user(ros_t *self) {
    const char *theirs = getenv("CYCLONEDDS_URI");
    char *both = NULL;
    if (asprintf(&both, REQUEST_AGAIN ",%s", (theirs != NULL) ? theirs : "") >= 0) {
        self->domain = dds_create_domain(self->settings.ros.domain, both);
        free(both);
    }
}

static bool join(ros_t *self, FILE *err) {
    const char *const enclave = "enclave=/;";
    if (self->settings.ros.loopback && !keep_local(self, err)) {
        return false;
    }
    if (!self->settings.ros.loopback) {
        follow_user(self);
    }
    dds_qos_t *qos = dds_create_qos();
    dds_qset_userdata(qos, enclave, strlen(enclave));
    self->participant =
        (self->domain < 0) ? self->domain : dds_create_participant(self->settings.ros.domain, qos, NULL);
    dds_delete_qos(qos);
    if (self->participant <= 0) {
        (void)fprintf(
            err, "iwheel-ros2: cannot join DDS domain %u (%s); check the network, CYCLONEDDS_URI and [ros] network\n",
            self->settings.ros.domain, dds_strretcode(-self->participant));
        return false;
    }
    if (self->settings.ros.loopback && !bridge_reach_is_local("iwheel-ros2", NULL, 0)) {
        return false;
    }
    if (!open_topics(self) || !announce(self)) {
        (void)fprintf(err, "iwheel-ros2: DDS refuses a topic; is [ros] namespace too long?\n");
        return false;
    }
    return true;
}

/// Writes namespace and node, and the frames of the handles, which have the prefix of the base's frame, as in
/// w1/base_link.
static void name_robot(ros_t *self) {
    static const char *const handles[2] = {"left_handle", "right_handle"};
    const char *space = ros_settings_space(&self->settings);
    const char *base = self->settings.odometry.base_frame;
    const char *slash = strrchr(base, '/');
    const int prefix = (slash != NULL) ? (int)(slash - base) + 1 : 0;
    (void)snprintf(self->robot, sizeof self->robot, "%s%s%s", space, (space[0] != '\0') ? "/" : "",
                   self->settings.ros.node);
    for (size_t i = 0; i < 2U; i++) {
        (void)snprintf(self->handles[i], sizeof self->handles[i], "%.*s%s", prefix, base, handles[i]);
    }
}

ros_t *ros_open(const ros_settings_t *settings, ros_came_t came, void *context, FILE *err) {
    ros_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        (void)fputs("iwheel-ros2: not enough memory to start\n", err);
        return NULL;
    }
    self->settings = *settings;
    name_robot(self);
    ros_limit_log();
    self->came = came;
    self->context = context;
    self->fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (self->fd < 0 || !join(self, err)) {
        ros_close(self);
        return NULL;
    }
    return self;
}

void ros_close(ros_t *self) {
    ros_close_services(self);
    if (self->participant > 0) {
        (void)dds_delete(self->participant); // With all its entities. Afterwards DDS calls no function of ours.
    }
    if (self->domain > 0) {
        (void)dds_delete(self->domain);
    }
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    free(self);
}

int ros_fd(const ros_t *self) {
    return self->fd;
}

void ros_woken(ros_t *self) {
    uint64_t times;
    (void)!read(self->fd, &times, sizeof times);
    ros_send_replies(self);
}

static int64_t time_of(const builtin_interfaces_msg_dds__Time_ *time) {
    return (int64_t)time->sec * 1000000 + time->nanosec / 1000;
}

static void copy(const geometry_msgs_msg_dds__Vector3_ *from, double out[3]) {
    out[0] = from->x;
    out[1] = from->y;
    out[2] = from->z;
}

bool ros_take_command(ros_t *self, unsigned reader, ros_command_t *out_command) {
    const bool is_stamped = reader == 1U;
    void *sample = NULL;
    dds_sample_info_t info;
    bool accepted = false;
    while (self->commands[reader] > 0 && dds_take(self->commands[reader], &sample, &info, 1, 1) == 1) {
        if (info.valid_data) {
            const geometry_msgs_msg_dds__TwistStamped_ *stamped = sample;
            const geometry_msgs_msg_dds__Twist_ *plain = is_stamped ? &stamped->twist : sample;
            *out_command = (ros_command_t){.source = info.publication_handle, .sent_us = info.source_timestamp / 1000};
            out_command->stamp_us = is_stamped ? time_of(&stamped->header.stamp) : 0;
            copy(&plain->linear, out_command->linear);
            copy(&plain->angular, out_command->angular);
            accepted = true;
        }
        (void)dds_return_loan(self->commands[reader], &sample, 1);
        sample = NULL;
    }
    return accepted;
}

static bool is_written_to(dds_entity_t reader) {
    return reader > 0 && dds_get_matched_publications(reader, NULL, 0) > 0;
}

static bool is_read(dds_entity_t writer) {
    return writer > 0 && dds_get_matched_subscriptions(writer, NULL, 0) > 0;
}

bool ros_is_used(const ros_t *self) {
    bool used = is_written_to(self->asks);
    for (unsigned i = 0; i < WRITERS && !used; i++) {
        used = is_read(self->writers[i]);
    }
    for (unsigned i = 0; i < ROS_COMMAND_READERS && !used; i++) {
        used = is_written_to(self->commands[i]);
    }
    for (unsigned i = 0; i < ROS_VERBS && !used; i++) {
        used = is_written_to(self->requests[i]) || is_read(self->replies[i]);
    }
    return used;
}

unsigned ros_publishers(const ros_t *self) {
    unsigned sum = 0;
    for (unsigned i = 0; i < ROS_COMMAND_READERS; i++) {
        const dds_return_t count =
            (self->commands[i] > 0) ? dds_get_matched_publications(self->commands[i], NULL, 0) : 0;
        sum += (count > 0) ? (unsigned)count : 0U;
    }
    return sum;
}
