// SPDX-License-Identifier: MIT
// A setpoint that was left in the controller: the sentence for the operator, and the request for a restart of the bus.
#include "bus/bus_facts.h"

#include "folder.h"
#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

static char path[64];
static char victim[64];

void setUp(void) {
    folder_make();
    (void)snprintf(path, sizeof path, "%s/can0.restart", folder);
    (void)snprintf(victim, sizeof victim, "%s/victim", folder);
    file_put(victim, "untouched", strlen("untouched"));
}

void tearDown(void) {
    folder_remove();
}

static void expect_untouched(void) {
    TEST_ASSERT_EQUAL_STRING("untouched", file_text(victim));
}

/// Counts events as a unit with PathChanged= receives them: a file was closed after writing.
static unsigned writings_seen(int watch) {
    char events[4096] __attribute__((aligned(__alignof__(struct inotify_event))));
    unsigned seen = 0;
    const ssize_t length = read(watch, events, sizeof events);
    for (ssize_t at = 0; at < length;) {
        struct inotify_event event;
        memcpy(&event, &events[at], sizeof event);
        at += (ssize_t)(sizeof event + event.len);
        seen++;
    }
    return seen;
}

TEST(test_left_each_request_is_a_new_event) {
    const int watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    TEST_ASSERT_TRUE(inotify_add_watch(watch, folder, IN_CLOSE_WRITE) >= 0);
    TEST_ASSERT_TRUE(gw_bus_left_ask(folder, "can0"));
    TEST_ASSERT_EQUAL_UINT(1, writings_seen(watch));
    TEST_ASSERT_TRUE(gw_bus_left_ask(folder, "can0"));
    TEST_ASSERT_EQUAL_UINT(1, writings_seen(watch));
    (void)close(watch);
}

TEST(test_left_request_is_not_written_through_a_link) {
    struct stat what;
    TEST_ASSERT_EQUAL_INT(0, symlink(victim, path));
    TEST_ASSERT_TRUE(gw_bus_left_ask(folder, "can0"));
    expect_untouched();
    TEST_ASSERT_EQUAL_INT(0, lstat(path, &what));
    TEST_ASSERT_TRUE(S_ISREG(what.st_mode));
    (void)unlink(path);
    TEST_ASSERT_EQUAL_INT(0, link(victim, path));
    TEST_ASSERT_TRUE(gw_bus_left_ask(folder, "can0"));
    expect_untouched();
}

TEST(test_left_request_without_directory_fails) {
    char nowhere[300];
    memset(nowhere, 'x', sizeof nowhere);
    nowhere[sizeof nowhere - 1U] = '\0';
    TEST_ASSERT_FALSE(gw_bus_left_ask("/nonexistent/iwheel", "can0"));
    TEST_ASSERT_FALSE(gw_bus_left_ask(nowhere, "can0"));
}

TEST(test_left_sentence_names_the_fix_for_each_kind_of_bus) {
    char sentence[400];
    iwl_bus_link_t link = {.presence = IWL_LINK_UP, .echo_proven = true};
    gw_bus_left_sentence(&link, "can0", sentence, sizeof sentence);
    TEST_ASSERT_NOT_NULL(strstr(sentence, "ip link set can0 down; ip link set can0 up"));
    TEST_ASSERT_NOT_NULL(strstr(sentence, "systemctl enable --now iwheel-can-restart@can0.path"));
    link.echo_proven = false;
    gw_bus_left_sentence(&link, "can0", sentence, sizeof sentence);
    TEST_ASSERT_NOT_NULL(strstr(sentence, "switch it off and on"));
    link.presence = IWL_LINK_LOCAL;
    gw_bus_left_sentence(&link, "unix:/run/bus", sentence, sizeof sentence);
    TEST_ASSERT_NOT_NULL(strstr(sentence, "start its hub (the simulator) again"));
}
