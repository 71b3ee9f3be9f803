// SPDX-License-Identifier: MIT
// Scripts of the simulator: the time of each command, and the refusal of a faulty script.
#include "panel.h"
#include "script.h"

#include "unit.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NOW_US UINT64_C(2000000)

static sim_world_t world;
static sim_panel_t panel;
static sim_script_t script;

void setUp(void) {
    memset(&panel, 0xA5, sizeof panel);
    sim_world_init(&world, NULL, NOW_US, 1U);
    panel.world = &world;
    panel.hooks = (sim_hooks_t){.hub = NULL};
}

static const char *check(void *context, const char *command) {
    sim_panel_t *const to = context;
    return (sim_panel_execute(to, NOW_US, command) == SIM_REFUSED) ? to->answer : NULL;
}

static bool load(const char *text, sim_script_fault_t *fault) {
    char path[] = "/tmp/iwheel-script-XXXXXX";
    int const fd = mkstemp(path);
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, fd);
    TEST_ASSERT_EQUAL_INT((int)strlen(text), (int)write(fd, text, strlen(text)));
    (void)close(fd);
    bool const good = sim_script_load(&script, path, check, &panel, fault);
    (void)unlink(path);
    return good;
}

static void expect_step(iw_time_us_t at_us, const char *command) {
    TEST_ASSERT_EQUAL_UINT64(at_us, sim_script_next_us(&script));
    TEST_ASSERT_NULL((at_us > 0U) ? sim_script_take(&script, at_us - 1U) : NULL);
    TEST_ASSERT_EQUAL_STRING(command, sim_script_take(&script, at_us));
}

TEST(test_script_returns_each_command_at_its_time) {
    sim_script_fault_t fault;
    TEST_ASSERT_TRUE(load("# story\npower off\n\n  at 2.5 power on\nwait 1.0\nestop press\nwait 0.25 estop release\r\n"
                          "wait 5\n",
                          &fault));
    expect_step(0U, "power off");
    expect_step(2500000U, "power on");
    expect_step(3500000U, "estop press");
    expect_step(3750000U, "estop release");
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, sim_script_next_us(&script));
    TEST_ASSERT_NULL(sim_script_take(&script, IW_NEVER - 1U));
}

TEST(test_script_faults_are_reported_with_their_line) {
    static const struct {
        const char *text;
        unsigned line;
    } faulty[] = {
        {"power off\npower maybe\n", 2U},
        {"at x power on\n", 1U},
        {"at\n", 1U},
        {"wait\n", 1U},
        {"wait -1\n", 1U},
        {"at 2 power on\nat 1 power off\n", 2U},
        {"# a\n\nfly away\n", 3U},
        {"at 99999999 quit\n", 1U},
        {"at 1.0001 quit\n", 1U},
    };
    for (size_t i = 0U; i < sizeof faulty / sizeof faulty[0]; i++) {
        sim_script_fault_t fault = {0U, ""};
        TEST_ASSERT_FALSE_MESSAGE(load(faulty[i].text, &fault), faulty[i].text);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(faulty[i].line, fault.line, faulty[i].text);
        TEST_ASSERT_NOT_EQUAL(0, strlen(fault.reason));
    }
}

TEST(test_script_line_too_long_and_too_many_commands_are_refused) {
    static char text[SIM_SCRIPT_STEPS * 10U + 20U];
    sim_script_fault_t fault;
    memset(text, 'x', 400U);
    text[400] = '\0';
    TEST_ASSERT_FALSE(load(text, &fault));
    TEST_ASSERT_EQUAL_UINT(1U, fault.line);
    text[0] = '\0';
    for (unsigned i = 0U; i < SIM_SCRIPT_STEPS; i++) {
        memcpy(&text[i * 9U], "power on\n", 10U);
    }
    TEST_ASSERT_TRUE(load(text, &fault));
    memcpy(&text[SIM_SCRIPT_STEPS * 9U], "power on\n", 10U);
    TEST_ASSERT_FALSE(load(text, &fault));
    TEST_ASSERT_EQUAL_UINT(SIM_SCRIPT_STEPS + 1U, fault.line);
}

TEST(test_script_missing_file_is_reported) {
    sim_script_fault_t fault;
    TEST_ASSERT_FALSE(sim_script_load(&script, "/nonexistent/script", check, &panel, &fault));
    TEST_ASSERT_EQUAL_UINT(0U, fault.line);
    TEST_ASSERT_EQUAL_STRING("No such file or directory", fault.reason);
}
