// SPDX-License-Identifier: MIT
// Any bytes from a gateway to libiwheel-client: whole messages come out of them, in bounds, and what ends the connection ends it once.
#include "connection.h"
#include "fuzz.h"

#include <sys/socket.h>
#include <unistd.h>

static const char HELLO[] = "{\"event\":\"hello\",\"api\":1,\"client\":3}\n";

static void judge_handle(const iwc_t *self) {
    fuzz_require(self->begin <= self->whole && self->whole <= self->end && self->end <= IWC_IN_SIZE,
                 "the buffer's parts are in order");
    fuzz_require((self->fd >= 0) == (self->over == IWC_OK), "it is open or over");
}

static void judge_message(const iwc_t *self, const iwc_message_t *message) {
    char text[16];
    iwc_state_t state;
    size_t length = 0;
    fuzz_require(message->length <= IWC_LINE_MAX && strlen(message->text) == message->length,
                 "a message is one terminated line");
    fuzz_require(message->is_event == (iwc_json(message, "event", &length) != NULL), "it is an event or a reply");
    (void)iwc_state(self, message, &state);
    if (iwc_text(message, message->is_event ? "event" : "error", text, sizeof text)) {
        fuzz_require(strlen(text) < sizeof text, "a text ends");
    }
}

/// Reads as the byte says.
static iwc_result_t read_some(iwc_t *self, uint8_t how) {
    iwc_message_t message;
    iwc_result_t result = IWC_OK;
    if ((how & 1U) != 0U) {
        (void)iwc_latest(self);
        judge_handle(self);
    }
    if ((how & 2U) != 0U && iwc_ask(self, "{\"cmd\":\"status\"}", 0, &message) == IWC_OK) {
        judge_message(self, &message);
    }
    if ((how & 4U) != 0U) {
        (void)iwc_drive(self, &(iwc_drive_t){.left_mm_s = 100}, 0, NULL);
    }
    while ((how & 8U) == 0U && result == IWC_OK) {
        result = iwc_next(self, 0, &message);
        if (result == IWC_OK) {
            judge_message(self, &message);
        }
        judge_handle(self);
    }
    return result;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static iwc_t *self;
    int pair[2];
    fuzz_bytes_t bytes = {.data = data, .size = size};
    const uint8_t how = fuzz_byte(&bytes);
    self = (self != NULL) ? self : iwc_new();
    fuzz_require(self != NULL && socketpair(AF_UNIX, SOCK_STREAM, 0, pair) == 0, "there is a connection");
    fuzz_require(send(pair[1], HELLO, sizeof HELLO - 1U, 0) > 0 && iwc_adopt(self, pair[0], 1000) == IWC_OK,
                 "it is greeted");
    self->requests = 0;
    // Cut where the first byte says, so that lines come torn.
    const size_t piece = (how >= 16U) ? how : 65536U;
    iwc_result_t result = IWC_TIMEOUT;
    while (bytes.at < size && self->fd >= 0) {
        const size_t now = (size - bytes.at < piece) ? size - bytes.at : piece;
        fuzz_require(send(pair[1], data + bytes.at, now, MSG_NOSIGNAL) == (ssize_t)now, "the socket takes it");
        bytes.at += now;
        result = read_some(self, how);
    }
    result = read_some(self, 0);
    fuzz_tell((result == IWC_TIMEOUT && self->begin == self->whole && self->whole == self->end && size > 1U)
                  ? "taken"
                  : "refused");
    (void)close(pair[1]);
    result = read_some(self, 0);
    fuzz_require(result == IWC_CLOSED || result == IWC_GARBLED, "it is over");
    iwc_close(self);
    return 0;
}
