// SPDX-License-Identifier: MIT
// libiwheel-client: optional members of a request, and stops through either socket of a gateway.
#include "iwheel_client/client.h"

#include "folder.h"
#include "unit.h"

#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#define HELLO "{\"event\":\"hello\",\"name\":\"iwheel-gateway\",\"api\":1,\"state\":\"listening\",\"client\":7}\n"
#define SHORT 20   ///< ms; no answer comes in this time.
#define LONG  2000 ///< ms; what is expected comes earlier, but the machine may be busy.

static iwc_t *gateway;
static int server;
static char drive_path[64];
static char watch_path[64];

static void send_text(const char *text) {
    TEST_ASSERT_EQUAL_INT((int)strlen(text), (int)send(server, text, strlen(text), MSG_NOSIGNAL));
}

/// Returns the bytes that were received since the last call.
static const char *receive(void) {
    static char received[4096];
    const ssize_t length = recv(server, received, sizeof received - 1U, MSG_DONTWAIT);
    received[(length > 0) ? length : 0] = '\0';
    return received;
}

static void adopt(void) {
    int pair[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
    server = pair[1];
    send_text(HELLO);
    TEST_ASSERT_EQUAL(IWC_OK, iwc_adopt(gateway, pair[0], LONG));
}

void setUp(void) {
    gateway = iwc_new();
    server = -1;
    folder_make();
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("watch"), 0755));
    (void)snprintf(drive_path, sizeof drive_path, "%s/gateway.sock", folder);
    (void)snprintf(watch_path, sizeof watch_path, "%s/watch/gateway.sock", folder);
}

void tearDown(void) {
    iwc_free(gateway);
    if (server >= 0) {
        (void)close(server);
    }
    folder_remove();
}

// A place for stops ---------------------------------------------------------------------------------------------------

TEST(test_adopted_for_stop_needs_no_greeting) {
    int pair[2];
    iwc_message_t message;
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
    server = pair[1];
    TEST_ASSERT_EQUAL(IWC_OK, iwc_adopt_for_stop(gateway, pair[0]));
    send_text("{\"id\":2,\"ok\":true}\n" HELLO);
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop(gateway, LONG));
    TEST_ASSERT_EQUAL_STRING("{\"id\":2,\"cmd\":\"stop\"}\n", receive());
    TEST_ASSERT_EQUAL(IWC_OK, iwc_next(gateway, LONG, &message));
    TEST_ASSERT_TRUE(iwc_is(&message, "event", "hello"));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_adopt_for_stop(gateway, -1));
}

// Optional members of a request ---------------------------------------------------------------------------------------

TEST(test_ask_helpers_send_time_stop_and_key) {
    adopt();
    const iwc_drive_t drive = {.left_mm_s = 1, .right_mm_s = 2};
    const iwc_twist_t twist = {.v_mm_s = 5, .yaw_mrad_s = -6};
    const iwc_arm_t arm = {.name = "a", .t_us = {true, 9000000000000}};
    const iwc_reset_t reset = {.stop = {true, 17}, .t_us = {true, 5}};
    (void)iwc_arm_as(gateway, &arm, 0, NULL, NULL);
    (void)iwc_drive_as(gateway, &drive, "00ff", 0, NULL);
    (void)iwc_twist_as(gateway, &twist, "00ff", 0, NULL);
    (void)iwc_reset_as(gateway, &reset, 0);
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_drive_as(gateway, &drive, "0123456789abcdef0123456789abcdef0", 0, NULL));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_twist_as(gateway, &twist, "a\nb", 0, NULL));
    TEST_ASSERT_EQUAL_STRING("{\"id\":2,\"cmd\":\"arm\",\"name\":\"a\",\"t_us\":9000000000000}\n"
                             "{\"id\":3,\"cmd\":\"drive\",\"key\":\"00ff\",\"left_mm_s\":1,\"right_mm_s\":2}\n"
                             "{\"id\":5,\"cmd\":\"twist\",\"key\":\"00ff\",\"v_mm_s\":5,\"yaw_mrad_s\":-6}\n"
                             "{\"id\":8,\"cmd\":\"reset\",\"stop\":17,\"t_us\":5}\n",
                             receive());
}

/// The estop with this reason is sent with `sent` behind its command.
static void expect_estop(int id, const char *reason, const char *sent) {
    char text[512];
    (void)snprintf(text, sizeof text, "{\"id\":%d,\"ok\":true,\"state\":\"latched\"}\n", id);
    send_text(text);
    TEST_ASSERT_EQUAL(IWC_OK, iwc_estop(gateway, reason, LONG));
    (void)snprintf(text, sizeof text, "{\"id\":%d,\"cmd\":\"estop\"%s}\n", id, sent);
    TEST_ASSERT_EQUAL_STRING(text, receive());
}

TEST(test_stop_never_refused_by_the_client_for_its_reason) {
    char reason[5001];
    char sent[300];
    adopt();
    expect_estop(2, NULL, "");
    expect_estop(4, "", "");
    expect_estop(6, "Traceback:\n\tline", ",\"reason\":\"Traceback:  line\"");
    expect_estop(8, "\x7f\n", "");
    expect_estop(10, "T\xC3\xBCr\xE2\x80\x8E \"auf\"", ",\"reason\":\"T\xC3\xBCr    \\\"auf\\\"\"");
    expect_estop(12, "T\xFCr", ",\"reason\":\"T r\"");
    memset(reason, 'x', sizeof reason);
    reason[5000] = '\0';
    (void)snprintf(sent, sizeof sent, ",\"reason\":\"%.200s\"", reason);
    expect_estop(14, reason, sent);
    memcpy(&reason[199], "\xE2\x82\xAC", 3); // The limit is inside of a character.
    (void)snprintf(sent, sizeof sent, ",\"reason\":\"%.199s \"", reason);
    expect_estop(16, reason, sent);
}

TEST(test_ask_arm_returns_the_key_of_the_lease) {
    adopt();
    char key[IWC_KEY_SIZE] = "before";
    send_text("{\"id\":2,\"ok\":true,\"lease_ms\":200,\"key\":\"0123456789abcdef0123456789abcdef\"}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_arm_as(gateway, &(iwc_arm_t){.takeover = true}, LONG, NULL, key));
    TEST_ASSERT_EQUAL_STRING("0123456789abcdef0123456789abcdef", key);
    send_text("{\"id\":4,\"ok\":true,\"lease_ms\":200}\n"); // The reply of a microcontroller has no key.
    TEST_ASSERT_EQUAL(IWC_OK, iwc_arm_as(gateway, &(iwc_arm_t){.takeover = true}, LONG, NULL, key));
    TEST_ASSERT_EQUAL_STRING("", key);
}

TEST(test_reason_without_connection_is_not_empty) {
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_CLOSED), iwc_reason(gateway));
    TEST_ASSERT_GREATER_THAN(3, strlen(iwc_reason(NULL)));
}

// Either socket -------------------------------------------------------------------------------------------------------

/// Starts a process of a gateway. It answers each connection to this socket with `reply` after the first line, counts
/// these lines in `lines`, if it is not NULL, and then continues the process `sleeper`, if it is not 0.
static pid_t serve_as(const char *path, const char *reply, unsigned *lines, pid_t sleeper) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, listen(fd, 8));
    int ready[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ready));
    const pid_t child = fork();
    if (child == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL); // Also one that is stopped ends with a failed test.
        (void)close(ready[0]);
        (void)close(ready[1]);
        for (;;) {
            char line[512];
            const int one = accept(fd, NULL, NULL);
            if (recv(one, line, sizeof line, 0) > 0) {
                *((lines != NULL) ? lines : &(unsigned){0}) += 1U;
                (void)send(one, reply, strlen(reply), MSG_NOSIGNAL); // The client may have gone.
                (void)((sleeper != 0) ? kill(sleeper, SIGCONT) : 0);
            }
            (void)close(one);
        }
    }
    (void)close(fd);
    (void)close(ready[1]);
    (void)!read(ready[0], &(char){0}, 1); // It can be stopped as soon as its end of the pipe is closed.
    (void)close(ready[0]);
    return child;
}

static pid_t serve(const char *path, const char *reply) {
    return serve_as(path, reply, NULL, 0);
}

static void end(pid_t child) {
    (void)kill(child, SIGKILL);
    (void)waitpid(child, NULL, 0);
}

/// Returns the replies to all requests with which a client can begin: it repeats them if the machine is busy.
static const char *replies(const char *state) {
    static char text[4096];
    size_t length = 0;
    for (int id = 2; length + 64U < sizeof text; id += 2) {
        length += (size_t)snprintf(text + length, sizeof text - length, "{\"id\":%d,\"ok\":true,\"state\":\"%s\"}\n",
                                   id, state);
    }
    return text;
}

#define CROWD "{\"id\":null,\"ok\":false,\"error\":\"too_many_clients\",\"message\":\"close another one\"}\n"

static bool reply_has(const char *state) {
    iwc_message_t reply;
    return iwc_reply(gateway, &reply) && iwc_is(&reply, "state", state);
}

TEST(test_stop_at_sends_its_line_without_a_greeting) {
    const pid_t child = serve(drive_path, replies("stopping"));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, drive_path, LONG));
    TEST_ASSERT_TRUE(reply_has("stopping"));
    TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
    end(child);
}

TEST(test_stop_at_missing_socket_uses_the_other_one) {
    pid_t child = serve(watch_path, replies("latched"));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_estop_at(gateway, drive_path, "stairs\n\xFC", LONG));
    end(child);
    (void)unlink(watch_path);
    child = serve(drive_path, replies("stopping"));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, watch_path, LONG));
    end(child);
}

TEST(test_stop_at_full_socket_uses_the_other_one) {
    const pid_t full = serve(drive_path, CROWD);
    const pid_t child = serve(watch_path, replies("stopping"));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, drive_path, LONG));
    TEST_ASSERT_TRUE(reply_has("stopping"));
    end(full);
    end(child);
}

TEST(test_stop_at_full_socket_alone_is_refused) {
    const pid_t full = serve(drive_path, CROWD);
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_stop_at(gateway, drive_path, 500));
    TEST_ASSERT_EQUAL_STRING("too_many_clients", iwc_error(gateway));
    end(full);
}

TEST(test_stop_at_without_gateway_returns_immediately) {
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_stop_at(gateway, drive_path, IWC_FOREVER));
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_estop_at(gateway, drive_path, "a\nb", LONG));
}

/// The name space of this process has an empty /run from here on.
TEST(test_stop_at_without_a_name_stops_every_gateway) {
    const char *stopped = replies("stopping");
    if (unshare(CLONE_NEWNS) != 0 || mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0 ||
        mount("none", "/run", "tmpfs", 0, NULL) != 0) {
        TEST_IGNORE_MESSAGE("needs the right to mount");
    }
    TEST_ASSERT_EQUAL_INT(0, mkdir(IWC_DIRECTORY, 0755));
    (void)unsetenv("IWHEEL_SOCKET");
    unsigned *lines = mmap(NULL, 4U * sizeof *lines, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    TEST_ASSERT_TRUE(lines != MAP_FAILED);
    const pid_t hung = serve_as(IWC_DIRECTORY "/can0.sock", stopped, &lines[0], 0);
    const pid_t killed = serve_as(IWC_DIRECTORY "/can1.sock", stopped, &lines[1], 0);
    const pid_t two = serve_as(IWC_DIRECTORY "/can2.sock", stopped, &lines[2], 0);
    const pid_t last = serve_as(IWC_DIRECTORY "/can3.sock", stopped, &lines[3], hung);
    end(killed);
    (void)kill(hung, SIGSTOP);
    TEST_ASSERT_EQUAL(IWC_SEVERAL, iwc_connect(gateway, NULL, LONG));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, NULL, LONG));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(1, lines[2]);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(1, lines[3]);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, lines[0], "the last one continued it: it is asked again");
    end(last);
    (void)kill(hung, SIGSTOP);
    lines[2] = 0;
    iwc_free(gateway);
    gateway = iwc_new(); // Its ids start from the first again.
    TEST_ASSERT_EQUAL(IWC_OK, iwc_estop_at(gateway, NULL, "stairs", LONG));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(1, lines[2]);
    TEST_ASSERT_LESS_THAN_UINT_MESSAGE(4, lines[2], "it has replied; only the hung one is asked in all five rounds");
    end(two);
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_stop_at(gateway, NULL, SHORT));
    end(hung);
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_stop_at(gateway, NULL, LONG));
}
