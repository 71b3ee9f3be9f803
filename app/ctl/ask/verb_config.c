// SPDX-License-Identifier: MIT
// Configuration of a gateway that stores it itself: a board behind iwheel-serial.
#include "talk/ctl.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"

#include <string.h>

static void print_pair(const char *key, const char *value) {
    text_safe(key, stdout);
    (void)fputs((value != NULL) ? " = " : " is not set", stdout);
    text_safe((value != NULL) ? value : "", stdout);
    (void)putchar('\n');
}

/// Prints "drive.lease_ms = 300" for one key or all keys, and whether the configuration is in force.
static void print_keys(json_t *reply, const char *only) {
    size_t i = 0;
    json_t *entry = NULL;
    json_array_foreach(json_object_get(reply, "keys"), i, entry) {
        const char *key = text_word(entry, "key");
        if (only == NULL || strcmp(key, only) == 0) {
            print_pair(key, json_string_value(json_object_get(entry, "value")));
        }
    }
    if (json_is_true(json_object_get(reply, "staged"))) {
        (void)puts("staged, and not in force yet; next: iwheelctl config commit (or iwheelctl config discard)");
    }
}

/// Returns the request for the words; NULL after it has reported what is wrong with them. `*out_only` is the only key
/// to print.
static json_t *compose(int count, char **words, const char **out_only) {
    const char *what = (count > 0) ? words[0] : "show";
    const bool sets = strcmp(what, "set") == 0;
    const bool commits = strcmp(what, "commit") == 0;
    if (!sets && !commits && strcmp(what, "show") != 0 && strcmp(what, "discard") != 0) {
        (void)ctl_fail(CTL_USAGE, "config \"%s\": unknown action; write show, set KEY VALUE, commit or discard", what);
        return NULL;
    }
    if (sets && count != 3) {
        (void)ctl_fail(CTL_USAGE,
                       "config set needs a key and its value, such as: iwheelctl config set drive.lease_ms 300");
        return NULL;
    }
    if (!sets && !words_at_most("config", count, 1, words)) {
        return NULL;
    }
    if (sets) {
        json_t *request = json_pack("{s:s,s:s,s:s}", "cmd", "config", "key", words[1], "value", words[2]);
        *out_only = words[1];
        if (request == NULL) {
            (void)ctl_fail(CTL_USAGE, "config: key and value must be readable text (UTF-8)");
        }
        return request;
    }
    return (commits || strcmp(what, "discard") == 0)
               ? json_pack("{s:s,s:b}", "cmd", "config", "commit", commits ? 1 : 0)
               : json_pack("{s:s}", "cmd", "config");
}

int verb_config(ctl_t *self, int count, char **words) {
    const char *only = NULL;
    json_t *reply = NULL;
    json_t *request = compose(count, words, &only);
    if (request == NULL) {
        return CTL_USAGE;
    }
    const int code = ctl_ask(self, request, &reply);
    if (code != CTL_OK || self->json) {
        json_decref(reply);
        return code;
    }
    if (json_is_true(json_object_get(reply, "restarts"))) {
        (void)puts("committed: the board restarts with it and closes its clients, which connect again");
    } else if (count > 0 && strcmp(words[0], "discard") == 0) {
        (void)puts("discarded: the staged values are dropped");
    } else {
        print_keys(reply, only);
    }
    json_decref(reply);
    return code;
}
