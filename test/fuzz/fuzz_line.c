// SPDX-License-Identifier: MIT
// Any bytes on the serial wire: every accepted line is the only spelling of its content, all other lines are refused, the buffer
// holds, and after a newline a correct line is always received.
#include "fuzz.h"

#include "iwheel_northbound/line.h"

#define SIZE 512U

static void judge_line(const iwn_line_t *line, bool stamped) {
    char again[SIZE + 1U];
    fuzz_require(line->channel <= IWN_LINE_CHANNELS && line->stamped == stamped, "channel and direction");
    fuzz_require(line->json[0] == '{' && line->json[line->length - 1U] == '}', "braces");
    const size_t length = iwn_line_write(line, again, sizeof again);
    const char *begin = line->json - (length - line->length - IWN_LINE_SUFFIX);
    fuzz_require(length > IWN_LINE_SUFFIX && memcmp(begin, again, length - 1U) == 0, "it has one spelling");
}

/// Every accepted quote has exactly one spelling.
static void judge_quote(const iwn_line_t *line) {
    char copy[SIZE];
    char again[SIZE + IWN_QUOTE_SIZE];
    char *json = copy;
    size_t length = line->length;
    iwn_quote_t quote;
    memcpy(copy, line->json, length);
    if (iwn_quote_take(&json, &length, &quote)) {
        fuzz_position("quoted");
        fuzz_require(json > copy && length < line->length && json + length == copy + line->length, "a rest");
        const size_t whole = iwn_quote_write(&quote, json, length, again, sizeof again);
        fuzz_require(whole == line->length && memcmp(again, line->json, whole) == 0, "the same quote");
    }
}

static void judge(iwn_receiver_t *receiver, char byte, bool stamped) {
    iwn_line_t line;
    if (iwn_receiver_put(receiver, byte, &line) == IWN_LINE_GOOD) {
        fuzz_position("accepted");
        judge_line(&line, stamped);
        judge_quote(&line);
    }
    fuzz_require(receiver->length < SIZE, "no byte beyond the buffer");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    for (unsigned stamped = 0; stamped < 2U; stamped++) {
        char *const buffer = malloc(SIZE); // Exactly this size: the sanitizer finds a byte beyond it.
        iwn_receiver_t receiver;
        iwn_receiver_init(&receiver, buffer, SIZE, stamped != 0U);
        for (size_t i = 0; i < size; i++) {
            if (data[i] == 0xFFU) {
                iwn_receiver_spoil(&receiver);
            } else if (data[i] == 0xFEU) { // Insert the right CRC; without it hardly any line would be accepted.
                char end[SIZE];
                const size_t length = (receiver.length + IWN_LINE_SUFFIX <= SIZE) ? receiver.length : 0U;
                memcpy(end, buffer, length);
                const size_t whole = iwn_line_end(end, length, sizeof end);
                for (size_t n = length; n < whole; n++) {
                    judge(&receiver, end[n], stamped != 0U);
                }
            } else {
                judge(&receiver, (char)data[i], stamped != 0U);
            }
        }
        static const char *const good[2] = {"0 {\"cmd\":\"link\"}*e2d27f9b\n", "3 1250000 {\"ok\":true}*e0f15d9c\n"};
        iwn_line_t line;
        iwn_line_verdict_t last = IWN_LINE_NOTHING;
        (void)iwn_receiver_put(&receiver, '\n', &line);
        for (const char *c = good[stamped]; *c != '\0'; c++) {
            last = iwn_receiver_put(&receiver, *c, &line);
        }
        fuzz_require(last == IWN_LINE_GOOD, "after a newline a correct line is received");
        free(buffer);
    }
    return 0;
}
