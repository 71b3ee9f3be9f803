// SPDX-License-Identifier: MIT
// The help texts are files. A text that the code contains as well must be the same in both.
#include "config/gateway_config.h"
#include "help.h"
#include "mqtt_settings.h"
#include "ros_settings.h"
#include "serial_settings.h"
#include "text/duration.h"

#include "iwheel_northbound/words.h"

#include "gateway_texts.h"
#include "help_texts.h"
#include "mqtt_texts.h"
#include "ros_texts.h"
#include "serial_texts.h"

#ifdef WITH_WEB
#include "web_settings.h"
#include "web_texts.h"
#endif

#include "unit.h"

#include <stdio.h>
#include <string.h>

static void expect_said(const char *text, const char *what) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, what), what);
}

TEST(test_help_names_the_configuration_that_is_read) {
    expect_said(gateway_help, "configuration (" GATEWAY_CONFIG_PATH ", if it exists)\n");
    expect_said(help_doctor, "default " GATEWAY_CONFIG_PATH ", if it exists\n");
    expect_said(help_bringup, GATEWAY_CONFIG_PATH ", if it exists)\n");
    expect_said(mqtt_help, "configuration (" MQTT_SETTINGS_PATH ", if it exists)\n");
    expect_said(mqtt_fleet_help, "(" FLEET_SETTINGS_PATH ", if it exists)\n");
    expect_said(help_fleet, FLEET_SETTINGS_PATH);
    expect_said(ros_help, "configuration (" ROS_SETTINGS_PATH ", if it exists)\n");
    expect_said(serial_help, "configuration (" SERIAL_SETTINGS_PATH ", if it exists)\n");
#ifdef WITH_WEB
    expect_said(web_help, "configuration (" WEB_SETTINGS_PATH ", if it exists)\n");
#endif
}

/// The comment of each key is compiled in from the file in share/; section and name select it.
static void expect_comments(const settings_form_t *form) {
    for (size_t i = 0; i < form->count; i++) {
        const settings_key_t *key = &form->keys[i];
        const settings_help_t *help = form->help;
        while (help->section != NULL &&
               (strcmp(help->section, key->section) != 0 || strcmp(help->key, key->key) != 0)) {
            help++;
        }
        TEST_ASSERT_NOT_NULL_MESSAGE(help->text, key->key);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("; ", help->text, 2, key->key);
        TEST_ASSERT_EQUAL_CHAR_MESSAGE('\n', help->text[strlen(help->text) - 1U], key->key);
    }
}

TEST(test_help_of_each_key_is_in_its_configuration_file) {
    expect_comments(&mqtt_settings_form);
    expect_comments(&ros_settings_form);
    expect_comments(&serial_settings_form);
#ifdef WITH_WEB
    expect_comments(&web_settings_form);
#endif
}

TEST(test_help_durations_have_the_form_that_is_parsed) {
    expect_said(help_drive, "--for TIME       " DURATION_FORM ";");
    expect_said(help_record, "--for TIME  " DURATION_FORM " (");
}

/// Returns the verb at that place in the page of the program, or a null pointer after the last one.
static const verb_t *verb_at(unsigned number) {
    const char *name = help_find("help")->choice(number);
    return (name != NULL) ? help_find(name) : NULL;
}

/// Shell completion and the page of the program read the strings and the summary at fixed places of the page of a verb.
TEST(test_help_of_each_verb_has_usage_and_summary_in_their_places) {
    const verb_t *verb = NULL;
    for (unsigned i = 0; (verb = verb_at(i)) != NULL; i++) {
        char begin[64];
        char summary[64];
        const size_t length = (size_t)snprintf(begin, sizeof begin, "Usage: iwheelctl [--socket PATH]%s %s",
                                               (verb->no_json == NULL) ? " [--json]" : "", verb->name);
        (void)snprintf(summary, sizeof summary, "\n\n%s: ", verb->name);
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE(begin, verb->page, length, verb->name);
        TEST_ASSERT_NOT_NULL_MESSAGE(strchr(" \n", verb->page[length]), verb->name);
        TEST_ASSERT_EQUAL_PTR_MESSAGE(strstr(verb->page, summary), strstr(verb->page, "\n\n"), verb->name);
        TEST_ASSERT_EQUAL_CHAR_MESSAGE('\n', verb->page[strlen(verb->page) - 1U], verb->name);
    }
}

TEST(test_help_fits_a_terminal_of_80_columns) {
    const verb_t *verb = NULL;
    for (unsigned i = 0; (verb = verb_at(i)) != NULL; i++) {
        for (const char *line = verb->page; *line != '\0'; line += strcspn(line, "\n") + 1U) {
            TEST_ASSERT_LESS_OR_EQUAL_size_t_MESSAGE(80U, strcspn(line, "\n"), line);
        }
    }
}

/// The page contains each word of the choice, in its list or in the usage.
TEST(test_help_names_each_choice_of_an_argument) {
    const verb_t *verb = NULL;
    unsigned choices = 0;
    for (unsigned i = 0; (verb = verb_at(i)) != NULL; i++) {
        for (unsigned k = 0; verb->choice != NULL && verb->choice(k) != NULL && strcmp(verb->name, "help") != 0; k++) {
            expect_said(verb->page, verb->choice(k));
            choices++;
        }
    }
    TEST_ASSERT_GREATER_THAN(IW_ASSUMPTION_ITEMS + IWN_TOPICS, choices);
}

TEST(test_help_of_confirm_lists_exactly_the_items) {
    char expected[512] = "\nITEM  ";
    char found[512] = "";
    for (unsigned i = 0; i < IW_ASSUMPTION_ITEMS; i++) {
        (void)snprintf(&expected[strlen(expected)], sizeof expected - strlen(expected), "%s%s", (i > 0U) ? ", " : "",
                       iwn_assumption_item_name((iw_assumption_item_t)i));
    }
    // Continuation lines are indented.
    size_t used = 0;
    for (const char *at = strstr(help_confirm, "\nITEM  "); at != NULL && at[0] != '\0' && used + 1U < sizeof found;) {
        if (strncmp(at, "\n      ", 7U) == 0) {
            found[used++] = ' ';
            at += 7;
        } else {
            found[used++] = *at++;
        }
    }
    TEST_ASSERT_EQUAL_STRING(strcat(expected, "\n"), found);
}
