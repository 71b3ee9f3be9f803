// SPDX-License-Identifier: MIT
// Commands of the simulator: which are accepted, which are refused, and that a refused command changes nothing.
#include "panel.h"
#include "sim_command.h"

#include "sim_texts.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

#define START_US UINT64_C(1000000)
#define NOW_US   UINT64_C(2000000)

static sim_world_t world;
static sim_panel_t panel;
static char marked[SIM_LINE_BYTES];
static unsigned quits;

static void mark(void *context, const char *text) {
    (void)context;
    (void)snprintf(marked, sizeof marked, "%s", text);
}

static void quit(void *context) {
    (void)context;
    quits += 1U;
}

static void run_until(iw_time_us_t until_us) {
    sim_delivery_t delivery;
    while (sim_world_step(&world, until_us, &delivery)) {
    }
}

void setUp(void) {
    memset(&panel, 0xA5, sizeof panel);
    sim_world_init(&world, NULL, START_US, 1U);
    panel.world = &world;
    panel.hooks = (sim_hooks_t){.mark = mark, .quit = quit};
    marked[0] = '\0';
    quits = 0U;
    run_until(NOW_US);
}

static void expect_done(const char *line) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(SIM_CHANGED, sim_panel_execute(&panel, NOW_US, line), line);
    TEST_ASSERT_EQUAL_STRING("ok\n", panel.answer);
}

static void expect_refused(const char *line) {
    static sim_world_t before;
    before = world;
    TEST_ASSERT_EQUAL_INT_MESSAGE(SIM_REFUSED, sim_panel_execute(&panel, NOW_US, line), line);
    TEST_ASSERT_EQUAL_STRING_LEN("error ", panel.answer, 6);
    TEST_ASSERT_EQUAL_CHAR('\n', panel.answer[strlen(panel.answer) - 1U]);
    TEST_ASSERT_EQUAL_PTR(&panel.answer[strlen(panel.answer) - 1U], strchr(panel.answer, '\n'));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, memcmp(&before, &world, sizeof world), line);
}

static sim_wheel_t *wheel(iw_side_t side) {
    return &world.pair.wheel[side];
}

TEST(test_panel_every_command_with_valid_arguments_is_executed) {
    static const char *const right[] = {
        "power off",
        "power on",
        "reboot left",
        "reboot both",
        "mute right",
        "unmute right",
        "block left",
        "unblock both",
        "runaway left on",
        "runaway right on 500",
        "runaway both off",
        "free left on",
        "free both off",
        "droop right 75",
        "droop both 0",
        "kerb left 12.5",
        "kerb left 0",
        "late right 400",
        "late both 0",
        "lag left 42",
        "lag both 60",
        "slope -8.3",
        "slope 0",
        "yaw 30",
        "yaw 0",
        "rounding both truncated",
        "rounding left chance",
        "sign left swapped",
        "sign left normal",
        "load left 50",
        "load both -12.345",
        "unit left dN",
        "unit right cN",
        "removed left on",
        "removed both off",
        "zero left 3.5",
        "raw left -32768",
        "raw left auto",
        "ticks right -2147483648",
        "gear both 20",
        "gear left 15 2",
        "rpm left rotor",
        "rpm both wheel",
        "radius left 200",
        "push both -1.5",
        "turn 3",
        "turn -0.25",
        "track 600",
        "mirror right on",
        "mirror right off",
        "role setpoint",
        "role limit",
        "type 7",
        "type any",
        "battery 255",
        "ambient -40",
        "loss 12.5",
        "loss 0",
        "slow 0.1",
        "slow 1000",
        "ack off",
        "ack on",
        "stall on",
        "stall off",
        "busoff on",
        "busoff off",
        "passive on",
        "passive off",
        "bus down",
        "bus up",
        "queue 1",
        "queue 64",
        "foreign on",
        "foreign on 300",
        "foreign off",
        "foreign once",
        "foreign once -50",
        "frame 10A#0101F407D0",
        "frame 10A#R",
        "frame 12345678#",
        "babble 7FF 120 on",
        "babble 7FF 120 off",
        "estop press",
        "estop release",
        "estop pulse 20",
        "estop pulse 0.5",
        "estop unplug",
        "estop plug",
        "contact 1 press",
        "contact 2 release",
        "contact 2 pulse 20",
        "contact 1 unplug",
        "contact 2 plug",
        "normal",
    };
    for (size_t i = 0U; i < sizeof right / sizeof right[0]; i++) {
        expect_done(right[i]);
    }
}

TEST(test_panel_wrong_commands_are_refused_and_change_nothing) {
    static const char *const wrong[] = {
        "",
        "   ",
        "#",
        "power",
        "power of",
        "power ON",
        "power on now",
        "POWER on",
        "pow on",
        "reboot",
        "reboot up",
        "reboot left right",
        "mute",
        "mute all",
        "load left",
        "load left x",
        "load left 4000.001",
        "load left -4001",
        "load left 1.2345",
        "load left 1.",
        "load left .5",
        "load left 1e3",
        "load left 0x10",
        "load left --1",
        "load left +1",
        "load left 1.2.3",
        "load left 99999999999999999999",
        "load middle 5",
        "unit left cn",
        "unit left",
        "sign left",
        "sign left up",
        "runaway left",
        "runaway left on 0",
        "runaway left on 3001",
        "runaway left off 5",
        "free left",
        "droop left 100.1",
        "kerb left -1",
        "late left 401",
        "lag left 0",
        "slope 50.1",
        "yaw -90.1",
        "rounding left up",
        "raw left 32768",
        "raw left -32769",
        "raw left 1.5",
        "zero left 4001",
        "ticks left 2147483648",
        "gear left 0",
        "gear left 5 0",
        "gear left 1001",
        "rpm left x",
        "radius left 19",
        "radius left 501",
        "mirror left",
        "role both",
        "type 256",
        "type 18446744073709551623",
        "type -1",
        "type",
        "battery 256",
        "battery -1",
        "ambient 256",
        "loss 100.001",
        "loss -1",
        "slow 0.099",
        "slow 1001",
        "slow 0",
        "ack",
        "ack maybe",
        "stall 1",
        "busoff",
        "passive x",
        "bus off",
        "queue 0",
        "queue 65",
        "foreign",
        "foreign maybe",
        "foreign off 5",
        "foreign on 32768",
        "foreign on x",
        "frame",
        "frame 10A",
        "frame #00",
        "frame 10#00",
        "frame 800#00",
        "frame 10A#0",
        "frame 10A#GG",
        "frame 10A#000102030405060708",
        "frame 20000000#00",
        "frame 10A#R1",
        "frame 010A#00",
        "babble",
        "babble 7FF on",
        "babble 7FF 99 on",
        "babble 7FF 100 maybe",
        "babble FFF 100 on",
        "estop",
        "estop push",
        "turn",
        "turn left",
        "turn 20.001",
        "turn 1 2",
        "track",
        "track 49",
        "track 5001",
        "track 540.5",
        "estop press 5",
        "estop pulse",
        "estop pulse 0",
        "estop pulse 60001",
        "estop unplug 1",
        "contact",
        "contact 1",
        "contact 0 press",
        "contact 3 press",
        "contact press",
        "contact 1 push",
        "contact 1 press 5",
        "contact 2 pulse",
        "log",
        "log mark",
        "log it please",
        "status now",
        "normal now",
        "quit now",
        "power\ton\x01",
        "\x80",
    };
    for (size_t i = 0U; i < sizeof wrong / sizeof wrong[0]; i++) {
        expect_refused(wrong[i]);
    }
    TEST_ASSERT_EQUAL_UINT(0U, quits);
    TEST_ASSERT_EQUAL_STRING("", marked);
}

static int32_t pushed_mm(iw_side_t side) {
    return (int32_t)(wheel(side)->motion.push_nm / 1000000);
}

TEST(test_panel_turn_rolls_each_wheel_along_its_circle) {
    expect_done("track 600");
    expect_done("turn 2");
    TEST_ASSERT_INT32_WITHIN(1, -3770, pushed_mm(IW_LEFT)); // 2 x pi x 600 mm
    TEST_ASSERT_INT32_WITHIN(1, 3770, pushed_mm(IW_RIGHT));
    expect_done("turn -2");
    expect_done("mirror left on");
    expect_done("turn 1");
    TEST_ASSERT_INT32_WITHIN(1, 1885, pushed_mm(IW_LEFT));
    TEST_ASSERT_INT32_WITHIN(1, 1885, pushed_mm(IW_RIGHT));
}

TEST(test_panel_line_too_long_is_refused) {
    char line[400];
    memset(line, 'x', sizeof line);
    line[sizeof line - 1U] = '\0';
    expect_refused(line);
    memset(line, ' ', sizeof line - 1U);
    memcpy(line, "power on", 8U);
    expect_refused(line);
}

TEST(test_panel_refusal_has_the_usage) {
    expect_refused("load left");
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "usage: load left|right|both NEWTON"));
    expect_refused("lod left 5");
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "help"));
}

TEST(test_panel_reboot_without_power_is_refused_with_the_fix) {
    expect_done("power off");
    expect_refused("reboot left");
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "power on"));
}

TEST(test_panel_help_lists_commands_and_ends_in_a_dot) {
    TEST_ASSERT_EQUAL_INT(SIM_ASKED, sim_panel_execute(&panel, NOW_US, "help"));
    static const char *const name[] = {"power", "reboot", "load", "sign", "foreign", "estop", "status", "help"};
    for (size_t i = 0U; i < sizeof name / sizeof name[0]; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(panel.answer, name[i]), name[i]);
    }
    TEST_ASSERT_EQUAL_STRING("\n.\n", &panel.answer[strlen(panel.answer) - 3U]);
}

/// Returns how many lines of the list begin with the name.
static unsigned lines_of(const char *list, const char *name) {
    unsigned lines = 0;
    for (const char *line = list; *line != '\0'; line += strcspn(line, "\n") + 1U) {
        lines += (strncmp(line, name, strlen(name)) == 0 && line[strlen(name)] == ' ') ? 1U : 0U;
    }
    return lines;
}

static unsigned expect_listed(const sim_command_t *table, const char *list) {
    unsigned commands = 0;
    for (; table[commands].name != NULL; commands++) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1U, lines_of(list, table[commands].name), table[commands].name);
    }
    return commands;
}

static unsigned all_lines(const char *list) {
    unsigned lines = 0;
    for (; *list != '\0'; list += strcspn(list, "\n") + 1U) {
        lines++;
    }
    return lines;
}

/// The list contains the help of each command once, and no other help.
TEST(test_panel_help_lists_exactly_the_commands) {
    TEST_ASSERT_EQUAL_UINT(all_lines(sim_commands_wheel), expect_listed(sim_wheel_commands, sim_commands_wheel));
    TEST_ASSERT_EQUAL_UINT(all_lines(sim_commands_bus), expect_listed(sim_bus_commands, sim_commands_bus) + 1U);
    TEST_ASSERT_EQUAL_UINT(1U, lines_of(sim_commands_bus, "help"));
}

TEST(test_panel_usage_longer_than_its_column_is_not_cut) {
    expect_refused("contact 1");
    TEST_ASSERT_EQUAL_STRING("error wrong arguments; usage: contact 1|2 press|release|pulse MS|unplug|plug\n",
                             panel.answer);
}

TEST(test_panel_status_is_one_line_with_the_present_values) {
    expect_done("load left 50");
    expect_done("power off");
    TEST_ASSERT_EQUAL_INT(SIM_ASKED, sim_panel_execute(&panel, NOW_US, "status"));
    TEST_ASSERT_EQUAL_STRING_LEN("ok {\"t_us\":2000000,\"power\":false,", panel.answer, 32);
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "\"load_mN\":50000"));
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "\"setpoint\":null,\"setpoint_age_ms\":null"));
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "\"ack\":false"));
    TEST_ASSERT_EQUAL_PTR(&panel.answer[strlen(panel.answer) - 1U], strchr(panel.answer, '\n'));
}

TEST(test_panel_status_has_the_last_setpoint_and_its_age) {
    expect_done("frame 10A#0101F407D0");
    run_until(NOW_US + 500000U);
    (void)sim_panel_execute(&panel, NOW_US + 500000U, "status");
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "\"setpoint\":{\"type\":1,\"speed_mm_s\":500,\"current_mA\":2000}"));
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "\"setpoint_age_ms\":499,\"driven\":true"));
}

TEST(test_panel_status_that_does_not_fit_is_cut_and_terminated) {
    char small[40];
    memset(small, 0x5A, sizeof small);
    TEST_ASSERT_EQUAL_size_t(sizeof small - 1U, sim_panel_status(&panel, NOW_US, small, sizeof small));
    TEST_ASSERT_EQUAL_CHAR('\0', small[sizeof small - 1U]);
}

TEST(test_panel_commands_reach_the_side_they_name) {
    expect_done("block left");
    expect_done("mute right");
    expect_done("sign both swapped");
    expect_done("load right 12.5");
    TEST_ASSERT_TRUE(wheel(IW_LEFT)->motion.blocked);
    TEST_ASSERT_FALSE(wheel(IW_RIGHT)->motion.blocked);
    TEST_ASSERT_FALSE(wheel(IW_LEFT)->muted);
    TEST_ASSERT_TRUE(wheel(IW_RIGHT)->muted);
    TEST_ASSERT_TRUE(wheel(IW_LEFT)->motion.swapped && wheel(IW_RIGHT)->motion.swapped);
    TEST_ASSERT_EQUAL_INT32(0, wheel(IW_LEFT)->force.load_mN);
    TEST_ASSERT_EQUAL_INT32(12500, wheel(IW_RIGHT)->force.load_mN);
}

TEST(test_panel_mark_and_quit_call_their_hooks) {
    TEST_ASSERT_EQUAL_INT(SIM_ASKED, sim_panel_execute(&panel, NOW_US, "log mark  the   judge reads this"));
    TEST_ASSERT_EQUAL_STRING("the judge reads this", marked);
    expect_done("quit");
    TEST_ASSERT_EQUAL_UINT(1U, quits);
}

TEST(test_panel_frame_is_parsed_in_the_format_of_candump) {
    iw_can_frame_t frame;
    TEST_ASSERT_TRUE(sim_words_frame("10a#DEADbeef", &frame));
    TEST_ASSERT_EQUAL_HEX32(0x10AU, frame.id);
    TEST_ASSERT_EQUAL_UINT8(4U, frame.dlc);
    TEST_ASSERT_EQUAL_HEX8(0xDEU, frame.data[0]);
    TEST_ASSERT_EQUAL_HEX8(0xEFU, frame.data[3]);
    TEST_ASSERT_TRUE(sim_words_frame("0000010A#", &frame));
    TEST_ASSERT_EQUAL_HEX32(0x10AU | IW_CAN_EXTENDED, frame.id);
    TEST_ASSERT_TRUE(sim_words_frame("7FF#R", &frame));
    TEST_ASSERT_EQUAL_HEX32(0x7FFU | IW_CAN_REMOTE, frame.id);
}

TEST(test_panel_each_contact_moves_alone_the_button_moves_both) {
    static sim_button_t first;
    static sim_button_t second;
    first = (sim_button_t){.release_us = IW_NEVER};
    second = first;
    for (unsigned i = 0; i < SIM_BUTTON_CLIENTS; i++) {
        first.client[i].fd = second.client[i].fd = -1;
    }
    panel.hooks.button = &first;
    expect_refused("contact 1 press"); // The button has only one contact.
    expect_refused("contact 2 press");
    TEST_ASSERT_FALSE(first.pressed);
    panel.hooks.second = &second;
    expect_done("contact 2 press");
    TEST_ASSERT_TRUE(!first.pressed && second.pressed);
    expect_done("contact 1 unplug");
    TEST_ASSERT_TRUE(first.unplugged && !second.unplugged);
    (void)sim_panel_execute(&panel, NOW_US, "status");
    TEST_ASSERT_NOT_NULL(strstr(panel.answer, "\"estop\":\"unplugged\",\"estop2\":\"pressed\"}"));
    expect_refused("contact 2 pulse 20"); // The contact is already pressed.
    expect_done("normal");
    TEST_ASSERT_FALSE(first.pressed || second.pressed || first.unplugged || second.unplugged);
    expect_done("estop press");
    TEST_ASSERT_TRUE(first.pressed && second.pressed);
    expect_done("contact 1 release");
    TEST_ASSERT_TRUE(!first.pressed && second.pressed);
    expect_done("contact 1 pulse 20");
    TEST_ASSERT_TRUE(first.pressed && first.release_us == NOW_US + 20000U);
    expect_done("estop release");
    expect_done("estop pulse 5");
    TEST_ASSERT_TRUE(first.release_us == NOW_US + 5000U && second.release_us == NOW_US + 5000U);
}
