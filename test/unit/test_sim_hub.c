// SPDX-License-Identifier: MIT
// The running simulator as a child process, through its sockets: local bus, e-stop button, control. The test needs a
// second.
#include "simulator.h"

#include "folder.h"
#include "unit.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

#define WITHIN_MS 3000

static sim_options_t options;
static pid_t child;

static void set_options(void) {
    memset(&options, 0, sizeof options);
    (void)snprintf(options.can_path, sizeof options.can_path, "%s/bus", folder);
    (void)snprintf(options.estop_path, sizeof options.estop_path, "%s/estop", folder);
    (void)snprintf(options.control_path, sizeof options.control_path, "%s/control", folder);
    options.seed = 1U;
    options.age_us = 120000000U;
    options.quiet = true;
}

static int run_simulator(void) {
    static sim_simulator_t simulator;
    int const result = sim_simulator_open(&simulator, &options);
    if (result >= 0) {
        return result;
    }
    sim_simulator_run(&simulator);
    sim_simulator_close(&simulator);
    return EX_OK;
}

static int open_socket(const char *path, int type) {
    for (unsigned tries = 0U; tries < WITHIN_MS; tries++) {
        int const fd = sim_listener_connect(path, type);
        if (fd >= 0) {
            return fd;
        }
        (void)poll(NULL, 0U, 1);
    }
    TEST_FAIL_MESSAGE("there is no listener");
    return -1;
}

static void start(void) {
    child = fork();
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, child);
    if (child == 0) {
        _exit(run_simulator());
    }
    (void)close(open_socket(options.control_path, SOCK_STREAM));
}

static int end(int signal_number) {
    int status = 0;
    (void)kill(child, signal_number);
    TEST_ASSERT_EQUAL_INT(child, waitpid(child, &status, 0));
    child = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

void setUp(void) {
    folder_make();
    set_options();
    child = 0;
}

void tearDown(void) {
    if (child > 0) {
        (void)end(SIGKILL);
    }
    folder_remove();
}

static size_t receive(int fd, void *out, size_t size) {
    struct pollfd wait_for = {.fd = fd, .events = POLLIN};
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, poll(&wait_for, 1U, WITHIN_MS), "nothing came");
    ssize_t const length = recv(fd, out, size, 0);
    return (length > 0) ? (size_t)length : 0U;
}

static const char *execute(const char *command) {
    static char answer[SIM_ANSWER_BYTES];
    int const fd = open_socket(options.control_path, SOCK_STREAM);
    (void)send(fd, command, strlen(command), MSG_NOSIGNAL);
    (void)send(fd, "\n", 1U, MSG_NOSIGNAL);
    answer[receive(fd, answer, sizeof answer - 1U)] = '\0';
    (void)close(fd);
    return answer;
}

/// Waits for a frame with this id word. Returns its echo mark, or -1 if the connection is closed.
static int wait_for_frame(int fd, canid_t id, struct can_frame *out_frame) {
    for (unsigned i = 0U; i < 10000U; i++) {
        size_t const length = receive(fd, out_frame, sizeof *out_frame);
        if (length == 0U) {
            return -1;
        }
        TEST_ASSERT_EQUAL_size_t(sizeof *out_frame, length);
        if (out_frame->can_id == id) {
            return out_frame->__res0;
        }
    }
    TEST_FAIL_MESSAGE("the frame did not come");
    return -1;
}

static void send_setpoint(int fd) {
    struct can_frame const frame = {.can_id = 266U, .can_dlc = 5U, .data = {1U, 0U, 100U, 7U, 208U}};
    TEST_ASSERT_EQUAL_INT(sizeof frame, send(fd, &frame, sizeof frame, MSG_NOSIGNAL));
}

TEST(test_hub_frame_reaches_all_and_is_an_echo_for_the_sender) {
    struct can_frame frame;
    start();
    int const sender = open_socket(options.can_path, SOCK_SEQPACKET);
    int const other = open_socket(options.can_path, SOCK_SEQPACKET);
    (void)wait_for_frame(other, 256U, &frame);
    send_setpoint(sender);
    TEST_ASSERT_EQUAL_INT(1, wait_for_frame(sender, 266U, &frame));
    TEST_ASSERT_EQUAL_INT(0, wait_for_frame(other, 266U, &frame));
    TEST_ASSERT_EQUAL_UINT8(100U, frame.data[2]);
    (void)close(sender);
    (void)close(other);
}

TEST(test_hub_stalled_reader_loses_frames_and_others_none) {
    struct can_frame frame;
    start();
    int const stalled = open_socket(options.can_path, SOCK_SEQPACKET);
    int const reader = open_socket(options.can_path, SOCK_SEQPACKET);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("babble 7FE 200 on"));
    for (unsigned i = 0U; i < 1000U; i++) {
        (void)wait_for_frame(reader, 0x7FEU, &frame);
    }
    TEST_ASSERT_NOT_NULL(strstr(execute("status"), "\"clients\":2"));
    TEST_ASSERT_NULL(strstr(execute("status"), "\"lost_by_readers\":0"));
    (void)close(stalled);
    (void)close(reader);
}

TEST(test_hub_malformed_messages_are_counted_only) {
    struct can_frame frame;
    unsigned char junk[72] = {0x0AU, 0x01U};
    start();
    int const fd = open_socket(options.can_path, SOCK_SEQPACKET);
    (void)send(fd, junk, 72U, MSG_NOSIGNAL);
    (void)send(fd, junk, 3U, MSG_NOSIGNAL);
    junk[4] = 9U;
    (void)send(fd, junk, sizeof(struct can_frame), MSG_NOSIGNAL);
    send_setpoint(fd);
    TEST_ASSERT_EQUAL_INT(1, wait_for_frame(fd, 266U, &frame));
    TEST_ASSERT_NOT_NULL(strstr(execute("status"), "\"malformed\":3"));
    (void)close(fd);
}

TEST(test_hub_sends_bus_off_and_restart_and_nothing_between) {
    struct can_frame frame;
    start();
    int const fd = open_socket(options.can_path, SOCK_SEQPACKET);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("busoff on"));
    (void)wait_for_frame(fd, CAN_ERR_FLAG | CAN_ERR_BUSOFF, &frame);
    (void)poll(NULL, 0U, 50);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("busoff off"));
    TEST_ASSERT_EQUAL_size_t(sizeof frame, receive(fd, &frame, sizeof frame));
    TEST_ASSERT_EQUAL_HEX32(CAN_ERR_FLAG | CAN_ERR_RESTARTED, frame.can_id);
    (void)wait_for_frame(fd, 256U, &frame);
    (void)close(fd);
}

TEST(test_hub_late_client_receives_bus_off) {
    struct can_frame frame;
    start();
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("busoff on"));
    int const fd = open_socket(options.can_path, SOCK_SEQPACKET);
    TEST_ASSERT_EQUAL_size_t(sizeof frame, receive(fd, &frame, sizeof frame));
    TEST_ASSERT_EQUAL_HEX32(CAN_ERR_FLAG | CAN_ERR_BUSOFF, frame.can_id);
    (void)close(fd);
}

TEST(test_hub_error_frame_of_a_client_reaches_the_others_only) {
    struct can_frame const forged = {.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF, .can_dlc = 8U};
    struct can_frame frame;
    start();
    int const liar = open_socket(options.can_path, SOCK_SEQPACKET);
    int const other = open_socket(options.can_path, SOCK_SEQPACKET);
    (void)wait_for_frame(other, 256U, &frame);
    (void)send(liar, &forged, sizeof forged, MSG_NOSIGNAL);
    TEST_ASSERT_EQUAL_INT(2, wait_for_frame(other, forged.can_id, &frame)); // The frame has the mark of a client.
    send_setpoint(liar);
    for (unsigned i = 0U; i < 100U; i++) {
        (void)receive(liar, &frame, sizeof frame);
        TEST_ASSERT_NOT_EQUAL_HEX32(forged.can_id, frame.can_id);
    }
    (void)close(liar);
    (void)close(other);
}

TEST(test_hub_bus_down_closes_connections_until_it_is_up) {
    struct can_frame frame;
    start();
    int fd = open_socket(options.can_path, SOCK_SEQPACKET);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("bus down"));
    TEST_ASSERT_EQUAL_INT(-1, wait_for_frame(fd, 0x7FFU, &frame));
    (void)close(fd);
    fd = open_socket(options.can_path, SOCK_SEQPACKET);
    TEST_ASSERT_EQUAL_size_t(0U, receive(fd, &frame, sizeof frame));
    (void)close(fd);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("bus up"));
    fd = open_socket(options.can_path, SOCK_SEQPACKET);
    (void)wait_for_frame(fd, 256U, &frame);
    (void)close(fd);
}

TEST(test_button_sends_its_state_on_connect_and_at_every_change) {
    char state = '?';
    start();
    int const fd = open_socket(options.estop_path, SOCK_STREAM);
    TEST_ASSERT_EQUAL_size_t(1U, receive(fd, &state, 1U));
    TEST_ASSERT_EQUAL_CHAR('0', state);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("estop pulse 5"));
    TEST_ASSERT_EQUAL_size_t(1U, receive(fd, &state, 1U));
    TEST_ASSERT_EQUAL_CHAR('1', state);
    TEST_ASSERT_EQUAL_size_t(1U, receive(fd, &state, 1U));
    TEST_ASSERT_EQUAL_CHAR('0', state);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("estop press"));
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("estop press"));
    TEST_ASSERT_EQUAL_size_t(1U, receive(fd, &state, 1U));
    TEST_ASSERT_EQUAL_INT(-1, recv(fd, &state, 1U, MSG_DONTWAIT));
    TEST_ASSERT_EQUAL_STRING_LEN("error ", execute("estop pulse 5"), 6);
    int const late = open_socket(options.estop_path, SOCK_STREAM);
    TEST_ASSERT_EQUAL_size_t(1U, receive(late, &state, 1U));
    TEST_ASSERT_EQUAL_CHAR('1', state);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("estop unplug"));
    TEST_ASSERT_EQUAL_size_t(0U, receive(late, &state, 1U));
    (void)close(fd);
    (void)close(late);
}

TEST(test_control_reads_single_bytes_and_several_lines) {
    char answer[64];
    start();
    int const fd = open_socket(options.control_path, SOCK_STREAM);
    const char *const text = "power on\n";
    for (size_t i = 0U; i < strlen(text); i++) {
        TEST_ASSERT_EQUAL_INT(1, send(fd, &text[i], 1U, MSG_NOSIGNAL));
    }
    TEST_ASSERT_EQUAL_size_t(3U, receive(fd, answer, 3U));
    TEST_ASSERT_EQUAL_STRING_LEN("ok\n", answer, 3);
    (void)send(fd, "ack on\nack on\n", 14U, MSG_NOSIGNAL);
    TEST_ASSERT_EQUAL_size_t(3U, receive(fd, answer, 3U));
    TEST_ASSERT_EQUAL_size_t(3U, receive(fd, answer, 3U));
    (void)close(fd);
}

TEST(test_control_line_without_end_is_refused_and_closed) {
    char flood[1000];
    char answer[128] = "";
    memset(flood, 'x', sizeof flood);
    start();
    int const fd = open_socket(options.control_path, SOCK_STREAM);
    (void)send(fd, flood, sizeof flood, MSG_NOSIGNAL);
    (void)receive(fd, answer, sizeof answer - 1U);
    TEST_ASSERT_EQUAL_STRING_LEN("error the line is longer", answer, 24);
    (void)close(fd);
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("power on"));
}

TEST(test_control_nul_in_a_line_is_refused) {
    char answer[128] = "";
    start();
    int const fd = open_socket(options.control_path, SOCK_STREAM);
    (void)send(fd, "power off\0x\n", 12U, MSG_NOSIGNAL);
    (void)receive(fd, answer, sizeof answer - 1U);
    TEST_ASSERT_EQUAL_STRING_LEN("error the line contains", answer, 23);
    (void)close(fd);
}

TEST(test_simulator_ends_cleanly_and_removes_its_sockets) {
    static const int signals[] = {SIGTERM, SIGINT};
    for (size_t i = 0U; i < 2U; i++) {
        start();
        TEST_ASSERT_EQUAL_INT(EX_OK, end(signals[i]));
        TEST_ASSERT_NOT_EQUAL(0, access(options.can_path, F_OK));
        TEST_ASSERT_NOT_EQUAL(0, access(options.estop_path, F_OK));
        TEST_ASSERT_NOT_EQUAL(0, access(options.control_path, F_OK));
    }
}

TEST(test_simulator_replaces_sockets_of_a_killed_one) {
    start();
    TEST_ASSERT_EQUAL_INT(-SIGKILL, end(SIGKILL));
    TEST_ASSERT_EQUAL_INT(0, access(options.can_path, F_OK));
    start();
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("power on"));
}

TEST(test_simulator_second_on_the_same_bus_exits_with_an_error) {
    start();
    (void)freopen("/dev/null", "w", stderr);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, run_simulator());
    TEST_ASSERT_EQUAL_STRING("ok\n", execute("power on"));
    (void)close(open_socket(options.can_path, SOCK_SEQPACKET));
}

TEST(test_simulator_refuses_to_replace_a_file_that_is_no_socket) {
    FILE *const file = fopen(options.can_path, "w");
    TEST_ASSERT_NOT_NULL(file);
    (void)fclose(file);
    struct stat there;
    (void)freopen("/dev/null", "w", stderr);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, run_simulator());
    TEST_ASSERT_EQUAL_INT(0, lstat(options.can_path, &there));
    TEST_ASSERT_TRUE(S_ISREG(there.st_mode));
    TEST_ASSERT_NOT_EQUAL(0, access(options.control_path, F_OK));
}
