// SPDX-License-Identifier: MIT
// Requests: the services, in the forms of all vendors (services.h), and the topic iwheel/ask.
#include "announced.h"
#include "common/bridge_service.h"
#include "firsts.h"
#include "ros_parts.h"
#include "ros_types.h"

#include <errno.h>
#include <pthread.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

/// The longest UDP datagram.
#define MESSAGE_MAX 65536U
/// Most readers of replies among which the bridge searches the caller's reader.
#define READERS_MAX     256U
#define CLIENT_ID_SIZE  120U
#define READER_NO_KEY   0x04U
#define READER_WITH_KEY 0x07U
/// Longest time for which a reply waits for its reader.
#define WAIT_US 1000000

static const char *const verbs[ROS_VERBS] = {"arm", "stop", "estop", "reset"};

_Static_assert((int)ROS_VERBS == (int)ROS_MARK_WRITERS, "a writer of replies for each service");

/// State of `sendmsg` below. CycloneDDS calls it in each of its threads, also to repeat a reply, and without a context,
/// so there can be only one node at a time.
static struct {
    pthread_mutex_t lock;
    bool used; ///< There was a reply that must be marked.
    ros_marks_t marks;
    uint8_t message[MESSAGE_MAX];
    uint8_t marked[MESSAGE_MAX];
} out = {.lock = PTHREAD_MUTEX_INITIALIZER};

/// Copies the parts of a message to `out.message`. Returns the length; 0: the message does not fit.
static size_t join_parts(const struct msghdr *message) {
    size_t length = 0;
    for (size_t i = 0; i < message->msg_iovlen; i++) {
        const struct iovec *part = &message->msg_iov[i];
        if (part->iov_len > sizeof out.message - length) {
            return 0;
        }
        memcpy(out.message + length, part->iov_base, part->iov_len);
        length += part->iov_len;
    }
    return length;
}

static ssize_t send_as_it_is(int fd, const struct msghdr *message, int flags) {
    return (ssize_t)syscall(SYS_sendmsg, fd, message, flags);
}

/// Writes the message that replaces `out.message` to `*whole`. Returns false if nothing changes.
static bool change_message(size_t length, struct iovec *whole) {
    const bool asked = rtps_ask_firsts(out.message, length);
    const size_t marked =
        out.used ? ros_service_mark(&out.marks, out.message, length, out.marked, sizeof out.marked) : 0U;
    *whole = (struct iovec){.iov_base = (marked > 0U) ? out.marked : out.message,
                            .iov_len = (marked > 0U) ? marked : length};
    return asked || marked > 0U;
}

/// Replaces libc's function for the whole process. It adds the identity of the request to a reply to a Fast DDS client,
/// and changes requests for first samples to the form of Fast DDS.
ssize_t sendmsg(int fd, const struct msghdr *message, int flags) {
    struct iovec whole;
    ssize_t sent = 0;
    (void)pthread_mutex_lock(&out.lock);
    const size_t length = join_parts(message);
    const bool changed = change_message(length, &whole);
    if (changed) {
        struct msghdr copy = *message;
        copy.msg_iov = &whole;
        copy.msg_iovlen = 1;
        sent = send_as_it_is(fd, &copy, flags);
        if (sent == (ssize_t)whole.iov_len) {
            sent = (ssize_t)length; // CycloneDDS compares it with the length of its own message.
        }
    }
    const int error = errno;
    (void)pthread_mutex_unlock(&out.lock);
    errno = error;
    return changed ? sent : send_as_it_is(fd, message, flags);
}

/// State of `recvmsg` below, which CycloneDDS also calls in each of its threads.
static struct {
    pthread_mutex_t lock;
    rtps_firsts_t firsts;
    int64_t announced_us; ///< See `ros_announced_us`.
} in = {.lock = PTHREAD_MUTEX_INITIALIZER};

/// Replaces libc's function for the whole process. It makes CycloneDDS request the samples that a new writer of Fast
/// DDS wrote before CycloneDDS knew it, and limits the data that other programs announce.
ssize_t recvmsg(int fd, struct msghdr *message, int flags) {
    const ssize_t came = (ssize_t)syscall(SYS_recvmsg, fd, message, flags);
    if (came <= 0 || message->msg_iovlen != 1 || (message->msg_flags & MSG_TRUNC) != 0) {
        return came;
    }
    const struct iovec *buffer = &message->msg_iov[0];
    const bool has_writer = rtps_drop_large_data(buffer->iov_base, (size_t)came);
    (void)pthread_mutex_lock(&in.lock);
    const int64_t now = (int64_t)bridge_now_us();
    const size_t length = rtps_await_firsts(&in.firsts, now, buffer->iov_base, (size_t)came, buffer->iov_len);
    in.announced_us = has_writer ? now : in.announced_us;
    (void)pthread_mutex_unlock(&in.lock);
    return (ssize_t)length;
}

int64_t ros_announced_us(void) {
    (void)pthread_mutex_lock(&in.lock);
    const int64_t at_us = in.announced_us;
    (void)pthread_mutex_unlock(&in.lock);
    return at_us;
}

static void note_reply(ros_verb_t verb, const ros_caller_t *caller) {
    (void)pthread_mutex_lock(&out.lock);
    out.used = out.used || caller->form != ROS_FORM_HEADER;
    ros_service_note(&out.marks, (unsigned)verb, caller);
    (void)pthread_mutex_unlock(&out.lock);
}

/// Undoes `note_reply` for a reply that DDS did not write: the next reply gets its sequence number.
static void forget_reply(ros_verb_t verb) {
    (void)pthread_mutex_lock(&out.lock);
    out.marks.writers[verb].number--;
    (void)pthread_mutex_unlock(&out.lock);
}

static void note_writer(const ros_t *self, ros_verb_t verb) {
    dds_guid_t guid = {{0}};
    (void)dds_get_guid(self->replies[verb], &guid);
    (void)pthread_mutex_lock(&out.lock);
    memcpy(out.marks.prefix, guid.v, ROS_PREFIX_SIZE);
    memcpy(out.marks.writers[verb].id, guid.v + ROS_PREFIX_SIZE, sizeof out.marks.writers[verb].id);
    (void)pthread_mutex_unlock(&out.lock);
}

void ros_close_services(ros_t *self) {
    (void)self;
    (void)pthread_mutex_lock(&out.lock);
    out.used = false;
    memset(&out.marks, 0, sizeof out.marks);
    (void)pthread_mutex_unlock(&out.lock);
}

static dds_entity_t topic_of(const ros_t *self, ros_verb_t verb, bool is_reply) {
    char verb_name[40];
    char name[ROS_NAME_SIZE];
    (void)snprintf(verb_name, sizeof verb_name, "iwheel/%s", verbs[verb]);
    ros_name(self, verb_name, is_reply ? "rr" : "rq", is_reply ? "Reply" : "Request", name);
    return ros_raw_topic(self->participant, name,
                         is_reply ? "std_srvs::srv::dds_::Trigger_Response_" : "std_srvs::srv::dds_::Trigger_Request_");
}

static void reader_came(dds_entity_t writer, const dds_publication_matched_status_t status, void *context) {
    (void)status;
    ros_wake(writer, context);
}

/// Opens the reader and writer of a service. Both have the same id in their user data, as in rmw_cyclonedds.
bool ros_open_service(ros_t *self, ros_verb_t verb) {
    char user_data[80];
    dds_guid_t guid;
    (void)dds_get_guid(self->participant, &guid);
    int used = snprintf(user_data, sizeof user_data, "serviceid=%x", (unsigned)verb + 1U);
    for (size_t i = 1; i < sizeof guid.v; i++) {
        used += snprintf(user_data + used, sizeof user_data - (size_t)used, ".%x", guid.v[i]);
    }
    (void)snprintf(user_data + used, sizeof user_data - (size_t)used, ";");
    self->replies[verb] =
        ros_writer(self, topic_of(self, verb, true), ros_qos(user_data, (int32_t)ROS_MARKS, true, false));
    if (self->replies[verb] > 0) {
        note_writer(self, verb);
        dds_listener_t *listener = dds_create_listener(self);
        dds_lset_publication_matched(listener, reader_came);
        (void)dds_set_listener(self->replies[verb], listener);
        dds_delete_listener(listener);
    }
    self->requests[verb] =
        ros_reader(self, topic_of(self, verb, false), ros_qos(user_data, (int32_t)ROS_MARKS, true, false), ros_wake);
    return self->requests[verb] > 0 && self->replies[verb] > 0;
}

static bool take_service(ros_t *self, ros_verb_t verb, ros_request_t *out_request) {
    ros_raw_t raw;
    void *sample = &raw;
    dds_sample_info_t info;
    while (dds_take(self->requests[verb], &sample, &info, 1, 1) == 1) {
        if (info.valid_data) {
            *out_request = (ros_request_t){.verb = verb, .caller = raw.caller, .source = info.publication_handle};
            out_request->sent_us = info.source_timestamp / 1000;
            ros_service_read(raw.bytes, raw.size, &out_request->caller);
            return true;
        }
    }
    return false;
}

static bool take_ask(ros_t *self, ros_request_t *out_request) {
    void *sample = NULL;
    dds_sample_info_t info;
    bool accepted = false;
    while (!accepted && dds_take(self->asks, &sample, &info, 1, 1) == 1) {
        const std_msgs_msg_dds__String_ *text = sample;
        for (unsigned verb = 0; verb < ROS_VERBS && info.valid_data && !accepted; verb++) {
            accepted = strcmp(text->data, verbs[verb]) == 0;
            *out_request = (ros_request_t){.verb = (ros_verb_t)verb, .by_topic = true};
            out_request->source = info.publication_handle;
            out_request->sent_us = info.source_timestamp / 1000;
        }
        (void)dds_return_loan(self->asks, &sample, 1);
        sample = NULL;
    }
    return accepted;
}

bool ros_take_request(ros_t *self, ros_request_t *out_request) {
    // Requests that stop the wheels come first.
    static const ros_verb_t order[ROS_VERBS] = {ROS_ESTOP, ROS_STOP, ROS_RESET, ROS_ARM};
    for (size_t i = 0; i < ROS_VERBS; i++) {
        if (take_service(self, order[i], out_request)) {
            return true;
        }
    }
    return take_ask(self, out_request);
}

/// Reads "clientid=...;" from the user data, by which rmw_cyclonedds marks the reader and writer of one client. Empty:
/// there is none.
static void client_id(const dds_builtintopic_endpoint_t *endpoint, char id[CLIENT_ID_SIZE]) {
    void *data = NULL;
    size_t size = 0;
    id[0] = '\0';
    if (dds_qget_userdata(endpoint->qos, &data, &size) && data != NULL) {
        char *text = data; // CycloneDDS adds a terminating zero.
        char *begin = strstr(text, "clientid=");
        if (begin != NULL) {
            (void)snprintf(id, CLIENT_ID_SIZE, "%.*s", (int)strcspn(begin, ";"), begin);
        }
        dds_free(data);
    }
}

/// Returns true if the request names the caller's reader, as Fast DDS does (RTPS 2.2, 9.3.1.2 lists the kinds of
/// entity).
static bool names_reader(const ros_caller_t *caller) {
    const uint8_t kind = caller->guid[ROS_GUID_SIZE - 1U];
    return caller->form == ROS_FORM_IDENTITY && (kind == READER_NO_KEY || kind == READER_WITH_KEY);
}

static bool is_reader_of(const dds_builtintopic_endpoint_t *reader, const ros_caller_t *caller,
                         const dds_builtintopic_endpoint_t *writer) {
    char ids[2][CLIENT_ID_SIZE];
    if (names_reader(caller)) {
        return memcmp(reader->key.v, caller->guid, ROS_GUID_SIZE) == 0;
    }
    client_id(reader, ids[0]);
    client_id(writer, ids[1]);
    return memcmp(reader->participant_key.v, writer->participant_key.v, ROS_GUID_SIZE) == 0 &&
           strcmp(ids[0], ids[1]) == 0;
}

/// Returns true if the caller's reader is known, because DDS finds the two ends of a client one after the other. Also
/// true if the caller is gone, so that the reply does not wait.
static bool can_read(const ros_t *self, const ros_reply_t *reply) {
    dds_instance_handle_t handles[READERS_MAX];
    const dds_entity_t replies = self->replies[reply->verb];
    dds_builtintopic_endpoint_t *writer = dds_get_matched_publication_data(self->requests[reply->verb], reply->source);
    if (writer == NULL) {
        return true;
    }
    const dds_return_t matched = dds_get_matched_subscriptions(replies, handles, READERS_MAX);
    bool found = matched > (dds_return_t)READERS_MAX; // Too many readers to search.
    for (size_t i = 0; !found && (dds_return_t)i < matched; i++) {
        dds_builtintopic_endpoint_t *reader = dds_get_matched_subscription_data(replies, handles[i]);
        if (reader != NULL) {
            found = is_reader_of(reader, &reply->raw.caller, writer);
            dds_builtintopic_free_endpoint(reader);
        }
    }
    dds_builtintopic_free_endpoint(writer);
    return found;
}

static void write_reply(ros_t *self, ros_reply_t *reply) {
    note_reply(reply->verb, &reply->raw.caller);
    if (dds_write(self->replies[reply->verb], &reply->raw) != DDS_RETCODE_OK) {
        forget_reply(reply->verb);
    }
    reply->used = false;
}

static void hold_back(ros_t *self, const ros_reply_t *reply) {
    size_t at = 0;
    while (at < ROS_WAITING && self->waiting[at].used) {
        at++;
    }
    if (at == ROS_WAITING) {
        write_reply(self, &self->waiting[0]);
        at--;
        memmove(&self->waiting[0], &self->waiting[1], at * sizeof self->waiting[0]);
    }
    self->waiting[at] = *reply;
}

void ros_send_replies(ros_t *self) {
    size_t left = 0;
    for (size_t i = 0; i < ROS_WAITING && self->waiting[i].used; i++) {
        ros_reply_t *reply = &self->waiting[i];
        if (bridge_now_us() >= reply->until_us || can_read(self, reply)) {
            write_reply(self, reply);
        } else if (left++ < i) {
            self->waiting[left - 1U] = *reply;
            reply->used = false;
        }
    }
}

void ros_answer(ros_t *self, const ros_request_t *request, bool success, const char *text) {
    if (request->by_topic) {
        (void)snprintf(self->text, sizeof self->text, "%s: %s%s%s", verbs[request->verb], success ? "done" : "refused",
                       (text[0] != '\0') ? ": " : "", text);
        const std_msgs_msg_dds__String_ answer = {.data = self->text};
        (void)dds_write(self->writers[WRITES_ANSWER], &answer);
        return;
    }
    ros_reply_t reply = {
        .used = true, .verb = request->verb, .source = request->source, .until_us = bridge_now_us() + WAIT_US};
    reply.raw.caller = request->caller;
    reply.raw.size = ros_service_write(&request->caller, success, text, reply.raw.bytes, sizeof reply.raw.bytes);
    if (can_read(self, &reply)) {
        write_reply(self, &reply);
    } else {
        hold_back(self, &reply);
    }
}
