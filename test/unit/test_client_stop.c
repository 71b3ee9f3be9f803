// SPDX-License-Identifier: MIT
// libiwheel-client: optional members of a request, and stops through either socket of a gateway.
#include "iwheel_client/client.h"

#include "unity.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#define HELLO "{\"event\":\"hello\",\"name\":\"iwheel-gateway\",\"api\":1,\"state\":\"listening\",\"client\":7}\n"
#define SOON  20 ///< ms; the expected bytes are already there.
#define LONG  2000

static iwc_t *gateway;
static int server;
static char folder[] = "/tmp/client_stop_XXXXXX";
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
    TEST_ASSERT_EQUAL(IWC_OK, iwc_adopt(gateway, pair[0], SOON));
}

void setUp(void) {
    gateway = iwc_new();
    server = -1;
    (void)snprintf(drive_path, sizeof drive_path, "%s/gateway.sock", folder);
    (void)snprintf(watch_path, sizeof watch_path, "%s/watch/gateway.sock", folder);
}

void tearDown(void) {
    iwc_free(gateway);
    if (server >= 0) {
        (void)close(server);
    }
    (void)unlink(drive_path);
    (void)unlink(watch_path);
}

// Optional members of a request ---------------------------------------------------------------------------------------

static void test_ask_helpers_send_time_stop_and_key(void) {
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

static void test_ask_arm_returns_the_key_of_the_lease(void) {
    adopt();
    char key[IWC_KEY_SIZE] = "before";
    send_text("{\"id\":2,\"ok\":true,\"lease_ms\":200,\"key\":\"0123456789abcdef0123456789abcdef\"}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_arm_as(gateway, &(iwc_arm_t){.takeover = true}, SOON, NULL, key));
    TEST_ASSERT_EQUAL_STRING("0123456789abcdef0123456789abcdef", key);
    send_text("{\"id\":4,\"ok\":true,\"lease_ms\":200}\n"); // The reply of a microcontroller has no key.
    TEST_ASSERT_EQUAL(IWC_OK, iwc_arm_as(gateway, &(iwc_arm_t){.takeover = true}, SOON, NULL, key));
    TEST_ASSERT_EQUAL_STRING("", key);
}

static void test_reason_without_connection_is_not_empty(void) {
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_CLOSED), iwc_reason(gateway));
    TEST_ASSERT_GREATER_THAN(3, strlen(iwc_reason(NULL)));
}

// Either socket -------------------------------------------------------------------------------------------------------

/// Starts a process of a gateway that answers each connection to this socket with `reply` after its first line.
static pid_t serve(const char *path, const char *reply) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, listen(fd, 8));
    const pid_t child = fork();
    if (child == 0) {
        for (;;) {
            char line[512];
            const int one = accept(fd, NULL, NULL);
            if (recv(one, line, sizeof line, 0) > 0) {
                (void)!write(one, reply, strlen(reply));
            }
            (void)close(one);
        }
    }
    (void)close(fd);
    return child;
}

static void end(pid_t child) {
    (void)kill(child, SIGKILL);
    (void)waitpid(child, NULL, 0);
}

#define STOPPED "{\"id\":2,\"ok\":true,\"state\":\"stopping\"}\n{\"id\":4,\"ok\":true,\"state\":\"stopping\"}\n"
#define CROWD   "{\"id\":null,\"ok\":false,\"error\":\"too_many_clients\",\"message\":\"close another one\"}\n"

static bool reply_has(const char *state) {
    iwc_message_t reply;
    return iwc_reply(gateway, &reply) && iwc_is(&reply, "state", state);
}

static void test_stop_at_sends_its_line_without_a_greeting(void) {
    const pid_t child = serve(drive_path, STOPPED);
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, drive_path, LONG));
    TEST_ASSERT_TRUE(reply_has("stopping"));
    TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
    end(child);
}

static void test_stop_at_missing_socket_uses_the_other_one(void) {
    pid_t child = serve(watch_path,
                        "{\"id\":4,\"ok\":true,\"state\":\"latched\"}\n{\"id\":2,\"ok\":true,\"state\":\"latched\"}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_estop_at(gateway, drive_path, "stairs", LONG));
    end(child);
    (void)unlink(watch_path);
    child = serve(drive_path, STOPPED);
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, watch_path, LONG));
    end(child);
}

static void test_stop_at_full_socket_uses_the_other_one(void) {
    const pid_t full = serve(drive_path, CROWD);
    const pid_t child = serve(watch_path, "{\"id\":4,\"ok\":true,\"state\":\"stopping\"}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop_at(gateway, drive_path, LONG));
    TEST_ASSERT_TRUE(reply_has("stopping"));
    end(full);
    end(child);
}

static void test_stop_at_full_socket_alone_is_refused(void) {
    const pid_t full = serve(drive_path, CROWD);
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_stop_at(gateway, drive_path, 60));
    TEST_ASSERT_EQUAL_STRING("too_many_clients", iwc_error(gateway));
    end(full);
}

static void test_stop_at_without_gateway_returns_immediately(void) {
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_stop_at(gateway, drive_path, IWC_FOREVER));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_estop_at(gateway, drive_path, "a\nb", LONG));
}

int main(void) {
    UNITY_BEGIN();
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    char watch[64];
    (void)snprintf(watch, sizeof watch, "%s/watch", folder);
    TEST_ASSERT_EQUAL_INT(0, mkdir(watch, 0755));
    RUN_TEST(test_ask_helpers_send_time_stop_and_key);
    RUN_TEST(test_ask_arm_returns_the_key_of_the_lease);
    RUN_TEST(test_reason_without_connection_is_not_empty);
    RUN_TEST(test_stop_at_sends_its_line_without_a_greeting);
    RUN_TEST(test_stop_at_missing_socket_uses_the_other_one);
    RUN_TEST(test_stop_at_full_socket_uses_the_other_one);
    RUN_TEST(test_stop_at_full_socket_alone_is_refused);
    RUN_TEST(test_stop_at_without_gateway_returns_immediately);
    (void)rmdir(watch);
    (void)rmdir(folder);
    return UNITY_END();
}
