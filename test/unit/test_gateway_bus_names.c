// SPDX-License-Identifier: MIT
// Names by which gateways find each other, while the gateway of a developer serves a bus. The tests need no root: the
// gateway under test is a struct with other users.
#include "lock/bus_names.h"

#include "unit.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { DEVELOPER = 60001, SERVICE = 60002, FOREIGN = 60003, SOCKETS = 64, NAMES = 10 };

static int sockets[SOCKETS];
static unsigned held;
static unsigned lists;
static gw_bus_names_t developers;
static gw_holder_t holder;

// The linker redirects the calls of the code under test.
int __real_socket(int domain, int type, int protocol);
int __wrap_socket(int domain, int type, int protocol);
int __wrap_socket(int domain, int type, int protocol) {
    lists += (domain == AF_NETLINK) ? 1U : 0U;
    return __real_socket(domain, type, protocol);
}

void setUp(void) {
    unsigned long long number;
    held = 0;
    lists = 0;
    holder = (gw_holder_t){.uid = (uid_t)-1};
    developers = (gw_bus_names_t){.owners = {.own = DEVELOPER, .service = SERVICE}, .place = GW_BUS_PLACES, .fd = -1};
    TEST_ASSERT_EQUAL_INT(sizeof number, getrandom(&number, sizeof number, 0)); // Process ids are not unique here.
    (void)snprintf(developers.key, sizeof developers.key, "@iwheel-test/%llx", number);
}

static void close_all(void) {
    while (held > 0U) {
        (void)close(sockets[--held]);
    }
}

void tearDown(void) {
    gw_bus_names_release(&developers);
    close_all();
}

static int new_socket(int type) {
    TEST_ASSERT_LESS_THAN_UINT(SOCKETS, held);
    const int fd = socket(AF_UNIX, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    TEST_ASSERT_TRUE(fd >= 0);
    sockets[held++] = fd;
    return fd;
}

/// Ways in which a process holds a name.
typedef enum { LISTENS, FULL, SILENT, DATAGRAMS, WAYS } way_t;

/// A socket of this process has the name. If its queue is full, it accepts no further connection.
static int hold(const char *suffix, way_t way) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int type = (way == DATAGRAMS) ? SOCK_DGRAM : SOCK_STREAM;
    const int fd = new_socket(type);
    (void)snprintf(address.sun_path + 1, sizeof address.sun_path - 1U, "%s%s", developers.key + 1, suffix);
    const socklen_t length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1U + strlen(address.sun_path + 1));
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (const struct sockaddr *)&address, length));
    if (way == LISTENS || way == FULL) {
        TEST_ASSERT_EQUAL_INT(0, listen(fd, 0));
    }
    if (way == FULL) {
        TEST_ASSERT_EQUAL_INT(0, connect(new_socket(type), (const struct sockaddr *)&address, length));
        TEST_ASSERT_NOT_EQUAL_INT(0, connect(new_socket(type), (const struct sockaddr *)&address, length));
    }
    return fd;
}

/// A foreign user holds the first names of the bus: of all users, of the service, of the developer, of root.
static void hold_first(unsigned names, way_t way) {
    static const uid_t users[] = {SERVICE, DEVELOPER, 0};
    const bool is_root = geteuid() == 0U;
    char suffix[32] = "";
    if (is_root) {
        TEST_ASSERT_EQUAL_INT(0, seteuid(FOREIGN));
    }
    for (unsigned i = 0; i < names; i++) {
        if (i > 0U) {
            (void)snprintf(suffix, sizeof suffix, "/%u/%u", (unsigned)users[(i - 1U) / 3U], (i - 1U) % 3U + 1U);
        }
        (void)hold(suffix, way);
    }
    if (is_root) {
        TEST_ASSERT_EQUAL_INT(0, seteuid(0));
    }
}

TEST(test_bus_names_poll_never_reads_the_list_of_sockets) {
    for (way_t way = LISTENS; way < WAYS; way++) {
        hold_first(NAMES, way);
        TEST_ASSERT_FALSE(gw_bus_names_poll(&developers, &holder));
        TEST_ASSERT_EQUAL_UINT(0, lists);
        close_all();
    }
}

TEST(test_bus_names_take_reads_the_list_and_reports_a_foreigner) {
    static const way_t ways[] = {FULL, SILENT};
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        gw_holder_t foreigner = {.uid = (uid_t)-1};
        lists = 0;
        hold_first(NAMES, ways[i]);
        TEST_ASSERT_EQUAL_INT(0, gw_bus_names_take(&developers, &holder, &foreigner));
        TEST_ASSERT_EQUAL_UINT(GW_BUS_PLACES, developers.place);
        TEST_ASSERT_GREATER_THAN_UINT(0, lists);
        TEST_ASSERT_EQUAL_UINT((geteuid() == 0U) ? FOREIGN : geteuid(), foreigner.uid);
        TEST_ASSERT_EQUAL_STRING(developers.key, foreigner.name);
        close_all();
    }
}

TEST(test_bus_names_take_withdraws_for_a_service_with_a_full_queue) {
    gw_holder_t foreigner = {.uid = (uid_t)-1};
    developers.owners.service = geteuid();
    (void)hold("", FULL);
    TEST_ASSERT_EQUAL_INT(EWOULDBLOCK, gw_bus_names_take(&developers, &holder, &foreigner));
    TEST_ASSERT_EQUAL_UINT(geteuid(), holder.uid);
    TEST_ASSERT_EQUAL_INT(-1, developers.fd);
}

TEST(test_bus_names_poll_yields_to_the_service_next_to_foreigners) {
    char suffix[32];
    hold_first(NAMES - 3U, FULL);
    developers.owners.service = geteuid();
    TEST_ASSERT_FALSE(gw_bus_names_poll(&developers, &holder));
    TEST_ASSERT_EQUAL_UINT(0, lists);
    for (unsigned place = 1; place < GW_BUS_PLACES; place++) {
        (void)snprintf(suffix, sizeof suffix, "/%u/%u", (unsigned)geteuid(), place);
        (void)hold(suffix, LISTENS);
        holder = (gw_holder_t){.uid = (uid_t)-1};
        TEST_ASSERT_TRUE(gw_bus_names_poll(&developers, &holder));
        TEST_ASSERT_EQUAL_UINT(geteuid(), holder.uid);
        TEST_ASSERT_EQUAL_INT(getpid(), holder.pid);
        (void)close(sockets[--held]);
    }
    TEST_ASSERT_FALSE(gw_bus_names_poll(&developers, &holder));
    TEST_ASSERT_EQUAL_UINT(0, lists);
}

TEST(test_bus_names_poll_yields_to_a_full_queue_when_it_has_room) {
    gw_bus_names_t services = developers;
    developers.owners.service = geteuid();
    services.owners = (sock_owners_t){.own = geteuid(), .service = geteuid()};
    services.place = 0;
    services.fd = hold("", FULL);
    TEST_ASSERT_FALSE(gw_bus_names_poll(&developers, &holder));
    TEST_ASSERT_FALSE(gw_bus_names_poll(&services, &holder)); // It accepts those that wait.
    TEST_ASSERT_TRUE(gw_bus_names_poll(&developers, &holder));
    TEST_ASSERT_EQUAL_UINT(geteuid(), holder.uid);
    TEST_ASSERT_EQUAL_UINT(0, lists);
}
