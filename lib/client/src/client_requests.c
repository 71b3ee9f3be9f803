// SPDX-License-Identifier: MIT
// Composes, numbers and sends requests, and waits for replies.
#include "connection.h"

#include "iwheel_northbound/text.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static bool is_command(iwc_span_t cmd, const char *const *names) {
    for (; *names != NULL; names++) {
        if (iwc_json_is_text(cmd, *names)) {
            return true;
        }
    }
    return false;
}

static bool is_driving(iwc_span_t cmd) {
    static const char *const driving[] = {"drive", "twist", NULL};
    return is_command(cmd, driving);
}

/// Returns true for a command that is safe with a newer protocol. The same command may have another meaning there, so
/// the library sends none that moves or changes anything.
static bool is_harmless(iwc_span_t cmd) {
    static const char *const harmless[] = {"hello",  "status", "why",        "watch",     "stop",
                                           "disarm", "estop",  "recordings", "recording", NULL};
    return is_command(cmd, harmless);
}

/// Returns a free entry for the id of one more drive command; NULL: none. The limit prevents a gateway that hung from
/// receiving many old commands when it resumes.
static int64_t *place_to_drive(iwc_t *self) {
    for (int attempt = 0; attempt < 2; attempt++) {
        for (size_t i = 0; i < IWC_DRIVES_MAX; i++) {
            if (self->driven[i] == 0) {
                return &self->driven[i];
            }
        }
        (void)iwc_fill(self); // Replies may already be waiting in the socket.
    }
    return NULL;
}

/// Writes the request with its id to `line`, whose size is IWC_REQUEST_MAX + 2. Returns the length; 0: it is not a
/// request, or too long.
static size_t number_it(char *line, const char *request, int64_t id) {
    const size_t length = strlen(request);
    if (!iwc_json_is_object(request, length) || request[0] != '{' || memchr(request, '\n', length) != NULL) {
        return 0;
    }
    const int n = snprintf(line, IWC_REQUEST_MAX + 2U, "{\"id\":%lld,%s\n", (long long)id, request + 1);
    return (n > 0 && (size_t)n <= IWC_REQUEST_MAX + 1U) ? (size_t)n : 0U;
}

static iwc_result_t send_as(iwc_t *self, const char *request, int64_t id, int64_t deadline_us) {
    char line[IWC_REQUEST_MAX + 2U];
    int64_t none = 0;
    int64_t *place = &none;
    if (self->fd < 0 || getpid() != self->owner) {
        return (self->over == IWC_OK) ? IWC_CLOSED : self->over;
    }
    const size_t length = number_it(line, request, id);
    const iwc_span_t whole = {request, strlen(request)};
    const iwc_span_t cmd = (length > 0) ? iwc_json_find(whole, "cmd") : (iwc_span_t){NULL, 0};
    if (cmd.at == NULL || iwc_json_find(whole, "id").at != NULL) {
        return IWC_INVALID;
    }
    if (self->newer && !is_harmless(cmd)) {
        return IWC_NEWER;
    }
    if (is_driving(cmd)) {
        place = place_to_drive(self);
        if (place == NULL || self->fd < 0) {
            return (self->fd < 0) ? self->over : IWC_FULL;
        }
    }
    const iwc_result_t result = iwc_put(self, line, length, deadline_us);
    if (result == IWC_OK) {
        *place = id;
    }
    return result;
}

iwc_result_t iwc_send(iwc_t *self, const char *request, int timeout_ms, int64_t *out_id) {
    self->requests++;
    const int64_t id = 2 * self->requests - 1;
    if (out_id != NULL) {
        *out_id = id;
    }
    return iwc_note(self, send_as(self, request, id, iwc_deadline_us(timeout_ms)));
}

static iwc_result_t await_answer(iwc_t *self, int64_t deadline_us) {
    for (;;) {
        iwc_result_t result = iwc_fill(self);
        if (self->answer > 0) {
            return IWC_OK;
        }
        if (result == IWC_TIMEOUT) {
            result = iwc_await(self, POLLIN, deadline_us);
        } else if (result == IWC_OK && iwc_now_us() >= deadline_us) {
            result = IWC_TIMEOUT; // Events continue to arrive, but not the reply.
        }
        if (result != IWC_OK) {
            return result;
        }
    }
}

iwc_result_t iwc_ask(iwc_t *self, const char *request, int timeout_ms, iwc_message_t *out_reply) {
    const int64_t deadline_us = iwc_deadline_us(timeout_ms);
    self->requests++;
    self->awaited = 2 * self->requests;
    self->answer = 0;
    iwc_result_t result = send_as(self, request, self->awaited, deadline_us);
    if (result == IWC_OK) {
        result = await_answer(self, deadline_us);
    }
    self->awaited = 0;
    iwc_message_t reply;
    if (result != IWC_OK || !iwc_reply(self, &reply)) {
        return iwc_note(self, result);
    }
    if (out_reply != NULL) {
        *out_reply = reply;
    }
    if (iwc_truth(&reply, "ok").value == 1) {
        return IWC_OK;
    }
    iwc_store_refusal(self, &reply);
    return iwc_note(self, IWC_REFUSED);
}

bool iwc_reply(const iwc_t *self, iwc_message_t *out_reply) {
    if (self->answer == 0) {
        return false;
    }
    *out_reply = (iwc_message_t){.text = self->line, .length = self->answer};
    out_reply->id = iwc_integer(out_reply, "id").value;
    return true;
}

/// Size of the longest request of this library: `estop` with a reason in which every character is escaped.
#define TEXT_SIZE        640U
#define NAME_MAX_BYTES   64U
#define REASON_MAX_BYTES 200U

typedef struct {
    char text[TEXT_SIZE];
    size_t used;
} request_t;

static void add(request_t *self, const char *text) {
    const size_t length = strlen(text);
    if (self->used + length < TEXT_SIZE) {
        memcpy(self->text + self->used, text, length + 1U);
        self->used += length;
    }
}

static request_t begin_request(const char *cmd) {
    request_t request = {.used = 0};
    add(&request, "{\"cmd\":\"");
    add(&request, cmd);
    add(&request, "\"");
    return request;
}

static void add_integer(request_t *self, const char *key, int64_t value) {
    char text[48];
    (void)snprintf(text, sizeof text, ",\"%s\":%lld", key, (long long)value);
    add(self, text);
}

static void add_known(request_t *self, const char *key, iwc_value_t value) {
    if (value.known) {
        add_integer(self, key, value.value);
    }
}

/// Returns false if a request may not contain the text.
static bool add_text(request_t *self, const char *key, const char *text, size_t most) {
    if (text == NULL) {
        return true;
    }
    if (strlen(text) > most) {
        return false;
    }
    add(self, ",\"");
    add(self, key);
    add(self, "\":\"");
    for (; *text != '\0'; text++) {
        const char piece[3] = {'\\', *text, '\0'};
        if ((unsigned char)*text < 0x20U || *text == 0x7F) {
            return false;
        }
        add(self, (*text == '"' || *text == '\\') ? piece : piece + 1);
    }
    add(self, "\"");
    return true;
}

iwc_result_t iwc_status(iwc_t *self, int timeout_ms, iwc_state_t *out_state) {
    iwc_message_t reply;
    const iwc_result_t result = iwc_ask(self, "{\"cmd\":\"status\"}", timeout_ms, &reply);
    if (result == IWC_OK && !iwc_state(self, &reply, out_state)) {
        return iwc_note(self, IWC_GARBLED);
    }
    return result;
}

iwc_result_t iwc_watch(iwc_t *self, unsigned topics, int rate_hz, int timeout_ms) {
    static const char *const names[] = {"state", "bus", "estop", "lease", "stop", "force", "frame"};
    const size_t count = sizeof names / sizeof names[0];
    request_t request = begin_request("watch");
    if (topics >= 1U << count || rate_hz < 1 || rate_hz > 100) {
        return iwc_note(self, IWC_INVALID);
    }
    add_integer(&request, "rate_hz", rate_hz);
    add(&request, ",\"topics\":[");
    const char *comma = "\"";
    for (size_t i = 0; i < count; i++) {
        if ((topics & (1U << i)) != 0U) {
            add(&request, comma);
            add(&request, names[i]);
            comma = "\",\"";
        }
    }
    add(&request, (topics != 0U) ? "\"]}" : "]}");
    return iwc_ask(self, request.text, timeout_ms, NULL);
}

static int32_t number_at(const iwc_message_t *reply, const char *path) {
    return (int32_t)iwc_integer(reply, path).value;
}

iwc_result_t iwc_arm(iwc_t *self, const char *name, bool takeover, int timeout_ms, iwc_terms_t *out_terms) {
    const iwc_arm_t arm = {.name = name, .takeover = takeover};
    return iwc_arm_as(self, &arm, timeout_ms, out_terms, NULL);
}

iwc_result_t iwc_arm_as(iwc_t *self, const iwc_arm_t *arm, int timeout_ms, iwc_terms_t *out_terms,
                        char out_key[IWC_KEY_SIZE]) {
    iwc_message_t reply;
    request_t request = begin_request("arm");
    if (!add_text(&request, "name", arm->name, NAME_MAX_BYTES)) {
        return iwc_note(self, IWC_INVALID);
    }
    add_known(&request, "t_us", arm->t_us);
    add(&request, arm->takeover ? ",\"takeover\":true}" : "}");
    const iwc_result_t result = iwc_ask(self, request.text, timeout_ms, &reply);
    if (result == IWC_OK && out_terms != NULL) {
        *out_terms = (iwc_terms_t){number_at(&reply, "lease_ms"), number_at(&reply, "first_lease_ms"),
                                   number_at(&reply, "stop_budget_ms"), number_at(&reply, "stop_budget_mm")};
    }
    if (result == IWC_OK && out_key != NULL) {
        (void)iwc_text(&reply, "key", out_key, IWC_KEY_SIZE);
    }
    return result;
}

/// Sends a request that drives.
static iwc_result_t command(iwc_t *self, const char *request, int timeout_ms, iwc_applied_t *out_applied) {
    iwc_message_t reply;
    if (timeout_ms == 0) {
        return iwc_send(self, request, 0, NULL);
    }
    const iwc_result_t result = iwc_ask(self, request, timeout_ms, &reply);
    if (result == IWC_OK && out_applied != NULL) {
        *out_applied = (iwc_applied_t){number_at(&reply, "left_mm_s"), number_at(&reply, "right_mm_s"),
                                       number_at(&reply, "left_mA"), number_at(&reply, "right_mA"),
                                       iwc_truth(&reply, "limited").value == 1};
    }
    return result;
}

iwc_result_t iwc_drive(iwc_t *self, const iwc_drive_t *drive, int timeout_ms, iwc_applied_t *out_applied) {
    return iwc_drive_as(self, drive, NULL, timeout_ms, out_applied);
}

iwc_result_t iwc_drive_as(iwc_t *self, const iwc_drive_t *drive, const char *key, int timeout_ms,
                          iwc_applied_t *out_applied) {
    request_t request = begin_request("drive");
    if (!add_text(&request, "key", key, IWC_KEY_SIZE - 1U)) {
        return iwc_note(self, IWC_INVALID);
    }
    add_integer(&request, "left_mm_s", drive->left_mm_s);
    add_integer(&request, "right_mm_s", drive->right_mm_s);
    if (drive->has_current) {
        add_integer(&request, "left_mA", drive->left_mA);
        add_integer(&request, "right_mA", drive->right_mA);
    }
    add(&request, "}");
    return command(self, request.text, timeout_ms, out_applied);
}

iwc_result_t iwc_twist(iwc_t *self, int32_t v_mm_s, int32_t yaw_mrad_s, int timeout_ms, iwc_applied_t *out_applied) {
    const iwc_twist_t twist = {v_mm_s, yaw_mrad_s};
    return iwc_twist_as(self, &twist, NULL, timeout_ms, out_applied);
}

iwc_result_t iwc_twist_as(iwc_t *self, const iwc_twist_t *twist, const char *key, int timeout_ms,
                          iwc_applied_t *out_applied) {
    request_t request = begin_request("twist");
    if (!add_text(&request, "key", key, IWC_KEY_SIZE - 1U)) {
        return iwc_note(self, IWC_INVALID);
    }
    add_integer(&request, "v_mm_s", twist->v_mm_s);
    add_integer(&request, "yaw_mrad_s", twist->yaw_mrad_s);
    add(&request, "}");
    return command(self, request.text, timeout_ms, out_applied);
}

/// Closes the connection if the gateway has not confirmed a stop. That ends the lease and stops the wheels.
static iwc_result_t or_close(iwc_t *self, iwc_result_t result) {
    if (result != IWC_OK && result != IWC_REFUSED && result != IWC_INVALID) {
        iwc_close(self);
    }
    return result;
}

iwc_result_t iwc_stop(iwc_t *self, int timeout_ms) {
    return or_close(self, iwc_ask(self, "{\"cmd\":\"stop\"}", timeout_ms, NULL));
}

/// Writes an estop with the part of the reason that a request may contain: no reason prevents a stop.
static request_t estop_request(const char *reason) {
    request_t request = begin_request("estop");
    char plain[REASON_MAX_BYTES + 1U];
    iwn_text_t text = iwn_text_begin(plain, sizeof plain);
    iwn_text_add(&text, (reason != NULL) ? reason : "");
    iwn_plain_blank(plain);
    const bool blank = plain[strspn(plain, " ")] == '\0';
    (void)add_text(&request, "reason", blank ? NULL : plain, REASON_MAX_BYTES);
    add(&request, "}");
    return request;
}

iwc_result_t iwc_estop(iwc_t *self, const char *reason, int timeout_ms) {
    const request_t request = estop_request(reason);
    return or_close(self, iwc_ask(self, request.text, timeout_ms, NULL));
}

iwc_result_t iwc_stop_at(iwc_t *self, const char *path, int timeout_ms) {
    return iwc_stop_by(self, path, "{\"cmd\":\"stop\"}", timeout_ms);
}

iwc_result_t iwc_estop_at(iwc_t *self, const char *path, const char *reason, int timeout_ms) {
    const request_t request = estop_request(reason);
    return iwc_stop_by(self, path, request.text, timeout_ms);
}

iwc_result_t iwc_reset(iwc_t *self, int timeout_ms) {
    return iwc_reset_as(self, &(iwc_reset_t){.stop = {.known = false}}, timeout_ms);
}

iwc_result_t iwc_reset_as(iwc_t *self, const iwc_reset_t *reset, int timeout_ms) {
    request_t request = begin_request("reset");
    add_known(&request, "stop", reset->stop);
    add_known(&request, "t_us", reset->t_us);
    add(&request, "}");
    return iwc_ask(self, request.text, timeout_ms, NULL);
}

iwc_result_t iwc_release(iwc_t *self, iwc_value_t t_us, int timeout_ms) {
    request_t request = begin_request("release");
    add_known(&request, "t_us", t_us);
    add(&request, "}");
    return iwc_ask(self, request.text, timeout_ms, NULL);
}
