// SPDX-License-Identifier: MIT
// What is kept from one run to the next: the text, everything that is wrong with a text, and the process that keeps it.
#include "json/json_arena.h"
#include "ledger/keeper.h"
#include "ledger/memory.h"

#include "unity.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define BUS "unix:/tmp/\"a\" b/bus"

static gw_known_t known;
static gw_known_t got;
static char text[GW_MEMORY_SIZE];
static char reason[GW_MEMORY_REASON_SIZE];
static size_t length;
static char folder[] = "/tmp/iwheel-memory-XXXXXX";

static void fill(void) {
    memset(&known, 0, sizeof known);
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item += 2) {
        gw_known_item_t *entry = &known.item[item];
        entry->entry.state = item % 4U == 0U ? IW_LEDGER_CONFIRMED : IW_LEDGER_CONTRADICTED;
        entry->entry.evidence = item % 3U == 0U ? IW_EVIDENCE_OPERATOR : IW_EVIDENCE_BUS;
        entry->entry.figure = item % 4U == 0U ? INT32_MIN : INT32_MAX;
        entry->since_wall_us = INT64_MIN + (int64_t)item;
        memset(entry->value, '"', GW_VALUE_SIZE - 1U);
        memset(entry->word.found, '\\', GW_VALUE_SIZE - 1U);
        memset(entry->word.how, '"', item % 4U == 0U ? GW_HOW_SIZE - 1U : 0U);
    }
    known.offset[IW_LEFT] = (gw_known_offset_t){.from = IW_OFFSET_OPERATOR,
                                                .unit = IW_FORCE_DN,
                                                .offset_mN = -3276800,
                                                .drift_mN = INT32_MIN,
                                                .deviation_mN = UINT32_MAX,
                                                .samples = 255,
                                                .wall_us = INT64_MAX};
}

void setUp(void) {
    json_arena_install();
    fill();
    memset(&got, 0xA5, sizeof got);
    length = gw_memory_write(&known, BUS, text, sizeof text);
}

void tearDown(void) {}

static void refused(const char *why) {
    const gw_known_t before = got;
    TEST_ASSERT_FALSE(gw_memory_read(text, length, BUS, &got, reason));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reason, why), reason);
    TEST_ASSERT_EQUAL_MEMORY(&before, &got, sizeof got);
}

static void assert_same(void) {
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item++) {
        TEST_ASSERT_EQUAL_INT(known.item[item].entry.state, got.item[item].entry.state);
        TEST_ASSERT_EQUAL_INT(known.item[item].entry.evidence, got.item[item].entry.evidence);
        TEST_ASSERT_EQUAL_INT32(known.item[item].entry.figure, got.item[item].entry.figure);
        TEST_ASSERT_EQUAL_INT64(known.item[item].since_wall_us, got.item[item].since_wall_us);
        TEST_ASSERT_EQUAL_STRING(known.item[item].value, got.item[item].value);
        TEST_ASSERT_EQUAL_STRING(known.item[item].word.found, got.item[item].word.found);
        TEST_ASSERT_EQUAL_STRING(known.item[item].word.how, got.item[item].word.how);
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(known.offset[side].from, got.offset[side].from);
        TEST_ASSERT_EQUAL_INT(known.offset[side].unit, got.offset[side].unit);
        TEST_ASSERT_EQUAL_INT32(known.offset[side].offset_mN, got.offset[side].offset_mN);
        TEST_ASSERT_EQUAL_INT32(known.offset[side].drift_mN, got.offset[side].drift_mN);
        TEST_ASSERT_EQUAL_UINT32(known.offset[side].deviation_mN, got.offset[side].deviation_mN);
        TEST_ASSERT_EQUAL_UINT32(known.offset[side].samples, got.offset[side].samples);
        TEST_ASSERT_EQUAL_INT64(known.offset[side].wall_us, got.offset[side].wall_us);
    }
}

static void test_memory_what_is_written_is_read_back_even_at_its_extremes(void) {
    TEST_ASSERT_GREATER_THAN_UINT(0, length);
    TEST_ASSERT_TRUE_MESSAGE(gw_memory_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

static void test_memory_with_every_item_at_its_longest_fits(void) {
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; item++) {
        known.item[item] = known.item[0];
    }
    known.offset[IW_RIGHT] = known.offset[IW_LEFT];
    length = gw_memory_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_TRUE_MESSAGE(gw_memory_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

static void test_memory_of_nothing_is_a_memory(void) {
    memset(&known, 0, sizeof known);
    length = gw_memory_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_TRUE_MESSAGE(gw_memory_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

static void test_memory_too_small_a_buffer_gives_nothing(void) {
    char guarded[200];
    memset(guarded, 0x5A, sizeof guarded);
    TEST_ASSERT_EQUAL_UINT(0, gw_memory_write(&known, BUS, guarded, 100));
    TEST_ASSERT_EQUAL_HEX8(0x5A, guarded[100]);
}

static void test_memory_every_single_flipped_bit_is_damage(void) {
    for (size_t bit = 0; bit < length * 8U; bit++) {
        text[bit / 8U] = (char)(text[bit / 8U] ^ (1 << (bit % 8U)));
        TEST_ASSERT_FALSE(gw_memory_read(text, length, BUS, &got, reason));
        text[bit / 8U] = (char)(text[bit / 8U] ^ (1 << (bit % 8U)));
    }
    TEST_ASSERT_TRUE(gw_memory_read(text, length, BUS, &got, reason));
}

static void test_memory_every_shorter_or_longer_text_is_damage(void) {
    const size_t whole = length;
    for (length = 0; length < whole; length++) {
        refused("damaged");
    }
    length = whole + 1U;
    text[whole] = '\n';
    refused("damaged");
}

/// Replaces the body of the text and signs it, as somebody would who knows how.
static void forge(const char *body) {
    uint32_t sum = UINT32_MAX;
    for (const char *c = body; *c != '\0'; c++) {
        sum ^= (unsigned char)*c;
        for (unsigned bit = 0; bit < 8U; bit++) {
            sum = (sum >> 1) ^ ((sum & 1U) != 0U ? 0xEDB88320U : 0U);
        }
    }
    length = (size_t)snprintf(text, sizeof text, "%s%08x\n", body, (unsigned)~sum);
}

#define LONG "123456789012345678901234567890123456789012345678901234567890"
#define HEAD "{\"format\":\"iwheel-ledger\",\"version\":1,\"bus\":\"unix:/tmp/\\\"a\\\" b/bus\","

static void test_memory_of_another_bus_version_or_program_is_refused(void) {
    TEST_ASSERT_FALSE(gw_memory_read(text, length, "can0", &got, reason));
    TEST_ASSERT_NOT_NULL(strstr(reason, "another bus"));
    forge("{\"format\":\"iwheel-ledger\",\"version\":2,\"bus\":\"can0\",\"items\":{},\"offsets\":{}}\n");
    refused("another version");
    forge("{\"format\":\"something\",\"version\":1}\n");
    refused("no ledger");
    forge("not even JSON\n");
    refused("no ledger");
    forge("[1,2,3]\n");
    refused("no ledger");
    forge("");
    refused("damaged");
}

static void test_memory_that_holds_anything_strange_is_refused_as_a_whole(void) {
    static const char *const bodies[] = {
        HEAD "\"offsets\":{}}\n",
        HEAD "\"items\":[],\"offsets\":{}}\n",
        HEAD "\"items\":{}}\n",
        HEAD
        "\"items\":{\"speed\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"assumed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"document\",\"figure\":1,\"value\":\"\","
             "\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":2147483648,\"value\":\"\","
             "\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1.0,\"value\":\"\","
             "\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\""
             "1234567890123456789012345678901234567890\",\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1,\"more\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1,\"how\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1,\"how\":\"" LONG LONG "12345678\"}},\"offsets\":{}}\n",
        HEAD "\"items\":{},\"offsets\":{\"middle\":{}}}\n",
        HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"stored\",\"unit\":\"cN\",\"offset_mN\":1,\"drift_mN\":1,"
             "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n",
        HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"N\",\"offset_mN\":1,\"drift_mN\":1,"
             "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n",
        HEAD
        "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"cN\",\"offset_mN\":3276801,\"drift_mN\":1,"
        "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n",
        HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"cN\",\"offset_mN\":1,\"drift_mN\":1,"
             "\"deviation_mN\":-1,\"samples\":1,\"wall_us\":1}}}\n",
    };
    for (size_t i = 0; i < sizeof bodies / sizeof bodies[0]; i++) {
        forge(bodies[i]);
        refused("no gateway writes");
    }
    forge(HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"cN\",\"offset_mN\":1,\"drift_mN\":1,"
               "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n");
    TEST_ASSERT_TRUE_MESSAGE(gw_memory_read(text, length, BUS, &got, reason), reason);
}

/// As versions without the track and without a way of finding wrote it.
static void test_memory_of_before_is_taken_over_and_what_it_lacks_stays_open(void) {
    forge(HEAD "\"items\":{\"wheel_radius\":{\"state\":\"confirmed\",\"evidence\":\"operator\",\"figure\":0,"
               "\"value\":\"192\",\"found\":\"192\",\"since_wall_us\":1}},\"offsets\":{}}\n");
    TEST_ASSERT_TRUE_MESSAGE(gw_memory_read(text, length, BUS, &got, reason), reason);
    TEST_ASSERT_EQUAL_INT(IW_LEDGER_CONFIRMED, got.item[IW_LEDGER_WHEEL_RADIUS].entry.state);
    TEST_ASSERT_EQUAL_STRING("192", got.item[IW_LEDGER_WHEEL_RADIUS].word.found);
    TEST_ASSERT_EQUAL_STRING("", got.item[IW_LEDGER_WHEEL_RADIUS].word.how);
    TEST_ASSERT_EQUAL_INT(IW_LEDGER_ASSUMED, got.item[IW_LEDGER_TRACK].entry.state);
}

static void test_memory_tells_how_only_if_it_was_told(void) {
    memset(&known, 0, sizeof known);
    gw_known_item_t *entry = &known.item[IW_LEDGER_TRACK];
    entry->entry = (iw_ledger_entry_t){IW_LEDGER_CONFIRMED, IW_EVIDENCE_OPERATOR, 0};
    length = gw_memory_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_NULL(strstr(text, "\"how\""));
    (void)snprintf(entry->word.how, sizeof entry->word.how, "bringup: 3 full turns by hand");
    length = gw_memory_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "\"how\":\"bringup: 3 full turns by hand\""));
    TEST_ASSERT_TRUE_MESSAGE(gw_memory_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

static void test_memory_file_name_is_one_plain_word(void) {
    char name[64];
    gw_memory_name("can0", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("ledger-can0", name);
    gw_memory_name("unix:/run/a b/../bus", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("ledger-unix__run_a_b_.._bus", name);
}

// The keeper ----------------------------------------------------------------------------------------------------------

static gw_keeper_t keeper;
static char heard[GW_KEEPER_TEXT_MAX];
static int error;

static gw_keeper_news_t next_news(void) {
    gw_keeper_news_t news = GW_KEEPER_NO_NEWS;
    struct pollfd wait = {.fd = keeper.fd, .events = POLLIN};
    while (news == GW_KEEPER_NO_NEWS && poll(&wait, 1, 5000) == 1) {
        news = gw_keeper_hear(&keeper, heard, &length, &error);
    }
    return news;
}

static void open_keeper(const char *directory, gw_keeper_news_t expected) {
    error = 0;
    TEST_ASSERT_EQUAL_INT(0, gw_keeper_open(&keeper, directory, "file"));
    TEST_ASSERT_FALSE_MESSAGE(gw_keeper_write(&keeper, "x", 1), "not before it has answered");
    TEST_ASSERT_EQUAL_INT(expected, next_news());
}

static char *in_folder(const char *name) {
    static char path[128];
    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void put_file(const char *name, const char *content) {
    FILE *file = fopen(in_folder(name), "w");
    TEST_ASSERT_NOT_NULL(file);
    (void)fputs(content, file);
    (void)fclose(file);
}

static void assert_file(const char *name, const char *content) {
    char found[64] = "";
    FILE *file = fopen(in_folder(name), "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, name);
    (void)!fread(found, 1, sizeof found - 1U, file);
    (void)fclose(file);
    TEST_ASSERT_EQUAL_STRING(content, found);
}

static void test_keeper_writes_reads_back_and_sets_aside(void) {
    open_keeper(folder, GW_KEEPER_ABSENT);
    TEST_ASSERT_TRUE(gw_keeper_write(&keeper, "one", 3));
    TEST_ASSERT_FALSE_MESSAGE(gw_keeper_write(&keeper, "two", 3), "one at a time");
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_WRITTEN, next_news());
    assert_file("file", "one");
    gw_keeper_close(&keeper);
    open_keeper(folder, GW_KEEPER_READ);
    TEST_ASSERT_EQUAL_UINT(3, length);
    TEST_ASSERT_EQUAL_MEMORY("one", heard, 3);
    gw_keeper_set_aside(&keeper);
    TEST_ASSERT_TRUE(gw_keeper_write(&keeper, "two", 3));
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_WRITTEN, next_news());
    assert_file("file.damaged", "one");
    assert_file("file", "two");
    TEST_ASSERT_EQUAL_INT(-1, access(in_folder("file.new"), F_OK));
    gw_keeper_close(&keeper);
}

static void test_keeper_without_its_directory_fails_and_recovers_when_it_comes(void) {
    char missing[64];
    (void)snprintf(missing, sizeof missing, "%s/later", folder);
    open_keeper(missing, GW_KEEPER_FAILED);
    TEST_ASSERT_EQUAL_INT(ENOENT, error);
    TEST_ASSERT_TRUE(gw_keeper_write(&keeper, "one", 3));
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_FAILED, next_news());
    TEST_ASSERT_EQUAL_INT(ENOENT, error);
    TEST_ASSERT_EQUAL_INT(0, mkdir(missing, 0700));
    TEST_ASSERT_TRUE(gw_keeper_write(&keeper, "two", 3));
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_WRITTEN, next_news());
    assert_file("later/file", "two");
    gw_keeper_close(&keeper);
    (void)unlink(in_folder("later/file"));
    (void)rmdir(missing);
}

static void test_keeper_takes_no_link_pipe_or_giant_for_its_file(void) {
    put_file("other", "precious");
    (void)unlink(in_folder("file"));
    TEST_ASSERT_EQUAL_INT(0, symlink("other", in_folder("file")));
    open_keeper(folder, GW_KEEPER_BAD);
    TEST_ASSERT_TRUE(gw_keeper_write(&keeper, "new", 3));
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_WRITTEN, next_news());
    assert_file("other", "precious");
    assert_file("file", "new");
    gw_keeper_close(&keeper);
    (void)unlink(in_folder("file"));
    TEST_ASSERT_EQUAL_INT(0, mkfifo(in_folder("file"), 0600));
    open_keeper(folder, GW_KEEPER_BAD);
    gw_keeper_close(&keeper);
    (void)unlink(in_folder("file"));
    put_file("file", "");
    TEST_ASSERT_EQUAL_INT(0, truncate(in_folder("file"), (off_t)GW_KEEPER_TEXT_MAX + 1));
    open_keeper(folder, GW_KEEPER_BAD);
    TEST_ASSERT_EQUAL_INT(EFBIG, error);
    gw_keeper_close(&keeper);
    (void)unlink(in_folder("file"));
}

static void test_keeper_that_cannot_write_keeps_the_old_file(void) {
    put_file("file", "old");
    TEST_ASSERT_EQUAL_INT(0, symlink("/dev/full", in_folder("file.new")));
    open_keeper(folder, GW_KEEPER_READ);
    TEST_ASSERT_TRUE(gw_keeper_write(&keeper, "new", 3));
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_FAILED, next_news()); // It does not follow the link.
    assert_file("file", "old");
    gw_keeper_close(&keeper);
}

static void test_keeper_that_died_is_noticed_and_nothing_waits_for_it(void) {
    TEST_ASSERT_EQUAL_INT(0, gw_keeper_open(&keeper, folder, "file"));
    (void)next_news();
    (void)shutdown(keeper.fd, SHUT_RDWR);
    (void)gw_keeper_write(&keeper, "new", 3);
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_GONE, next_news());
    gw_keeper_close(&keeper);
    TEST_ASSERT_FALSE(gw_keeper_write(&keeper, "new", 3));
    TEST_ASSERT_EQUAL_INT(GW_KEEPER_NO_NEWS, gw_keeper_hear(&keeper, heard, &length, &error));
}

int main(void) {
    UNITY_BEGIN();
    if (mkdtemp(folder) == NULL) {
        return 1;
    }
    RUN_TEST(test_memory_what_is_written_is_read_back_even_at_its_extremes);
    RUN_TEST(test_memory_with_every_item_at_its_longest_fits);
    RUN_TEST(test_memory_of_nothing_is_a_memory);
    RUN_TEST(test_memory_too_small_a_buffer_gives_nothing);
    RUN_TEST(test_memory_every_single_flipped_bit_is_damage);
    RUN_TEST(test_memory_every_shorter_or_longer_text_is_damage);
    RUN_TEST(test_memory_of_another_bus_version_or_program_is_refused);
    RUN_TEST(test_memory_that_holds_anything_strange_is_refused_as_a_whole);
    RUN_TEST(test_memory_of_before_is_taken_over_and_what_it_lacks_stays_open);
    RUN_TEST(test_memory_tells_how_only_if_it_was_told);
    RUN_TEST(test_memory_file_name_is_one_plain_word);
    RUN_TEST(test_keeper_writes_reads_back_and_sets_aside);
    RUN_TEST(test_keeper_without_its_directory_fails_and_recovers_when_it_comes);
    RUN_TEST(test_keeper_takes_no_link_pipe_or_giant_for_its_file);
    RUN_TEST(test_keeper_that_cannot_write_keeps_the_old_file);
    RUN_TEST(test_keeper_that_died_is_noticed_and_nothing_waits_for_it);
    (void)unlink(in_folder("file"));
    (void)unlink(in_folder("file.new"));
    (void)unlink(in_folder("file.damaged"));
    (void)unlink(in_folder("other"));
    (void)rmdir(folder);
    return UNITY_END();
}
