// SPDX-License-Identifier: MIT
// One gateway per bus, and the crash marker, independent of the paths of the sockets.
#include "lock/runtime.h"

#include "config/gateway_config.h"

#include "folder.h"
#include "unit.h"

#include <fcntl.h>
#include <signal.h>
#include <stddef.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

static char shared[64];
static gateway_config_t one;
static gateway_config_t other;
static gw_runtime_t first;
static gw_runtime_t second;
static char logged[2048];
static pid_t child;

static void configure(gateway_config_t *config, const char *bus, const char *name) {
    memset(config, 0, sizeof *config);
    (void)snprintf(config->bus.interface, sizeof config->bus.interface, "%s", bus);
    (void)snprintf(config->northbound.socket, sizeof config->northbound.socket, "%s/%s/gateway.sock", folder, name);
    (void)mkdir(in_folder(name), 0755);
}

/// Opens the runtime and stores its messages in `logged`.
static int open_runtime(gw_runtime_t *runtime, const gateway_config_t *config) {
    FILE *err = fmemopen(logged, sizeof logged, "w");
    const int result = gw_runtime_open(runtime, config->bus.interface, config->northbound.socket, shared, err);
    (void)fclose(err);
    return result;
}

static void assert_said_pid(pid_t pid) {
    char text[32];
    (void)snprintf(text, sizeof text, "process %ld ", (long)pid);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, text), logged);
}

/// Returns the name of an interface that no other run of this test uses.
static const char *interface(void) {
    static char name[16];
    if (name[0] == '\0') {   // Before any process is created
        unsigned number = 0; // Two process namespaces with one network namespace have the same process ids.
        TEST_ASSERT_EQUAL_INT(sizeof number, getrandom(&number, sizeof number, 0));
        (void)snprintf(name, sizeof name, "iwt%x", number);
    }
    return name;
}

void setUp(void) {
    folder_make();
    (void)snprintf(shared, sizeof shared, "%s/shared", folder);
    memset(logged, 0, sizeof logged);
    configure(&one, interface(), "one");
    configure(&other, interface(), "other");
}

static void end_child(void) {
    if (child > 0) {
        (void)kill(child, SIGKILL);
        (void)waitpid(child, NULL, 0);
    }
    child = 0;
}

void tearDown(void) {
    gw_runtime_close(&first);
    gw_runtime_close(&second);
    end_child();
    folder_remove();
}

TEST(test_lock_second_gateway_with_other_socket_is_refused) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    assert_said_pid(getpid());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, interface()), logged);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "sends nothing"), logged);
}

TEST(test_lock_of_interface_is_free_after_close_and_exit) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    gw_runtime_close(&first);
    const pid_t process = fork();
    if (process == 0) {
        _exit(open_runtime(&second, &other)); // The process ends while it holds the lock.
    }
    int status = 0;
    TEST_ASSERT_EQUAL_INT(process, waitpid(process, &status, 0));
    TEST_ASSERT_EQUAL_INT(0, WEXITSTATUS(status));
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
}

TEST(test_lock_is_retained_after_many_refused_opens) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    for (int i = 0; i < 500; i++) {
        TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    }
}

TEST(test_lock_of_another_interface_is_free) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    (void)snprintf(other.bus.interface, sizeof other.bus.interface, "%.12sx", interface());
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&second, &other));
}

TEST(test_lock_second_gateway_on_local_bus_is_refused) {
    char bus[64];
    (void)snprintf(bus, sizeof bus, "unix:%s/bus", folder);
    configure(&one, bus, "one");
    configure(&other, bus, "other");
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    assert_said_pid(getpid());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, bus + 5), logged);
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_TRUE(file_exists(in_folder("bus.armed")));
    TEST_ASSERT_FALSE(file_exists(shared));
}

static void crash_while_sending(const gateway_config_t *config) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, config));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    gw_runtime_close(&first);
}

TEST(test_marker_is_found_by_a_gateway_with_other_socket) {
    crash_while_sending(&one);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&second, &other));
    TEST_ASSERT_TRUE(gw_runtime_crashed(&second));
    TEST_ASSERT_TRUE(gw_runtime_mark(&second, false));
    gw_runtime_close(&second);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
}

TEST(test_marker_makes_the_shared_directory_again_that_was_removed) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_EQUAL_INT(0, rename(shared, in_folder("removed")));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_TRUE(file_exists(first.place[0]));
    TEST_ASSERT_EQUAL_STRING(first.place[0], first.marker_path);
}

TEST(test_marker_without_shared_directory_is_next_to_the_socket) {
    file_put(shared, "", 0); // This also prevents root.
    crash_while_sending(&one);
    TEST_ASSERT_TRUE(strncmp(first.marker_path, in_folder("one"), strlen(in_folder("one"))) == 0);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_TRUE(gw_runtime_crashed(&first));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, false));
    gw_runtime_close(&first);
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
}

TEST(test_marker_that_cannot_be_set_or_removed_has_its_path) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    // A directory can neither be opened for writing nor unlinked, not even by root.
    TEST_ASSERT_EQUAL_INT(0, mkdir(first.place[0], 0755));
    TEST_ASSERT_EQUAL_INT(0, mkdir(first.place[1], 0755));
    TEST_ASSERT_FALSE(gw_runtime_mark(&first, true));
    TEST_ASSERT_EQUAL_STRING(first.place[1], first.marker_path);
    TEST_ASSERT_FALSE(gw_runtime_mark(&first, true)); // Second try
    TEST_ASSERT_EQUAL_INT(0, rmdir(first.place[1]));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_FALSE(gw_runtime_mark(&first, false));
    TEST_ASSERT_EQUAL_STRING(first.place[0], first.marker_path);
}

TEST(test_marker_removed_in_one_place_only_is_set_again) {
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_EQUAL_INT(0, mkdir(first.place[1], 0755));
    TEST_ASSERT_FALSE(gw_runtime_mark(&first, false));
    TEST_ASSERT_FALSE(file_exists(first.place[0]));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_TRUE(file_exists(first.place[0]));
    TEST_ASSERT_EQUAL_INT(0, rmdir(first.place[1]));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, false));
}

// Other users ---------------------------------------------------------------------------------------------------------

#define STRANGER 65534
#define SERVICE  2

/// Runs `act` as this user in a process that exists until the end of the test. Returns the result of `act`.
static int in_process_of(uid_t uid, int (*act)(void)) {
    int result = -1;
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 0755));
    child = fork();
    if (child == 0) {
        result = (setgid(uid) == 0 && setuid(uid) == 0) ? act() : -2;
        (void)!write(ends[1], &result, sizeof result);
        for (;;) {
            (void)pause();
        }
    }
    (void)close(ends[1]);
    (void)!read(ends[0], &result, sizeof result);
    (void)close(ends[0]);
    return result;
}

static int bind_abstract(const char *name, int backlog) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    (void)snprintf(address.sun_path + 1, sizeof address.sun_path - 1U, "%s", name);
    const int result = bind(fd, (const struct sockaddr *)&address,
                            (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1U + strlen(name)));
    return (result == 0 && backlog >= 0) ? listen(fd, backlog) : result;
}

/// Binds the names of the gateway of root.
static int take_names(unsigned count, int backlog) {
    char name[64];
    int result = 0;
    for (unsigned place = 0; place < count && result == 0; place++) {
        (void)snprintf(name, sizeof name, (place == 0) ? "iwheel-gateway/%s" : "iwheel-gateway/%s/0/%u", interface(),
                       place);
        result = bind_abstract(name, backlog);
    }
    return result;
}

static int squat_listening(void) {
    return take_names(1, 8);
}

static int squat_silently(void) {
    return take_names(1, -1);
}

static int squat_everything(void) {
    return take_names(GW_BUS_PLACES, 0);
}

static bool is_root(void) {
    if (geteuid() != 0) {
        TEST_MESSAGE("SKIPPED: becoming another user needs root");
    }
    return geteuid() == 0;
}

TEST(test_lock_name_held_by_another_user_is_acquired_and_named) {
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, squat_listening));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    assert_said_pid(child);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "of user 65534 holds @iwheel-gateway/"), logged);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
}

TEST(test_lock_name_bound_by_another_user_is_acquired_and_logged) {
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, squat_silently));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "another program"),
                                 logged); // Also the user, if the kernel lists sockets
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "holds @iwheel-gateway/"), logged);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
}

TEST(test_lock_with_every_name_held_excludes_by_its_file) {
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, squat_everything));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    assert_said_pid(getpid());
}

/// Neither the file nor the directory can be created, not even by root.
static void spoil_shared(void) {
    file_put(shared, "", 0);
}

TEST(test_lock_without_its_file_excludes_by_the_next_name) {
    if (!is_root()) {
        return;
    }
    spoil_shared();
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, squat_listening));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "cannot be locked (Not a directory)"), logged);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "is detected by its name only"), logged);
    TEST_ASSERT_EQUAL_INT(1, first.lock.names.place);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
    assert_said_pid(getpid());
}

TEST(test_lock_at_a_later_name_excludes_after_the_first_is_free) {
    if (!is_root()) {
        return;
    }
    spoil_shared();
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, squat_listening));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    end_child();
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE,
                          open_runtime(&second, &other)); // The place of `second` is earlier: it waits, then fails.
}

static int hold_file(void) {
    const int fd = open(in_folder("bus.gateway-lock"), O_RDWR | O_CREAT, 0666);
    return (fd >= 0) ? flock(fd, LOCK_EX | LOCK_NB) : -1;
}

TEST(test_lock_of_local_bus_with_held_file_excludes) {
    char bus[64];
    if (!is_root()) {
        return;
    }
    (void)snprintf(bus, sizeof bus, "unix:%s/bus", folder);
    configure(&one, bus, "one");
    configure(&other, bus, "other");
    TEST_ASSERT_EQUAL_INT(0, chown(folder, STRANGER, 0));
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, hold_file));
    TEST_ASSERT_EQUAL_INT(0, chown(folder, 0, 0));
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 01777));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "of user 65534 holds"), logged);
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&second, &other));
}

// Users who may run a gateway -----------------------------------------------------------------------------------------

static int open_second(void) {
    return open_runtime(&second, &other);
}

TEST(test_lock_held_by_root_excludes_all_other_users) {
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, mkdir(shared, 0755));
    TEST_ASSERT_EQUAL_INT(0, chown(shared, SERVICE, SERVICE));
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, in_process_of(SERVICE, open_second));
    end_child();
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, in_process_of(STRANGER, open_second));
}

TEST(test_lock_held_by_the_service_excludes_all_other_users) {
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, mkdir(shared, 0755));
    TEST_ASSERT_EQUAL_INT(0, chown(shared, SERVICE, SERVICE));
    TEST_ASSERT_EQUAL_INT(0, in_process_of(SERVICE, open_second));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, open_runtime(&first, &one));
    assert_said_pid(child);
    const pid_t service = child;
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, in_process_of(STRANGER, open_second));
    (void)kill(service, SIGKILL);
    (void)waitpid(service, NULL, 0);
}

static int go[2];
static int ready[2];

/// Gateway of a developer: reports whether it is alone, polls the lock again on request, and reports the holder to
/// to which it yields.
static int open_and_tend(void) {
    const int result = open_second();
    const pid_t process = fork();
    char byte = '\0';
    if (process == 0) {
        const bool alone = !gw_bus_lock_poll(&second.lock, 0);
        (void)!write(ready[1], "", 1);
        (void)!read(go[0], &byte, 1);
        const bool early = gw_bus_lock_poll(&second.lock, GW_BUS_LOCK_POLL_US - 1U);
        const bool gives_way = !early && gw_bus_lock_poll(&second.lock, GW_BUS_LOCK_POLL_US);
        const gw_holder_t holder = (alone && gives_way) ? second.lock.holder : (gw_holder_t){.uid = (uid_t)-1};
        (void)!write(ready[1], &holder, sizeof holder);
        _exit(0);
    }
    return (read(ready[0], &byte, 1) == 1) ? result : -1;
}

TEST(test_lock_held_by_another_user_yields_to_root) {
    gw_holder_t holder = {0};
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, pipe(go));
    TEST_ASSERT_EQUAL_INT(0, pipe(ready));
    TEST_ASSERT_EQUAL_INT(0, in_process_of(STRANGER, open_and_tend));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, open_runtime(&first, &one), logged);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, "of user 65534"), logged);
    TEST_ASSERT_EQUAL_INT(1, write(go[1], "", 1));
    TEST_ASSERT_EQUAL_INT(sizeof holder, read(ready[0], &holder, sizeof holder));
    TEST_ASSERT_EQUAL_INT(0, holder.uid);
    TEST_ASSERT_EQUAL_INT(getpid(), holder.pid);
    TEST_ASSERT_FALSE_MESSAGE(gw_bus_lock_poll(&first.lock, GW_BUS_LOCK_POLL_US), "root yields to no other gateway");
    for (size_t i = 0; i < 2U; i++) {
        (void)close(go[i]);
        (void)close(ready[i]);
    }
}

/// One of several processes that start at the same time, when the pipe is closed. Reports its result and retains its
/// lock.
static void start_at_once(const gateway_config_t *config, const int start[2], const int done[2], int result_fd) {
    char byte;
    (void)close(start[1]);
    (void)close(done[1]);
    (void)!read(start[0], &byte, 1);
    const int result = open_runtime(&second, config);
    (void)!write(result_fd, &result, sizeof result);
    (void)!read(done[0], &byte, 1);
    _exit(0);
}

static int how_many_run(void) {
    enum { STARTERS = 3 };
    int start[2];
    int done[2];
    int results[2];
    int running = 0;
    TEST_ASSERT_EQUAL_INT(0, pipe(start));
    TEST_ASSERT_EQUAL_INT(0, pipe(done));
    TEST_ASSERT_EQUAL_INT(0, pipe(results));
    for (int i = 0; i < STARTERS; i++) {
        if (fork() == 0) {
            start_at_once((i == 0) ? &one : &other, start, done, results[1]);
        }
    }
    (void)close(start[0]);
    (void)close(start[1]);
    for (int i = 0; i < STARTERS; i++) {
        int result = -1;
        TEST_ASSERT_EQUAL_INT(sizeof result, read(results[0], &result, sizeof result));
        running += (result == 0) ? 1 : 0;
    }
    (void)close(done[0]);
    (void)close(done[1]);
    (void)close(results[0]);
    (void)close(results[1]);
    while (wait(NULL) > 0) {
    }
    return running;
}

TEST(test_lock_of_simultaneous_starts_is_acquired_by_one) {
    for (int round = 0; round < 3; round++) {
        TEST_ASSERT_EQUAL_INT(1, how_many_run());
    }
    folder_remove();
    TEST_ASSERT_EQUAL_INT(0, mkdir(folder, 0755));
    spoil_shared(); // Found only by its name
    for (int round = 0; round < 3; round++) {
        TEST_ASSERT_EQUAL_INT(1, how_many_run());
    }
}

// Markers -------------------------------------------------------------------------------------------------------------

TEST(test_marker_of_another_user_is_ignored) {
    struct stat status;
    if (!is_root()) {
        return;
    }
    TEST_ASSERT_EQUAL_INT(0, mkdir(shared, 0755));
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    gw_runtime_close(&first);
    for (int i = 0; i < (int)GW_RUNTIME_PLACES; i++) {
        (void)close(open(first.place[i], O_WRONLY | O_CREAT, 0666));
        TEST_ASSERT_EQUAL_INT(0, chown(first.place[i], STRANGER, STRANGER));
    }
    TEST_ASSERT_EQUAL_INT(0, open_runtime(&first, &one));
    TEST_ASSERT_FALSE(gw_runtime_crashed(&first));
    TEST_ASSERT_TRUE(gw_runtime_mark(&first, true));
    TEST_ASSERT_EQUAL_INT(0, lstat(first.marker_path, &status));
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, status.st_uid, "the user could remove the file again");
}
