// SPDX-License-Identifier: MIT
// A peer of another vendor: Fast DDS, the default of ROS 2. Reads odom, publishes cmd_vel and iwheel/ask; prints one line for each event.
//
//     fast_peer DOMAIN SPEED_M_S          requests to arm, drives for 1.5 s, ends
//     fast_peer DOMAIN SERVICE CALLS      calls a service this often, each time as a new client, as rmw_fastrtps does; 0: 100 clients without a call
//     fast_peer DOMAIN SERVICE late       calls it before the bridge knows the writer: the announcement is sent LATE later
//     fast_peer DOMAIN SERVICE lost       the same, and it loses the first request for the missing call, as Fast DDS ignores one that comes too early
//     fast_peer DOMAIN SERVICE stored     late, with a writer that stores its samples, and has written two before the bridge was there
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#if __has_include(<fastrtps/utils/IPLocator.h>)
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#define FAST_DDS 2
#else
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.hpp>
#include <fastdds/utils/IPLocator.hpp>
#define FAST_DDS 3
#endif

#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
// Debian 12 has version 2, Debian 13 version 3, in which many names differ.
#if FAST_DDS == 2
namespace rtps = eprosima::fastrtps::rtps;
static const auto CDR = Cdr::DDS_CDR;
static const auto OK = ReturnCode_t::RETCODE_OK;
#else
namespace rtps = eprosima::fastdds::rtps;
static const auto CDR = eprosima::fastcdr::CdrVersion::DDS_CDR;
static const auto OK = RETCODE_OK;
#endif

// ---- delayed announcements --------------------------------------------------------------------------------------------

struct Datagram {
    int fd;
    std::vector<uint8_t> bytes, to;
};

static const auto LATE = std::chrono::milliseconds(50);
static std::mutex lock;
static bool holding = false;
static std::vector<Datagram> held;

// Returns true if one of the submessages fulfils `wanted(its bytes, bytes to the end of the message)`.
template <typename Wanted> static bool has_part(const uint8_t *bytes, size_t size, Wanted wanted) {
    for (size_t at = 20; at + 16 <= size;) {
        if (wanted(bytes + at, size - at)) {
            return true;
        }
        const size_t rest = (bytes[at + 1] & 1) ? bytes[at + 2] | bytes[at + 3] << 8 : bytes[at + 2] << 8 | bytes[at + 3];
        at = (rest == 0) ? size : at + 4 + rest;
    }
    return false;
}

// Returns true if the bytes have a DATA of the writer that announces writers.
static bool announces(const std::vector<uint8_t> &bytes) {
    static const uint8_t announcer[4] = {0, 0, 3, 0xC2};
    return has_part(bytes.data(), bytes.size(), [](const uint8_t *part, size_t) {
        return part[0] == 0x15 && std::memcmp(part + 12, announcer, sizeof announcer) == 0;
    });
}

static bool delay(int fd, const std::vector<uint8_t> &bytes, const void *to, size_t to_size) {
    const auto *begin = static_cast<const uint8_t *>(to);
    std::lock_guard<std::mutex> guard(lock);
    if (holding && announces(bytes)) {
        held.push_back({fd, bytes, {begin, begin + to_size}});
        return true;
    }
    return false;
}

// These replace the functions of libc: Fast DDS sends with one or the other.
extern "C" ssize_t sendto(int fd, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t to_size) {
    const auto *begin = static_cast<const uint8_t *>(data);
    if (delay(fd, {begin, begin + size}, to, to_size)) {
        return static_cast<ssize_t>(size);
    }
    return syscall(SYS_sendto, fd, data, size, flags, to, to_size);
}

extern "C" ssize_t sendmsg(int fd, const struct msghdr *message, int flags) {
    std::vector<uint8_t> bytes;
    for (size_t i = 0; i < message->msg_iovlen; i++) {
        const auto *begin = static_cast<const uint8_t *>(message->msg_iov[i].iov_base);
        bytes.insert(bytes.end(), begin, begin + message->msg_iov[i].iov_len);
    }
    if (delay(fd, bytes, message->msg_name, message->msg_namelen)) {
        return static_cast<ssize_t>(bytes.size());
    }
    return syscall(SYS_sendmsg, fd, message, flags);
}

static void hold(bool wanted) {
    std::lock_guard<std::mutex> guard(lock);
    holding = wanted;
    for (const Datagram &datagram : held) {
        (void)syscall(SYS_sendto, datagram.fd, datagram.bytes.data(), datagram.bytes.size(), 0, datagram.to.data(), datagram.to.size());
    }
    if (!wanted) {
        std::printf("%zu announcements sent late\n", held.size());
    }
    held.clear();
}

// ---- a lost request for missing samples ---------------------------------------------------------------------------------

static bool losing = false;
static int lost = 0;

// Returns true for the first bytes with an ACKNACK that requests a sample of a writer of the application.
static bool loses(const uint8_t *bytes, size_t size) {
    std::lock_guard<std::mutex> guard(lock);
    const bool now = losing && has_part(bytes, size, [](const uint8_t *part, size_t left) {
        return part[0] == 0x06 && left >= 28 && (part[11] == 2 || part[11] == 3) && (part[20] | part[21] | part[22] | part[23]) != 0;
    });
    losing = losing && !now;
    lost += now ? 1 : 0;
    return now;
}

// These replace the functions of libc: Fast DDS receives with one or the other.
extern "C" ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *from_size) {
    ssize_t came = 0;
    do {
        came = syscall(SYS_recvfrom, fd, data, size, flags, from, from_size);
    } while (came > 0 && loses(static_cast<const uint8_t *>(data), static_cast<size_t>(came)));
    return came;
}

extern "C" ssize_t recvmsg(int fd, struct msghdr *message, int flags) {
    ssize_t came = 0;
    do {
        came = syscall(SYS_recvmsg, fd, message, flags);
    } while (came > 0 && loses(static_cast<const uint8_t *>(message->msg_iov[0].iov_base), static_cast<size_t>(came)));
    return came;
}

// ---- types ------------------------------------------------------------------------------------------------------------

// Common to all three: numbers and texts in the order of the message.
struct Values {
    std::vector<double> numbers;
    std::vector<std::string> texts;
};

enum class Kind { Twist, String, Odometry, Request, Reply };

static void write_values(Kind kind, const Values &values, rtps::SerializedPayload_t &payload) {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char *>(payload.data), payload.max_size);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, CDR);
    payload.encapsulation = CDR_LE;
    cdr.serialize_encapsulation();
    if (kind == Kind::Request) {
        cdr << static_cast<uint8_t>(0); // structure_needs_at_least_one_member
    }
    for (double number : values.numbers) {
        cdr << number;
    }
    for (const std::string &text : values.texts) {
        cdr << text;
    }
#if FAST_DDS == 2
    payload.length = static_cast<uint32_t>(cdr.getSerializedDataLength());
#else
    payload.length = static_cast<uint32_t>(cdr.get_serialized_data_length());
#endif
}

static void read_values(Kind kind, rtps::SerializedPayload_t &payload, Values &values) {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char *>(payload.data), payload.length);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, CDR);
    cdr.read_encapsulation();
    values = Values();
    if (kind == Kind::String) {
        values.texts.resize(1);
        cdr >> values.texts[0];
        return;
    }
    if (kind == Kind::Reply) {
        bool success = false;
        values.texts.resize(1);
        cdr >> success >> values.texts[0];
        values.numbers.push_back(success ? 1 : 0);
        return;
    }
    int32_t sec = 0;
    uint32_t nanosec = 0;
    values.texts.resize(2);
    cdr >> sec >> nanosec >> values.texts[0] >> values.texts[1];
    values.numbers.resize(7 + 36 + 6 + 36); // Pose, its covariance, twist, its covariance.
    for (double &number : values.numbers) {
        cdr >> number;
    }
}

class Type : public TopicDataType {
  public:
#if FAST_DDS == 2
    Type(Kind kind, const char *name) : kind_(kind) {
        setName(name);
        m_typeSize = 4096;
        m_isGetKeyDefined = false;
    }
    bool serialize(void *data, rtps::SerializedPayload_t *payload) override {
        write_values(kind_, *static_cast<Values *>(data), *payload);
        return true;
    }
    bool deserialize(rtps::SerializedPayload_t *payload, void *data) override {
        read_values(kind_, *payload, *static_cast<Values *>(data));
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void *data) override {
        (void)data;
        return [] { return 4096U; };
    }
    void *createData() override { return new Values(); }
    void deleteData(void *data) override { delete static_cast<Values *>(data); }
    bool getKey(void *, rtps::InstanceHandle_t *, bool) override { return false; }
#else
    Type(Kind kind, const char *name) : kind_(kind) {
        set_name(name);
        max_serialized_type_size = 4096;
        is_compute_key_provided = false;
    }
    bool serialize(const void *const data, rtps::SerializedPayload_t &payload, DataRepresentationId_t) override {
        write_values(kind_, *static_cast<const Values *>(data), payload);
        return true;
    }
    bool deserialize(rtps::SerializedPayload_t &payload, void *data) override {
        read_values(kind_, payload, *static_cast<Values *>(data));
        return true;
    }
    uint32_t calculate_serialized_size(const void *const, DataRepresentationId_t) override { return 4096U; }
    void *create_data() override { return new Values(); }
    void delete_data(void *data) override { delete static_cast<Values *>(data); }
    bool compute_key(rtps::SerializedPayload_t &, rtps::InstanceHandle_t &, bool) override { return false; }
    bool compute_key(const void *const, rtps::InstanceHandle_t &, bool) override { return false; }
#endif

  private:
    Kind kind_;
};

struct Node {
    DomainParticipant *participant;
    Publisher *publisher;
    Subscriber *subscriber;

    Topic *topic(Kind kind, const char *name, const char *type_name) {
        TypeSupport type(new Type(kind, type_name));
        type.register_type(participant);
        return participant->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
    }
    DataWriter *writer(Topic *topic, bool stored = false) {
        DataWriterQos qos = DATAWRITER_QOS_DEFAULT; // Reliable, keep last: the default of rmw_fastrtps.
        qos.durability().kind = stored ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
        qos.history().depth = 10;
        return publisher->create_datawriter(topic, qos);
    }
    DataReader *reader(Topic *topic) {
        DataReaderQos qos = DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
        qos.history().depth = 10;
        return subscriber->create_datareader(topic, qos);
    }
};

// Uses unicast to the ports of the first participants of this machine, because there may be no multicast.
static DomainParticipant *join(uint32_t domain) {
    DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
    for (uint32_t number = 0; number < 8; number++) {
        rtps::Locator_t locator;
        locator.kind = LOCATOR_KIND_UDPv4;
        rtps::IPLocator::setIPv4(locator, "127.0.0.1");
        locator.port = 7400 + 250 * domain + 10 + 2 * number;
        qos.wire_protocol().builtin.initialPeersList.push_back(locator);
    }
    auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().user_transports.push_back(loopback);
    qos.transport().use_builtin_transports = false;
    return DomainParticipantFactory::get_instance()->create_participant(domain, qos);
}

struct Client {
    DataReader *replies;
    DataWriter *requests;
};

static void await_service(const Client &client) {
    PublicationMatchedStatus served = {};
    for (int wait = 0; wait < 1000 && served.current_count == 0; wait++) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        client.requests->get_publication_matched_status(served);
    }
    SubscriptionMatchedStatus answers = {};
    for (int wait = 0; wait < 200 && answers.current_count == 0; wait++) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        client.replies->get_subscription_matched_status(answers);
    }
}

static rtps::SampleIdentity request(const Client &client) {
    Values values;
    rtps::WriteParams parameters;
    parameters.related_sample_identity().writer_guid(client.replies->guid());
    client.requests->write(&values, parameters);
    return parameters.sample_identity();
}

static void call(const Client &client, bool late) {
    Values values;
    SampleInfo info;
    const auto begin = std::chrono::steady_clock::now();
    const rtps::SampleIdentity mine = request(client);
    std::printf("called at %lld us\n", static_cast<long long>(std::chrono::duration_cast<std::chrono::microseconds>(begin.time_since_epoch()).count()));
    if (late) {
        std::this_thread::sleep_for(LATE);
        hold(false);
    }
    bool answered = false;
    while (!answered && std::chrono::steady_clock::now() - begin < std::chrono::seconds(2)) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        while (!answered && client.replies->take_next_sample(&values, &info) == OK) {
            answered = info.valid_data && info.related_sample_identity.writer_guid() == client.replies->guid() &&
                       info.related_sample_identity.sequence_number() == mine.sequence_number();
        }
    }
    const auto span = std::chrono::steady_clock::now() - begin;
    std::printf("%s %d after %d ms: %s\n", answered ? "reply" : "no reply", answered ? static_cast<int>(values.numbers[0]) : -1,
                static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(span).count()), answered ? values.texts[0].c_str() : "");
    std::fflush(stdout);
}

// The clients of rmw_fastrtps: the request names the reader of its replies, and the reply has that request's identity.
static void call_service(Node &node, const std::string &name, const std::string &how) {
    const bool stored = how == "stored";
    losing = how == "lost";
    const bool late = stored || losing || how == "late";
    const int calls = late ? 1 : std::atoi(how.c_str());
    Topic *request_topic = node.topic(Kind::Request, ("rq/" + name + "Request").c_str(), "std_srvs::srv::dds_::Trigger_Request_");
    Topic *reply_topic = node.topic(Kind::Reply, ("rr/" + name + "Reply").c_str(), "std_srvs::srv::dds_::Trigger_Response_");
    const int clients = (calls > 0) ? calls : 100;
    for (int i = 0; i < clients; i++) {
        if (late) {
            hold(true);
        }
        const Client client = {node.reader(reply_topic), node.writer(request_topic, stored)};
        for (int old = 0; stored && old < 2; old++) {
            (void)request(client);
        }
        if (stored) {
            std::printf("two are stored\n");
            std::fflush(stdout);
        }
        await_service(client);
        if (calls > 0) {
            call(client, late);
        }
        node.publisher->delete_datawriter(client.requests);
        node.subscriber->delete_datareader(client.replies);
    }
    std::printf("%d clients, %d requests lost\n", clients, lost);
}

int main(int argc, char **argv) {
    const double speed = (argc == 3) ? std::atof(argv[2]) : 0.0;
    Node node = {};
    node.participant = (argc == 3 || argc == 4) ? join(static_cast<uint32_t>(std::atoi(argv[1]))) : nullptr;
    if (node.participant == nullptr) {
        return 64;
    }
    node.publisher = node.participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    node.subscriber = node.participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    if (argc == 4) {
        call_service(node, argv[2], argv[3]);
        std::fflush(stdout);
        std::_Exit(0);
    }
    DataReader *odom = node.reader(node.topic(Kind::Odometry, "rt/odom", "nav_msgs::msg::dds_::Odometry_"));
    DataReader *answer = node.reader(node.topic(Kind::String, "rt/iwheel/answer", "std_msgs::msg::dds_::String_"));
    DataWriter *ask = node.writer(node.topic(Kind::String, "rt/iwheel/ask", "std_msgs::msg::dds_::String_"));
    DataWriter *cmd = node.writer(node.topic(Kind::Twist, "rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_"));
    Values values;
    SampleInfo info;
    int odometries = 0;
    bool armed = false;
    for (int i = 0; i < 300 && !armed; i++) { // 15 s
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        if (i % 10 == 5) {
            Values arm = {{}, {"arm"}};
            ask->write(&arm);
        }
        while (answer->take_next_sample(&values, &info) == OK) {
            std::printf("answer %s\n", values.texts[0].c_str());
            armed = armed || values.texts[0].rfind("arm: done", 0) == 0;
        }
    }
    for (int i = 0; i < 30 && armed; i++) {
        Values twist = {{speed, 0, 0, 0, 0, 0}, {}};
        cmd->write(&twist);
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    while (odom->take_next_sample(&values, &info) == OK) {
        odometries += info.valid_data ? 1 : 0;
    }
    if (odometries > 0) {
        std::printf("odom %s %s x %.3f v %.3f\n", values.texts[0].c_str(), values.texts[1].c_str(), values.numbers[0], values.numbers[43]);
    }
    std::fflush(stdout);
    std::_Exit(0);
}
