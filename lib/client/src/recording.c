// SPDX-License-Identifier: MIT
// Reads recordings in pieces, and checks their checksums.
#include "connection.h"

#include "iwheel_northbound/line.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/// Length of the longest name that the gateway accepts.
#define NAME_MAX_BYTES 63U

/// Returns the value of a base64 digit, 0..63; 64: not a digit.
static uint32_t digit(char c) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = (c != '\0') ? strchr(digits, c) : NULL;
    return (at != NULL) ? (uint32_t)(at - digits) : 64U;
}

/// Decodes a JSON string of base64. Returns false if it is not base64, or more than IWC_PIECE_MAX bytes.
static bool decode(iwc_span_t text, uint8_t *out, size_t *out_length) {
    size_t used = 0;
    if (text.at == NULL || text.length < 2U || text.at[0] != '"' || (text.length - 2U) % 4U != 0U ||
        (text.length - 2U) / 4U * 3U > IWC_PIECE_MAX + 2U) {
        return false;
    }
    for (size_t i = 1; i + 1U < text.length; i += 4U) {
        const char *four = text.at + i;
        const bool last = i + 5U == text.length;
        const unsigned padding = (last && four[3] == '=') ? ((four[2] == '=') ? 2U : 1U) : 0U;
        uint32_t bits = 0;
        for (unsigned k = 0; k < 4U; k++) {
            const uint32_t six = (k + padding >= 4U) ? 0U : digit(four[k]);
            if (six == 64U) {
                return false;
            }
            bits = bits << 6U | six;
        }
        for (unsigned k = 0; k < 3U - padding; k++) {
            if (used == IWC_PIECE_MAX) {
                return false;
            }
            out[used++] = (uint8_t)(bits >> (16U - 8U * k));
        }
    }
    *out_length = used;
    return true;
}

/// Returns true if the name consists of characters that need no escape in a request. The gateway checks the rest.
static bool is_name(const char *name) {
    static const char all[] = "abcdefghijklmnopqrstuvwxyz0123456789_-.";
    const size_t length = strlen(name);
    return length > 0U && length <= NAME_MAX_BYTES && strspn(name, all) == length;
}

bool iwc_piece_take(const iwc_message_t *reply, void *out, iwc_piece_t *piece) {
    size_t length = 0;
    const char *data = iwc_json(reply, "data", &length);
    const iwc_value_t from = iwc_integer(reply, "offset");
    const iwc_value_t crc = iwc_integer(reply, "crc32");
    const iwc_value_t whole = iwc_integer(reply, "file_crc32");
    piece->size = iwc_integer(reply, "size").value;
    if (!from.known || from.value != piece->next || !crc.known ||
        !decode((iwc_span_t){data, length}, (uint8_t *)out, &piece->length) ||
        crc.value != iwn_line_crc(0, out, piece->length)) {
        return false;
    }
    const bool goes_on = piece->length > 0U || piece->next == piece->size; // Otherwise the caller would never finish.
    piece->next += (int64_t)piece->length;
    piece->crc32 = iwn_line_crc(piece->crc32, out, piece->length);
    return goes_on && piece->next <= piece->size && (!whole.known || whole.value == piece->crc32);
}

iwc_result_t iwc_recording(iwc_t *self, const char *name, int timeout_ms, void *out, iwc_piece_t *piece) {
    char request[160];
    iwc_message_t reply;
    if (!is_name(name) || piece->next < 0) {
        return iwc_note(self, IWC_INVALID);
    }
    (void)snprintf(request, sizeof request, "{\"cmd\":\"recording\",\"name\":\"%s\",\"offset\":%" PRId64 "}", name,
                   piece->next);
    const iwc_result_t result = iwc_ask(self, request, timeout_ms, &reply);
    if (result == IWC_OK && !iwc_piece_take(&reply, out, piece)) {
        iwc_close(self); // Nothing that comes after it is reliable.
        return iwc_note(self, IWC_GARBLED);
    }
    return result;
}
