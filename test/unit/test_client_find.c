// SPDX-License-Identifier: MIT
// iwc_find: search for the only gateway.
#include "iwheel_client/client.h"

#include "folder.h"
#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

static char out[256];

static int bind_socket(const char *name) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int one = socket(AF_UNIX, SOCK_STREAM, 0);
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", in_folder(name));
    TEST_ASSERT_EQUAL_INT(0, bind(one, (const struct sockaddr *)&address, sizeof address));
    return one;
}

/// Adds a socket file on which no program listens.
static void add_socket(const char *name) {
    (void)close(bind_socket(name));
}

static int listeners[2];
static unsigned listening;

static void add_live(const char *name) {
    listeners[listening] = bind_socket(name);
    TEST_ASSERT_EQUAL_INT(0, listen(listeners[listening], 1));
    listening++;
}

static void add_file(const char *name) {
    file_put(in_folder(name), "", 0);
}

void setUp(void) {
    folder_make();
    memset(out, 'x', sizeof out - 1U);
}

void tearDown(void) {
    while (listening > 0) {
        listening--;
        (void)close(listeners[listening]);
    }
    folder_remove();
}

TEST(test_find_missing_directory_is_none) {
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_find("/nonexistent", out, sizeof out));
    TEST_ASSERT_EQUAL_STRING("", out);
}

TEST(test_find_only_sockets_with_the_suffix_count) {
    add_file("gateway.sock");
    add_socket("control");
    add_socket(".sock");
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_find(folder, out, sizeof out));
}

TEST(test_find_only_gateway_is_returned) {
    add_file("gateway.lock");
    add_socket("can0.sock");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_find(folder, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING(in_folder("can0.sock"), out);
}

TEST(test_find_several_gateways_are_listed) {
    add_live("can0.sock");
    add_live("can1.sock");
    TEST_ASSERT_EQUAL(IWC_SEVERAL, iwc_find(folder, out, sizeof out));
    TEST_ASSERT_NOT_NULL(strstr(out, "/can0.sock"));
    TEST_ASSERT_NOT_NULL(strstr(out, "/can1.sock"));
}

TEST(test_find_list_that_does_not_fit_is_cut_between_paths) {
    char little[48];
    add_live("can0.sock");
    add_live("can1.sock");
    TEST_ASSERT_EQUAL(IWC_SEVERAL, iwc_find(folder, little, sizeof little));
    TEST_ASSERT_EQUAL_STRING(".sock", little + strlen(little) - 5U);
}

/// Adds both sockets of a gateway. Only the owner may use the socket for driving.
static void add_pair(void) {
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("watch"), 0755));
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 0755));
    add_socket("can0.sock");
    TEST_ASSERT_EQUAL_INT(0, chmod(in_folder("can0.sock"), 0600));
    add_socket("watch/can0.sock");
    TEST_ASSERT_EQUAL_INT(0, chmod(in_folder("watch/can0.sock"), 0666));
}

TEST(test_find_two_sockets_of_one_gateway_returns_drive_socket) {
    add_pair();
    TEST_ASSERT_EQUAL(IWC_OK, iwc_find(folder, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING(in_folder("can0.sock"), out);
}

TEST(test_find_without_right_to_drive_returns_watch_socket) {
    if (geteuid() != 0) {
        TEST_IGNORE_MESSAGE("needs root to change the user");
    }
    add_pair();
    TEST_ASSERT_EQUAL_INT(0, seteuid(65534));
    const iwc_result_t result = iwc_find(folder, out, sizeof out);
    TEST_ASSERT_EQUAL_INT(0, seteuid(0));
    TEST_ASSERT_EQUAL(IWC_OK, result);
    TEST_ASSERT_EQUAL_STRING(in_folder("watch/can0.sock"), out);
}

TEST(test_find_without_any_right_returns_drive_socket) {
    if (geteuid() != 0) {
        TEST_IGNORE_MESSAGE("needs root to change the user");
    }
    add_pair();
    TEST_ASSERT_EQUAL_INT(0, chmod(in_folder("watch/can0.sock"), 0600));
    TEST_ASSERT_EQUAL_INT(0, seteuid(65534));
    const iwc_result_t result = iwc_find(folder, out, sizeof out);
    TEST_ASSERT_EQUAL_INT(0, seteuid(0));
    TEST_ASSERT_EQUAL(IWC_OK, result);
    TEST_ASSERT_EQUAL_STRING(in_folder("can0.sock"), out);
}

TEST(test_find_watch_socket_alone_counts_as_a_gateway) {
    add_pair();
    TEST_ASSERT_EQUAL_INT(0, unlink(in_folder("can0.sock")));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_find(folder, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING(in_folder("watch/can0.sock"), out);
    TEST_ASSERT_EQUAL_INT(0, unlink(in_folder("watch/can0.sock")));
    add_live("watch/can0.sock");
    add_live("can1.sock");
    TEST_ASSERT_EQUAL(IWC_SEVERAL, iwc_find(folder, out, sizeof out));
}

TEST(test_find_file_without_listener_is_no_second_gateway) {
    add_socket("a.sock");
    add_socket("z.sock");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_find(folder, out, sizeof out)); // None listens: the first file, for the error.
    TEST_ASSERT_EQUAL_STRING(".sock", out + strlen(out) - 5U);
    TEST_ASSERT_EQUAL(strlen(folder) + strlen("/a.sock"), strlen(out));
    add_live("can0.sock");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_find(folder, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING(in_folder("can0.sock"), out);
    add_live("can1.sock");
    TEST_ASSERT_EQUAL(IWC_SEVERAL, iwc_find(folder, out, sizeof out));
    TEST_ASSERT_NULL(strstr(out, "/a.sock"));
}
