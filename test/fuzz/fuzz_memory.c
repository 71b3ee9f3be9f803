// SPDX-License-Identifier: MIT
// Any bytes as the file of what is known of the wheels: refused with a reason and nothing changed, or possible, and the same when it has been
// written and read again. The mutator puts the checksum right, or nothing would ever come behind it.
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
    memcpy(text, data, size); // Of exactly its length: a byte read behind it is found.
    memset(&known, 0xA5, sizeof known);
    before = known;
    if (gw_assumptions_file_read(text, size, BUS, &known, reason)) {
        fuzz_tell("taken");
        for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
            fuzz_require(known.item[item].entry.state == IW_ASSUMED ||
                             gw_bounds_item((iw_assumption_item_t)item, &known.item[item]),
                         "evidence that a run could find");
        }
        for (unsigned side = 0; side < IW_SIDES; side++) {
            fuzz_require(known.offset[side].from == IW_OFFSET_NONE || gw_bounds_offset(&known.offset[side]),
                         "an offset that a wheel could have");
        }
        const size_t length = gw_assumptions_file_write(&known, BUS, again, sizeof again);
        memset(&before, 0, sizeof before);
        fuzz_require(length > 0U && gw_assumptions_file_read(again, length, BUS, &before, reason),
                     "written, it can be read");
        fuzz_require(memcmp(&before, &known, sizeof known) == 0, "and says the same");
    } else {
        fuzz_tell("refused");
        fuzz_require(memchr(reason, '\0', sizeof reason) != NULL && reason[0] != '\0', "a refusal has a reason");
        fuzz_require(memcmp(&before, &known, sizeof known) == 0, "and changes nothing");
    }
    free(text);
    return 0;
}
