// SPDX-License-Identifier: MIT
#include "why.h"

#include "decode/frame.h"
#include "text/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <time.h>

static void print_when(const json_t *why) {
    char wall[TEXT_CELL] = "--";
    char age[TEXT_CELL];
    struct tm local;
    const json_t *wall_us = json_object_get(why, "wall_us");
    const json_t *age_ms = json_object_get(why, "age_ms");
    if (json_is_integer(wall_us)) {
        const time_t seconds = (time_t)(json_integer_value(wall_us) / 1000000);
        if (localtime_r(&seconds, &local) != NULL) {
            (void)strftime(wall, sizeof wall, "%Y-%m-%d %H:%M:%S", &local);
        }
    }
    (void)printf("at %s", wall);
    if (age_ms != NULL) {
        text_decimal(age_ms, 3, "s", age);
        (void)printf(", %s ago", age);
    }
    (void)printf("; %s\n", json_is_true(json_object_get(why, "latched")) ? "it latched" : "it did not latch");
}

bool why_print_stop(const json_t *why) {
    const char *sentence = json_string_value(json_object_get(why, "sentence"));
    if (sentence == NULL || sentence[0] == '\0') {
        (void)puts("no stop since the gateway's start");
        return false;
    }
    text_safe(sentence, stdout);
    (void)putchar('\n');
    if (!json_is_integer(json_object_get(why, "at_us")) && json_object_get(why, "at_us") != NULL) {
        return false; // Nothing happened: the sentence says so.
    }
    print_when(why);
    return true;
}

void why_print_frame(const candump_t *frame, int64_t since_us) {
    char since[32];
    decoded_t decoded;
    iw_config_t config;
    const iw_can_frame_t core = candump_to_core(frame);
    const int64_t size_us = (since_us < 0) ? -since_us : since_us;
    iw_config_default(&config);
    decode_fields(&core, &config, &decoded);
    (void)snprintf(since, sizeof since, "%c%" PRId64 ".%01" PRId64 " ms", (since_us < 0) ? '-' : '+', size_us / 1000,
                   size_us % 1000 / 100);
    frame_print(since, frame, &decoded);
}

void why_print_moment(void) {
    (void)puts("------ stop ---------------------------------------------------------------");
}

static void print_told(const json_t *told, int64_t stop_us) {
    int64_t at_us = 0;
    const candump_t frame = frame_from_json(told, &at_us);
    why_print_frame(&frame, at_us - stop_us);
}

void why_print_told(const json_t *why, size_t most) {
    const json_t *before = json_object_get(why, "frames_before");
    const json_t *after = json_object_get(why, "frames_after");
    const size_t count = json_array_size(before);
    const int64_t stop_us = json_integer_value(json_object_get(why, "at_us"));
    if (count + json_array_size(after) == 0U || most == 0U) {
        return;
    }
    (void)putchar('\n');
    for (size_t i = (count > most) ? count - most : 0U; i < count; i++) {
        print_told(json_array_get(before, i), stop_us);
    }
    why_print_moment();
    for (size_t i = 0; i < json_array_size(after) && i < most; i++) {
        print_told(json_array_get(after, i), stop_us);
    }
}
