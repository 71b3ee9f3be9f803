// SPDX-License-Identifier: MIT
// A file of the page: compressed for clients that accept it, and not sent again to clients that have it.
#include "page_file.h"

#include "folder.h"
#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char hello[] = "hello\n";
/// Output of `printf 'hello\n' | gzip -9n`.
static const unsigned char packed[] = {0x1f, 0x8b, 0x08, 0x00, 0x00, 0x00, 0x00, 0x00, 0x02, 0x03, 0xcb, 0x48, 0xcd,
                                       0xc9, 0xc9, 0xe7, 0x02, 0x00, 0x20, 0x30, 0x3a, 0x36, 0x06, 0x00, 0x00, 0x00};
static char path[64];
static char packed_path[64];
static page_file_t file;

void setUp(void) {
    memset(&file, 0, sizeof file);
    folder_make();
    (void)snprintf(path, sizeof path, "%s/page.js", folder);
    (void)snprintf(packed_path, sizeof packed_path, "%s/page.js.gz", folder);
    file_put(path, hello, sizeof hello - 1U);
    file_put(packed_path, packed, sizeof packed);
}

void tearDown(void) {
    page_file_free(&file);
    folder_remove();
}

TEST(test_page_file_is_read_with_its_packed_form_and_two_tags) {
    TEST_ASSERT_TRUE(page_file_read(&file, path));
    TEST_ASSERT_EQUAL_STRING(hello, file.plain.text);
    TEST_ASSERT_EQUAL_size_t(sizeof packed, file.packed.length);
    TEST_ASSERT_EQUAL_STRING("\"5891b5b522d5df086d0ff0b110fbd9d2\"", file.plain.tag);
    TEST_ASSERT_EQUAL_size_t(34, strlen(file.packed.tag));
    TEST_ASSERT_TRUE(strcmp(file.plain.tag, file.packed.tag) != 0);
}

TEST(test_page_file_missing_is_refused) {
    (void)unlink(path);
    TEST_ASSERT_FALSE(page_file_read(&file, path));
}

TEST(test_page_file_packed_form_of_other_bytes_is_ignored) {
    unsigned char other[sizeof packed];
    for (size_t i = 0; i < 10U; i++) {
        static const size_t at[] = {0, 1, 18, 19, 20, 21, 22, 23, 24, 25};
        memcpy(other, packed, sizeof packed);
        other[at[i]] ^= 1U;
        file_put(packed_path, other, sizeof other);
        TEST_ASSERT_TRUE(page_file_read(&file, path));
        TEST_ASSERT_NULL(file.packed.text);
        page_file_free(&file);
    }
    file_put(packed_path, packed, 8);
    TEST_ASSERT_TRUE(page_file_read(&file, path));
    TEST_ASSERT_NULL(file.packed.text);
    page_file_free(&file);
    (void)unlink(packed_path);
    TEST_ASSERT_TRUE(page_file_read(&file, path));
    TEST_ASSERT_EQUAL_PTR(&file.plain, page_file_choose(&file, "gzip"));
}

TEST(test_page_file_packed_form_is_chosen_by_accepted_encodings) {
    static const char *const yes[] = {"gzip",    "GZIP",       "deflate, gzip;q=0.5, br",
                                      "br,gzip", "gzip;q=1.0", " gzip ; q=0.001"};
    static const char *const no[] = {"",        "identity",        "gzip;q=0", "gzip;q=0.000, deflate;q=1",
                                     "xgzip",   "gzipped",         "deflate",  "br;q=1, x-gzip",
                                     "gzip;q=", "gzip; q=0 , br=9"};
    TEST_ASSERT_TRUE(page_file_read(&file, path));
    for (size_t i = 0; i < sizeof yes / sizeof yes[0]; i++) {
        TEST_ASSERT_EQUAL_PTR_MESSAGE(&file.packed, page_file_choose(&file, yes[i]), yes[i]);
    }
    for (size_t i = 0; i < sizeof no / sizeof no[0]; i++) {
        TEST_ASSERT_EQUAL_PTR_MESSAGE(&file.plain, page_file_choose(&file, no[i]), no[i]);
    }
    TEST_ASSERT_EQUAL_PTR(&file.plain, page_file_choose(&file, NULL));
}

TEST(test_page_file_copy_is_recognized_by_its_tag_only) {
    char list[128];
    TEST_ASSERT_TRUE(page_file_read(&file, path));
    (void)snprintf(list, sizeof list, "\"other\", W/%s", file.plain.tag);
    TEST_ASSERT_TRUE(page_body_is_known(&file.plain, list));
    TEST_ASSERT_FALSE(page_body_is_known(&file.packed, list));
    TEST_ASSERT_FALSE(page_body_is_known(&file.plain, "\"5891b5b522d5df08\""));
    TEST_ASSERT_FALSE(page_body_is_known(&file.plain, NULL));
    file.plain.tag[0] = '\0';
    TEST_ASSERT_FALSE(page_body_is_known(&file.plain, list));
}
