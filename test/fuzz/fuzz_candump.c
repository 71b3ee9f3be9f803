// SPDX-License-Identifier: MIT
// Any bytes as a recording: each line is a frame that is the same after writing and reading, or empty, or bad with a reason.
#include "fuzz_sequence.h"

#include "candump.h"

static void judge_frame(const candump_t *frame) {
    char line[CANDUMP_LINE_SIZE];
    candump_t again;
    const char *why = NULL;
    memset(&again, 0, sizeof again);
    fuzz_require(frame->time_us >= 0 && frame->id <= CANDUMP_ID_MASK && frame->length <= CANDUMP_DATA_MAX,
                 "within its ranges");
    fuzz_require(memchr(frame->interface, '\0', sizeof frame->interface) != NULL, "the interface's name ends");
    const size_t length = candump_write(frame, line);
    fuzz_require(length < sizeof line && strlen(line) == length, "a written line fits");
    fuzz_require(candump_parse(line, length, &again, &why) == CANDUMP_FRAME, "a written line can be read");
    fuzz_require(again.time_us == frame->time_us && again.id == frame->id && again.length == frame->length &&
                     again.remote == frame->remote && again.extended == frame->extended && again.fd == frame->fd &&
                     again.error == frame->error && again.mark == frame->mark,
                 "and has the same frame");
    fuzz_require(frame->remote || memcmp(again.data, frame->data, frame->length) == 0, "byte for byte");
}

static void judge_line(const char *line, size_t length) {
    candump_t frame;
    const char *why = NULL;
    // A copy of exactly that length: the sanitizer finds a byte that is read after it.
    char *const copy = malloc((length > 0U) ? length : 1U);
    memcpy(copy, line, length);
    switch (candump_parse(copy, length, &frame, &why)) {
    case CANDUMP_FRAME:
        fuzz_position("accepted");
        judge_frame(&frame);
        break;
    case CANDUMP_BAD:
        fuzz_position("refused");
        fuzz_require(why != NULL && why[0] != '\0', "a bad line has a reason");
        break;
    default:
        break;
    }
    free(copy);
}

static size_t fuzz_unit(const uint8_t *data, size_t size) {
    return fuzz_until(data, size, '\n');
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    size_t begin = 0;
    for (size_t i = 0; i <= size; i++) {
        if (i == size || data[i] == '\n') {
            judge_line((const char *)data + begin, i - begin);
            begin = i + 1U;
        }
    }
    return 0;
}
