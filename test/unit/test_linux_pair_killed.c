// SPDX-License-Identifier: MIT
// If a process is killed while it sends pairs, no left setpoint stays without the right one: the kernel handles no
// signal between two frames of one call.
#include "socketcan_socket.h"

#include "unit.h"

#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define KILLS 300U
#define BURST 60U   // Number of pairs that fit into a socket of any size.
#define US    1000L // ns

static const iw_can_frame_t pair[IW_SIDES] = {{.id = IW_ID_LEFT_SETPOINT, .dlc = 5},
                                              {.id = IW_ID_RIGHT_SETPOINT, .dlc = 5}};

void setUp(void);
void tearDown(void);

/// Sends until it is killed. After each burst it waits until all frames were received, so that no pair is cut for lack
/// of buffer space.
static _Noreturn void send_pairs(int fd) {
    static iwl_socketcan_socket_t bus;
    char go;
    iwl_socketcan_socket_use(&bus, fd, true);
    do {
        for (unsigned i = 0; i < BURST; i++) {
            if (iwl_socketcan_socket_send(&bus, pair, IW_SIDES) != (int)IW_SIDES) {
                _exit(1);
            }
        }
    } while (recv(fd, &go, sizeof go, 0) == 1);
    _exit(1);
}

/// Receives until the other end is closed, and counts the frames of each side.
static void count_frames(int fd, unsigned count[IW_SIDES]) {
    struct can_frame frame;
    for (unsigned frames = 1; recv(fd, &frame, sizeof frame, 0) == (ssize_t)sizeof frame; frames++) {
        count[(frame.can_id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : IW_RIGHT]++;
        if (frames % (IW_SIDES * BURST) == 0U) {
            (void)send(fd, "", 1, MSG_NOSIGNAL);
        }
    }
}

static void live_and_die(long life_ns, unsigned count[IW_SIDES]) {
    int end[2];
    int status = 0;
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, end));
    const pid_t child = fork();
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, child);
    if (child == 0) {
        send_pairs(end[1]);
    }
    (void)close(end[1]); // The child has the last copy.
    const pid_t killer = fork();
    if (killer == 0) {
        const struct timespec life = {.tv_nsec = life_ns};
        (void)nanosleep(&life, NULL);
        (void)kill(child, SIGKILL);
        _exit(0);
    }
    count_frames(end[0], count);
    (void)close(end[0]);
    TEST_ASSERT_EQUAL_INT(child, waitpid(child, &status, 0));
    TEST_ASSERT_EQUAL_INT(killer, waitpid(killer, NULL, 0));
    TEST_ASSERT_TRUE_MESSAGE(WIFSIGNALED(status), "it ended on its own");
}

TEST(test_pair_of_a_killed_process_is_sent_completely_or_not) {
    unsigned killed = 0;
    for (unsigned i = 0; i < KILLS; i++) {
        unsigned count[IW_SIDES] = {0, 0};
        live_and_die((300L + (long)(i * 7U % 500U)) * US, count);
        killed += (count[IW_LEFT] % BURST != 0U) ? 1U : 0U;
        TEST_ASSERT_EQUAL_UINT_MESSAGE(count[IW_LEFT], count[IW_RIGHT], "a left setpoint was left alone");
    }
    TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(0, killed, "hardly any was killed while it was sending");
}
