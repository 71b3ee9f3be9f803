// SPDX-License-Identifier: MIT
// Any bytes as the file of the assumption store: refused with a reason and no change, or possible, and the same after
// writing and reading. The mutator corrects the checksum; otherwise hardly any input would pass it.
#include "fuzz.h"

#include "assumptions/assumptions_file.h"

#include "iwheel_northbound/line.h"

#include <inttypes.h>

#define BUS        "can0"
#define SUM_LENGTH 9U

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed);

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned int seed) {
    const uint8_t *newline = memchr(data, '\n', size);
    if (newline == NULL || seed % 16U == 0U || max_size < SUM_LENGTH + 2U) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    size_t length = LLVMFuzzerMutate(data, (size_t)(newline - data), max_size - SUM_LENGTH - 2U);
    char sum[SUM_LENGTH + 1U];
    data[length++] = '\n';
    (void)snprintf(sum, sizeof sum, "%08" PRIx32 "\n", iwn_line_crc(0, data, length));
    memcpy(&data[length], sum, SUM_LENGTH);
    return length + SUM_LENGTH;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static char again[GW_ASSUMPTIONS_FILE_SIZE];
    static gw_stored_t known;
    static gw_stored_t before;
    char reason[GW_ASSUMPTIONS_REASON_SIZE] = "";
    char *const text = malloc((size > 0U) ? size : 1U);
    memcpy(text, data, size); // Exactly this length: the sanitizer finds a byte that is read after it.
    memset(&known, 0xA5, sizeof known);
    before = known;
    if (gw_assumptions_file_read(text, size, BUS, &known, reason)) {
        fuzz_position("accepted");
        for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
            fuzz_require(known.item[item].entry.state == IW_ASSUMED ||
                             gw_bounds_item((iw_assumption_item_t)item, &known.item[item]),
                         "an observation that a run could make");
        }
        for (unsigned side = 0; side < IW_SIDES; side++) {
            fuzz_require(known.offset[side].from == IW_OFFSET_NONE || gw_bounds_offset(&known.offset[side]),
                         "an offset that a wheel could have");
        }
        const size_t length = gw_assumptions_file_write(&known, BUS, again, sizeof again);
        memset(&before, 0, sizeof before);
        fuzz_require(length > 0U && gw_assumptions_file_read(again, length, BUS, &before, reason),
                     "the written file can be read");
        fuzz_require(memcmp(&before, &known, sizeof known) == 0, "and has the same values");
    } else {
        fuzz_position("refused");
        fuzz_require(memchr(reason, '\0', sizeof reason) != NULL && reason[0] != '\0', "a refusal has a reason");
        fuzz_require(memcmp(&before, &known, sizeof known) == 0, "and changes nothing");
    }
    free(text);
    return 0;
}
