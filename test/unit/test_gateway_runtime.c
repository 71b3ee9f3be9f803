// SPDX-License-Identifier: MIT
// One gateway per bus, and the marker of a crash, wherever the gateways' sockets lie.
#include "process/runtime.h"

#include "unity.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

static char top[] = "/tmp/iwheel-runtime-XXXXXX";
static char shared[64];
static gateway_config_t one;
static gateway_config_t other;
static gw_runtime_t first;
static gw_runtime_t second;
static char said[512];

static const char *under(const char *name) {
    static char path[128];
    (void)snprintf(path, sizeof path, "%s/%s", top, name);
    return path;
}

static void configure(gateway_config_t *config, const char *bus, const char *folder) {
    (void)memset(config, 0, sizeof *config);
    (void)snprintf(config->bus.interface, sizeof config->bus.interface, "%s", bus);
    (void)snprintf(config->northbound.socket, sizeof config->northbound.socket, "%s/%s/gateway.sock", top, folder);
    (void)mkdir(under(folder), 0755);
}

/// Opens it, and keeps what it says in `said`.
static int open_runtime(gw_runtime_t *runtime, const gateway_config_t *config) {
    FILE *err = fmemopen(said, sizeof said, "w");
    const int result = gw_runtime_open(runtime, config, shared, err);
    (void)fclose(err);
    return result;
}

static bool exists(const char *path) {
    return access(path, F_OK) == 0;
}

/// An interface's name that no other run of this test has.
static const char *interface(void) {
    static char name[16];
    (void)snprintf(name, sizeof name, "iwt%ld", (long)getpid());
    return name;
}

void setUp(void) {
    memcpy(strrchr(top, '-'), "-XXXXXX", 8);
    TEST_ASSERT_NOT_NULL(mkdtemp(top));
    (void)snprintf(shared, sizeof shared, "%s/shared", top);
    (void)memset(said, 0, sizeof said);
    configure(&one, interface(), "one");
    configure(&other, interface(), "other");
}

static void remove_top(void) {
    char command[64];
    (void)snprintf(command, sizeof command, "rm -rf %s", top);
    TEST_ASSERT_EQUAL_INT(0, system(command));
}

void tearDown(void) {
    gw_runtime_close(&first);
    gw_runtime_close(&second);
    remove_top();
}

static void test_second_gateway_on_interface_with_socket_elsewhere_is_refused(void) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    char pid[32];
    (void)snprintf(pid, sizeof pid, "process %ld ", (long)getpid());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, pid), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, interface()), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "sends nothing"), said);
}

static void test_lock_of_interface_is_free_after_close_and_after_death(void) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    gw_runtime_close(&first);
    const pid_t child = fork();
    if (child == 0) {
        _exit(open_runtime(&second, &other)); // Dies holding it.
    }
    int status = 0;
    TEST_ASSERT_EQUAL_INT(child, waitpid(child, &status, 0));
    TEST_ASSERT_EQUAL_INT(0, WEXITSTATUS(status));
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
}

static void test_many_who_ask_leave_the_lock_where_it_is(void) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    for (int i = 0; i < 500; ++i) {
        TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    }
}

static void test_other_interface_is_free(void) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    (void)snprintf(other.bus.interface, sizeof other.bus.interface, "%.12sx", interface());
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&second, &other));
}

static void test_second_gateway_on_local_bus_is_refused(void) {
    char bus[64];
    (void)snprintf(bus, sizeof bus, "unix:%s/bus", top);
    configure(&one, bus, "one");
    configure(&other, bus, "other");
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, "another program"), said);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, bus + 5), said);
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_TRUE(exists(under("bus.armed")));
    TEST_ASSERT_FALSE(exists(shared));
}

static void crash_while_sending(const gateway_config_t *config) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, config));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    gw_runtime_close(&first);
}

static void test_marker_of_interface_is_found_by_gateway_with_socket_elsewhere(void) {
    crash_while_sending(&one);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&second, &other));
    TEST_ASSERT_TRUE(gw_runtime_crashed(&second));
    TEST_ASSERT_TRUE(gw_runtime_mark(&second, false));
    gw_runtime_close(&second);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
}

static void test_marker_without_right_to_the_shared_directory_lies_beside_the_socket(void) {
    FILE *in_the_way = fopen(shared, "w"); // Keeps root out too.
    TEST_ASSERT_NOT_NULL(in_the_way);
    (void)fclose(in_the_way);
    crash_while_sending(&one);
    TEST_ASSERT_TRUE(strncmp(first.marker_path, under("one"), strlen(under("one"))) == 0);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_TRUE(gw_runtime_crashed(&first));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, false));
    gw_runtime_close(&first);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
}

static void test_marker_that_cannot_be_set_or_removed_is_told_with_its_path(void) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    // A directory can neither be opened for writing nor unlinked, not even by root.
    TEST_ASSERT_EQUAL_INT(0, mkdir(shared, 0755));
    TEST_ASSERT_EQUAL_INT(0, mkdir(first.place[0], 0755));
    TEST_ASSERT_EQUAL_INT(0, mkdir(first.place[1], 0755));
    TEST_ASSERT_FALSE(gw_runtime_mark(&first, true));
    TEST_ASSERT_EQUAL_STRING(first.place[1], first.marker_path);
    TEST_ASSERT_FALSE(gw_runtime_mark(&first, false));
    TEST_ASSERT_EQUAL_STRING(first.place[0], first.marker_path);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_second_gateway_on_interface_with_socket_elsewhere_is_refused);
    RUN_TEST(test_lock_of_interface_is_free_after_close_and_after_death);
    RUN_TEST(test_many_who_ask_leave_the_lock_where_it_is);
    RUN_TEST(test_other_interface_is_free);
    RUN_TEST(test_second_gateway_on_local_bus_is_refused);
    RUN_TEST(test_marker_of_interface_is_found_by_gateway_with_socket_elsewhere);
    RUN_TEST(test_marker_without_right_to_the_shared_directory_lies_beside_the_socket);
    RUN_TEST(test_marker_that_cannot_be_set_or_removed_is_told_with_its_path);
    return UNITY_END();
}
