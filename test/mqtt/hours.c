// SPDX-License-Identifier: MIT
// An hour without network in virtual time: the bridge's own code with libmosquitto, and the gateway's own loop (hours_rig.h), while the button
// stops the wheels again and again. The broker is part of this program: MQTT 3.1.1 on loopback, as far as the bridge needs it, with a line that
// can be cut after any byte. It records what arrives. See --help.
//
// libmosquitto and its socket run in real time: bytes sent over loopback have arrived when send() returns, so the program waits only for the
// thread that connects.
#include "hours_rig.h"
#include "mqtt_bridge.h"

#include "unity.h"

#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define PASS_MS    50U
#define EVENTS_MAX 20000U
#define TRIES_MAX  1000U
#define WHOLE      (-1L)
/// A cut line carries at most this many bytes, about three states.
#define LINE_BYTES 20000U

/// The broker's end of the line.
typedef struct {
    int listener; ///< -1: the network is cut.
    int fd;       ///< -1: no connection.
    uint16_t port;
    long left; ///< Bytes until the line is cut, after which the next count begins; or WHOLE.
    bool mute; ///< Its replies are lost.
    uint8_t in[65536];
    size_t length;
} far_t;

/// The events that have arrived.
typedef struct {
    bool seen[EVENTS_MAX];
    uint64_t newest;
    unsigned arrived; ///< Different events.
    unsigned doubled;
    unsigned disordered; ///< New events after newer ones.
    unsigned states;
    unsigned stops;
    int64_t stop_number; ///< The gateway's number of the newest stop.
    unsigned stop_gaps;
    uint64_t latest_us; ///< Longest time from the gateway's `t_us` to the arrival.
} book_t;

static mqtt_bridge_t bridge;
static mqtt_settings_t settings;
static char folder[64];
static far_t far = {.listener = -1, .fd = -1, .left = WHOLE};
static book_t book;
static int client = -1;
static double hours = 1.0; ///< Duration of the first two trials.
static uint32_t dice = 1;
static uint64_t tries_us[TRIES_MAX]; ///< Times of the bridge's attempts to connect.
static unsigned tries;
static unsigned cuts;

// ---- the broker ---------------------------------------------------------------------------------------------------

static void hang_up(void) {
    if (far.fd >= 0) {
        (void)close(far.fd);
    }
    far.fd = -1;
    far.length = 0;
}

static void cut_network(void) {
    hang_up();
    (void)close(far.listener);
    far.listener = -1;
}

static void restore_network(void) {
    const int one = 1;
    struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons(far.port)};
    socklen_t length = sizeof address;
    far.listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    (void)setsockopt(far.listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    TEST_ASSERT_EQUAL_INT(0, bind(far.listener, (const struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, listen(far.listener, 8));
    TEST_ASSERT_EQUAL_INT(0, getsockname(far.listener, (struct sockaddr *)&address, &length));
    far.port = ntohs(address.sin_port);
}

static uint64_t number_behind(const char *text, const char *name) {
    const char *at = strstr(text, name);
    TEST_ASSERT_NOT_NULL_MESSAGE(at, text);
    return strtoull(at + strlen(name), NULL, 10);
}

/// Records an event that arrived; `id` is boot and number.
static void write_down(const char *event) {
    const char *id = strstr(event, "\"id\":\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(id, event);
    const uint64_t number = number_behind(id + 6, "-");
    const uint64_t late_us = daemon_rig.now_us - number_behind(event, "\"t_us\":");
    TEST_ASSERT_LESS_THAN_UINT64(EVENTS_MAX, number);
    book.latest_us = (late_us > book.latest_us) ? late_us : book.latest_us;
    if (book.seen[number]) {
        book.doubled++;
        return;
    }
    book.seen[number] = true;
    book.arrived++;
    book.disordered += (number < book.newest) ? 1U : 0U;
    book.newest = (number > book.newest) ? number : book.newest;
    if (strstr(event, "\"event\":\"stop\"") != NULL) {
        const int64_t stop = (int64_t)number_behind(event, "\"number\":");
        book.stop_gaps += (stop != book.stop_number + 1) ? 1U : 0U;
        book.stop_number = stop;
        book.stops++;
    }
}

static void answer(const void *bytes, size_t length) {
    if (!far.mute) {
        (void)send(far.fd, bytes, length, MSG_NOSIGNAL);
    }
}

static void take_publish(uint8_t head, const uint8_t *body, size_t length) {
    static char payload[MQTT_SPOOL_EVENT_MAX + 1U];
    static const char events[] = "iwheel/w1/event/";
    static const char state[] = "iwheel/w1/state";
    const size_t topic = (size_t)body[0] << 8U | body[1];
    const bool confirms = (head & 0x06U) != 0U;
    const size_t skip = 2U + topic + (confirms ? 2U : 0U);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(length, skip);
    if (topic > sizeof events && memcmp(body + 2, events, sizeof events - 1U) == 0) {
        TEST_ASSERT_LESS_THAN_size_t(sizeof payload, length - skip);
        memcpy(payload, body + skip, length - skip);
        payload[length - skip] = '\0';
        write_down(payload);
    }
    book.states += (topic == sizeof state - 1U && memcmp(body + 2, state, topic) == 0) ? 1U : 0U;
    if (confirms) {
        const uint8_t confirmation[] = {0x40, 2, body[2U + topic], body[3U + topic]};
        answer(confirmation, sizeof confirmation);
    }
}

static void take_packet(uint8_t head, const uint8_t *body, size_t length) {
    static const uint8_t welcome[] = {0x20, 2, 0, 0};
    static const uint8_t pong[] = {0xD0, 0};
    const uint8_t subscribed[] = {0x90, 3, body[0], body[1], 0};
    switch (head >> 4U) {
    case 1:
        answer(welcome, sizeof welcome);
        break;
    case 3:
        take_publish(head, body, length);
        break;
    case 8:
        answer(subscribed, sizeof subscribed);
        break;
    case 12:
        answer(pong, sizeof pong);
        break;
    default:
        break;
    }
}

/// Handles one received packet. Returns its length with its head; 0 if it is not complete yet.
static size_t take_one(const uint8_t *bytes, size_t length) {
    size_t body = 0;
    for (size_t i = 1; i < 5U && i < length; i++) {
        body |= (size_t)(bytes[i] & 0x7FU) << (7U * (i - 1U));
        if ((bytes[i] & 0x80U) == 0U) {
            if (i + 1U + body > length) {
                return 0;
            }
            take_packet(bytes[0], bytes + i + 1U, body);
            return i + 1U + body;
        }
    }
    return 0;
}

static unsigned roll(unsigned sides) {
    dice = dice * 1664525U + 1013904223U;
    return (dice >> 16) % sides;
}

static void take_all(void) {
    size_t used = 0;
    for (size_t one = 1; one > 0U && used < far.length; used += one) {
        one = take_one(far.in + used, far.length - used);
    }
    memmove(far.in, far.in + used, far.length - used);
    far.length -= used;
}

static void serve(void) {
    if (far.fd < 0 && far.listener >= 0) {
        far.fd = accept4(far.listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    }
    size_t space = sizeof far.in - far.length;
    space = (far.left != WHOLE && (size_t)far.left < space) ? (size_t)far.left : space;
    const ssize_t got = (far.fd >= 0 && space > 0U) ? recv(far.fd, far.in + far.length, space, 0) : -1;
    if (far.fd >= 0 && got == 0 && space > 0U) {
        hang_up();
    }
    far.length += (got > 0) ? (size_t)got : 0U;
    far.left -= (got > 0 && far.left != WHOLE) ? (long)got : 0L;
    far.mute = far.left == 0 && roll(2) == 0;
    take_all();
    far.mute = false;
    if (far.left == 0) {
        hang_up();
        cuts++;
        far.left = 1L + (long)roll(LINE_BYTES);
    }
}

// ---- time ---------------------------------------------------------------------------------------------------------

static void step(void) {
    const bool tries_now = bridge.broker.state == MQTT_AWAY && daemon_rig.now_us >= bridge.broker.try_us;
    TEST_ASSERT_EQUAL_INT(0, mqtt_bridge_step(&bridge, daemon_rig.now_us));
    if (tries_now && tries < TRIES_MAX) {
        tries_us[tries] = daemon_rig.now_us;
        tries++;
    }
    if (bridge.broker.state == MQTT_CONNECTING) {
        struct pollfd thread = {.fd = bridge.broker.caller.wake, .events = POLLIN};
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, poll(&thread, 1, 5000), "the thread that connects has ended");
    }
}

static void pass(unsigned for_ms) {
    for (unsigned ms = 0; ms < for_ms; ms += PASS_MS) {
        step();
        serve();
        hours_run_gateway(PASS_MS);
    }
}

/// Arms, drives, stops by the button and resets: about eight events in three seconds.
static void stop_once(void) {
    daemon_rig_arm(client);
    daemon_rig_drive(client, 100, 100, 60);
    daemon_rig.estop = 1;
    pass(2500);
    daemon_rig.estop = 0;
    pass(300);
    for (unsigned i = 0; i < 20U && daemon_rig_state() == IW_STATE_LATCHED; i++) {
        (void)daemon_rig_ask(client, "{\"cmd\":\"reset\"}");
        pass(200);
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, daemon_rig_state());
}

static unsigned hours_ms(void) {
    return (unsigned)(hours * 3600e3);
}

static void stop_all_the_time(unsigned for_ms, unsigned every_ms) {
    const iw_time_us_t end_us = daemon_rig.now_us + MS(for_ms);
    while (daemon_rig.now_us < end_us) {
        const iw_time_us_t next_us = daemon_rig.now_us + MS(every_ms);
        stop_once();
        pass((daemon_rig.now_us < next_us) ? (unsigned)((next_us - daemon_rig.now_us) / IW_US_PER_MS) : 0U);
    }
}

/// Waits until all waiting events have been confirmed.
static void drain(void) {
    for (unsigned ms = 0; ms < 120000U && bridge.spool.waiting > 0U; ms += PASS_MS) {
        pass(PASS_MS);
    }
    TEST_ASSERT_EQUAL_size_t_MESSAGE(0, bridge.spool.waiting, "confirmed");
}

// ---- a trial ------------------------------------------------------------------------------------------------------

void setUp(void) {
    (void)snprintf(folder, sizeof folder, "%s", "/tmp/iwheel-hours-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    book = (book_t){.arrived = 0};
    tries = 0;
    cuts = 0;
    far.left = WHOLE;
    daemon_rig_begin();
    client = daemon_rig_connect();
    restore_network();
}

void tearDown(void) {
    char path[96];
    (void)snprintf(path, sizeof path, "%s/" MQTT_SPOOL_FILE, folder);
    TEST_ASSERT_TRUE(mqtt_bridge_close(&bridge));
    cut_network();
    (void)close(client);
    daemon_rig_end();
    (void)unlink(path);
    (void)rmdir(folder);
}

static void begin(unsigned spool_kB, unsigned every_ms) {
    settings = mqtt_settings_standard;
    (void)snprintf(settings.machine.id, sizeof settings.machine.id, "w1");
    (void)snprintf(settings.spool.directory, sizeof settings.spool.directory, "%s", folder);
    settings.broker.port = far.port;
    settings.spool.max_kB = spool_kB;
    settings.state.every_ms = every_ms;
    TEST_ASSERT_EQUAL_INT(0, mqtt_bridge_open(&bridge, &settings));
    pass(2000);
    TEST_ASSERT_EQUAL_INT(MQTT_UP, bridge.broker.state);
}

/// Prints the line that test/mqtt/figures.py writes into docs/user/mqtt.md.
static void print_figures(const char *fault, unsigned often) {
    (void)printf("figures: %s | %u | %llu | %u | %u | %.1f s\n", fault, often, (unsigned long long)bridge.spool.last,
                 book.arrived, book.doubled, (double)book.latest_us / 1e6);
    (void)fflush(stdout);
}

static void assert_each_once_in_order(void) {
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(bridge.spool.last, book.arrived, "each event");
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(0, bridge.spool.dropped, "none dropped");
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, book.disordered, "in order");
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, book.stop_gaps, "each stop");
}

static void test_network_cut_for_an_hour_each_event_once_in_order(void) {
    begin(4096, 5000);
    stop_all_the_time(60000, 10000);
    cut_network();
    tries = 0;
    const iw_time_us_t cut_us = daemon_rig.now_us;
    stop_all_the_time(hours_ms(), 10000);
    TEST_ASSERT_GREATER_THAN_UINT64(MS(hours_ms()), daemon_rig.now_us - cut_us + 1U);
    TEST_ASSERT_GREATER_THAN_size_t_MESSAGE((size_t)(2000.0 * hours), bridge.spool.waiting,
                                            "events of 360 stops an hour wait");
    const unsigned tried = tries;
    restore_network();
    drain();
    // The bridge retries forever, soon at first, then every 15 s to 30 s, and is connected within 30 s.
    TEST_ASSERT_LESS_THAN_UINT64(1500000U, tries_us[0] - cut_us);
    for (unsigned i = 6; i < tries; i++) {
        const uint64_t gap_us = tries_us[i] - tries_us[i - 1U];
        TEST_ASSERT_TRUE_MESSAGE(gap_us >= 14500000U && gap_us <= 30500000U, "15 s to 30 s");
    }
    TEST_ASSERT_EQUAL_UINT(tried + 1U, tries);
    assert_each_once_in_order();
    (void)printf("        tried %u times in that hour; %u stops among the events\n", tried, book.stops);
    print_figures("network cut for an hour (virtual time), 360 stops meanwhile", 1);
}

static void test_network_cut_for_an_hour_full_spool_counts_the_dropped(void) {
    begin((unsigned)(256.0 * hours), 5000);
    cut_network();
    stop_all_the_time(hours_ms(), 10000);
    restore_network();
    drain();
    TEST_ASSERT_GREATER_THAN_UINT64(0, bridge.spool.dropped);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(bridge.spool.last, book.arrived + bridge.spool.dropped, "arrived or counted");
    for (uint64_t i = bridge.spool.last; i > bridge.spool.last - book.arrived + 1U; i--) {
        TEST_ASSERT_TRUE_MESSAGE(book.seen[i], "the newest ones, without a gap");
    }
    TEST_ASSERT_EQUAL_UINT(0, book.disordered);
    char fault[96];
    (void)snprintf(fault, sizeof fault, "the same with `max_kB = 256`: %llu dropped and counted, the oldest",
                   (unsigned long long)bridge.spool.dropped);
    print_figures(fault, 1);
}

static void test_network_cut_behind_any_byte_each_event_once_in_order(void) {
    begin(1024, 5000);
    far.left = 1;
    stop_all_the_time(hours_ms() / 3U, 10000);
    far.left = WHOLE;
    drain();
    TEST_ASSERT_GREATER_THAN_UINT((unsigned)(100.0 * hours), cuts);
    TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(0, book.doubled, "the trial causes doubles");
    assert_each_once_in_order();
    print_figures("connection cut behind any byte, in 20 minutes of virtual time", cuts);
}

static void test_state_with_uneven_wake_ups_comes_at_configured_rate(void) {
    static const unsigned every_ms[] = {100, 500, 1000, 5000};
    for (size_t i = 0; i < sizeof every_ms / sizeof every_ms[0]; i++) {
        const unsigned wanted = 60000U / every_ms[i];
        begin(1024, every_ms[i]);
        book.states = 0;
        for (unsigned ms = 0; ms < 60000U; ms += 150U) {
            pass(50);
            hours_run_gateway(40);
            pass(50);
            hours_run_gateway(10);
        }
        // TCP needs real time, in which that minute was only a moment.
        for (unsigned tries_left = 100; tries_left > 0U && book.states < wanted; tries_left--) {
            struct pollfd more = {.fd = far.fd, .events = POLLIN};
            (void)poll(&more, 1, 10);
            serve();
        }
        TEST_ASSERT_UINT_WITHIN(1U + wanted / 50U, wanted, book.states);
        TEST_ASSERT_TRUE(mqtt_bridge_close(&bridge));
        serve();
    }
    begin(1024, 5000); // tearDown needs an open bridge.
}

int main(int count, char **arguments) {
    if (count > 1 && strcmp(arguments[1], "--help") == 0) {
        (void)puts(
            "usage: mqtt_hours [HOURS]\n\nThe MQTT bridge and the gateway in virtual time, an hour with the network "
            "cut, "
            "an hour with it cut and too small a\nspool, and with the line cut behind any byte, again and again. Each "
            "stop and "
            "fault must arrive once, in order.");
        return 0;
    }
    hours = (count > 1) ? strtod(arguments[1], NULL) : hours;
    UNITY_BEGIN();
    RUN_TEST(test_state_with_uneven_wake_ups_comes_at_configured_rate);
    RUN_TEST(test_network_cut_for_an_hour_each_event_once_in_order);
    RUN_TEST(test_network_cut_for_an_hour_full_spool_counts_the_dropped);
    RUN_TEST(test_network_cut_behind_any_byte_each_event_once_in_order);
    return UNITY_END();
}
