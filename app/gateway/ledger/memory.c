// SPDX-License-Identifier: MIT
#include "memory.h"

#include "bounds.h"
#include "json/json_arena.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/words.h"

#include <ctype.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

#define FORMAT  "iwheel-ledger"
#define VERSION 1
/// Eight hexadecimal digits and a newline.
#define SUM_LENGTH 9U

/// CRC-32 as everybody computes it (zip, Ethernet).
static uint32_t checksum(const char *text, size_t length) {
    uint32_t sum = UINT32_MAX;
    for (size_t i = 0; i < length; ++i) {
        sum ^= (unsigned char)text[i];
        for (unsigned bit = 0; bit < 8U; ++bit) {
            sum = (sum >> 1) ^ ((sum & 1U) != 0U ? 0xEDB88320U : 0U);
        }
    }
    return ~sum;
}

void gw_memory_name(const char *bus, char *out_name, size_t size) {
    (void)snprintf(out_name, size, "ledger-%s", bus);
    for (char *c = out_name; *c != '\0'; ++c) {
        *c = isalnum((unsigned char)*c) != 0 || *c == '-' || *c == '.' ? *c : '_';
    }
}

static void write_item(const gw_known_item_t *known, const char *name, iwn_out_t *json) {
    iwn_out_open(json, name, '{');
    iwn_out_text(json, "state", iwn_ledger_state_name(known->entry.state));
    iwn_out_text(json, "evidence", iwn_evidence_name(known->entry.evidence));
    iwn_out_int(json, "figure", known->entry.figure);
    iwn_out_text(json, "value", known->value);
    iwn_out_text(json, "found", known->word.found);
    iwn_out_int(json, "since_wall_us", known->since_wall_us);
    if (known->word.how[0] != '\0') {
        iwn_out_text(json, "how", known->word.how); // Left out otherwise, so that earlier versions can read it.
    }
    iwn_out_close(json, '}');
}

static void write_offset(const gw_known_offset_t *known, const char *name, iwn_out_t *json) {
    iwn_out_open(json, name, '{');
    iwn_out_text(json, "from", iwn_provenance_name(known->from));
    iwn_out_text(json, "unit", known->unit == IW_FORCE_CN ? "cN" : "dN");
    iwn_out_int(json, "offset_mN", known->offset_mN);
    iwn_out_int(json, "drift_mN", known->drift_mN);
    iwn_out_int(json, "deviation_mN", known->deviation_mN);
    iwn_out_int(json, "samples", known->samples);
    iwn_out_int(json, "wall_us", known->wall_us);
    iwn_out_close(json, '}');
}

size_t gw_memory_write(const gw_known_t *known, const char *bus, char *out_text, size_t size) {
    iwn_out_t json;
    iwn_out_init(&json, out_text, size - SUM_LENGTH);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "format", FORMAT);
    iwn_out_int(&json, "version", VERSION);
    iwn_out_text(&json, "bus", bus);
    iwn_out_open(&json, "items", '{');
    for (unsigned item = 0; item < IW_LEDGER_ITEMS; ++item) {
        if (known->item[item].entry.state != IW_LEDGER_ASSUMED) {
            write_item(&known->item[item], iwn_ledger_item_name((iw_ledger_item_t)item), &json);
        }
    }
    iwn_out_close(&json, '}');
    iwn_out_open(&json, "offsets", '{');
    for (unsigned side = 0; side < IW_SIDES; ++side) {
        if (known->offset[side].from != IW_OFFSET_NONE) {
            write_offset(&known->offset[side], side == IW_LEFT ? "left" : "right", &json);
        }
    }
    iwn_out_close(&json, '}');
    iwn_out_close(&json, '}');
    const size_t length = iwn_out_finish(&json);
    if (length == 0U) {
        return 0;
    }
    (void)snprintf(&out_text[length], SUM_LENGTH + 1U, "%08" PRIx32 "\n", checksum(out_text, length));
    return length + SUM_LENGTH;
}

/// A field's number, if it is one within the limits.
static bool read_number(const json_t *object, const char *field, int64_t low, int64_t high, int64_t *out_number) {
    const json_t *value = json_object_get(object, field);
    *out_number = json_integer_value(value);
    return json_is_integer(value) && *out_number >= low && *out_number <= high;
}

static bool read_text(const json_t *object, const char *field, char *out_text, size_t size) {
    const char *text = json_string_value(json_object_get(object, field));
    const size_t length = text == NULL ? size : strlen(text);
    if (length >= size) {
        return false;
    }
    (void)memcpy(out_text, text, length + 1U);
    return true;
}

/// What the operator found, and how: ledgers of before do not tell that.
static bool read_word(const json_t *object, gw_word_t *out_word) {
    const bool has_how = json_object_get(object, "how") != NULL;
    return json_object_size(object) == (has_how ? 7U : 6U) &&
           read_text(object, "found", out_word->found, sizeof out_word->found) &&
           (!has_how || read_text(object, "how", out_word->how, sizeof out_word->how));
}

static bool read_item(const json_t *object, gw_known_item_t *out_known) {
    int64_t figure;
    int64_t since;
    const char *state = json_string_value(json_object_get(object, "state"));
    const char *evidence = json_string_value(json_object_get(object, "evidence"));
    if (state == NULL || evidence == NULL || !read_number(object, "figure", INT32_MIN, INT32_MAX, &figure) ||
        !read_number(object, "since_wall_us", INT64_MIN, INT64_MAX, &since) ||
        !read_text(object, "value", out_known->value, sizeof out_known->value) ||
        !read_word(object, &out_known->word)) {
        return false;
    }
    const bool confirmed = strcmp(state, "confirmed") == 0;
    const bool by_bus = strcmp(evidence, "bus") == 0;
    out_known->entry = (iw_ledger_entry_t){.state = confirmed ? IW_LEDGER_CONFIRMED : IW_LEDGER_CONTRADICTED,
                                           .evidence = by_bus ? IW_EVIDENCE_BUS : IW_EVIDENCE_OPERATOR,
                                           .figure = (int32_t)figure};
    out_known->since_wall_us = since;
    return (confirmed || strcmp(state, "contradicted") == 0) && (by_bus || strcmp(evidence, "operator") == 0);
}

static bool read_items(json_t *items, gw_known_t *known) {
    const char *name;
    json_t *object;
    json_object_foreach(items, name, object) {
        iw_ledger_item_t item;
        if (!iwn_ledger_item_of(name, &item) || !read_item(object, &known->item[item]) ||
            !gw_bounds_item(item, &known->item[item])) {
            return false;
        }
    }
    return json_is_object(items);
}

static bool read_provenance(const json_t *object, iw_offset_provenance_t *out_from) {
    const char *word = json_string_value(json_object_get(object, "from"));
    for (int from = IW_OFFSET_ESTIMATED; word != NULL && from <= (int)IW_OFFSET_OPERATOR; ++from) {
        if (strcmp(word, iwn_provenance_name((iw_offset_provenance_t)from)) == 0) {
            *out_from = (iw_offset_provenance_t)from;
            return true;
        }
    }
    return false;
}

static bool read_offset(const json_t *object, gw_known_offset_t *out_known) {
    int64_t offset;
    int64_t drift;
    int64_t deviation;
    int64_t samples;
    const char *unit = json_string_value(json_object_get(object, "unit"));
    if (unit == NULL || json_object_size(object) != 7U || !read_provenance(object, &out_known->from) ||
        !read_number(object, "offset_mN", -IW_FORCE_OFFSET_MAX_mN, IW_FORCE_OFFSET_MAX_mN, &offset) ||
        !read_number(object, "drift_mN", INT32_MIN, INT32_MAX, &drift) ||
        !read_number(object, "deviation_mN", 0, UINT32_MAX, &deviation) ||
        !read_number(object, "samples", 0, UINT8_MAX, &samples) ||
        !read_number(object, "wall_us", INT64_MIN, INT64_MAX, &out_known->wall_us)) {
        return false;
    }
    out_known->unit = strcmp(unit, "cN") == 0 ? IW_FORCE_CN : IW_FORCE_DN;
    out_known->offset_mN = (int32_t)offset;
    out_known->drift_mN = (int32_t)drift;
    out_known->deviation_mN = (uint32_t)deviation;
    out_known->samples = (uint32_t)samples;
    return out_known->unit == IW_FORCE_CN || strcmp(unit, "dN") == 0;
}

static bool read_offsets(json_t *offsets, gw_known_t *known) {
    const char *name;
    json_t *object;
    json_object_foreach(offsets, name, object) {
        const bool left = strcmp(name, "left") == 0;
        gw_known_offset_t *offset = &known->offset[left ? IW_LEFT : IW_RIGHT];
        if ((!left && strcmp(name, "right") != 0) || !read_offset(object, offset) || !gw_bounds_offset(offset)) {
            return false;
        }
    }
    return json_is_object(offsets);
}

/// NULL, or what is wrong with the line.
static const char *read_line(const json_t *root, const char *bus, gw_known_t *known) {
    int64_t version;
    const char *format = json_string_value(json_object_get(root, "format"));
    const char *of_bus = json_string_value(json_object_get(root, "bus"));
    if (format == NULL || strcmp(format, FORMAT) != 0) {
        return "it is no ledger of an iWheel gateway";
    }
    if (!read_number(root, "version", VERSION, VERSION, &version)) {
        return "another version of the gateway wrote it";
    }
    if (of_bus == NULL || strcmp(of_bus, bus) != 0) {
        return "it speaks of another bus";
    }
    if (!read_items(json_object_get(root, "items"), known) || !read_offsets(json_object_get(root, "offsets"), known)) {
        return "it holds what no gateway has measured";
    }
    return NULL;
}

bool gw_memory_read(const char *text, size_t length, const char *bus, gw_known_t *out_known,
                    char out_reason[GW_MEMORY_REASON_SIZE]) {
    char sum[SUM_LENGTH + 1U];
    gw_known_t known = {0};
    const size_t body = length < SUM_LENGTH ? 0U : length - SUM_LENGTH;
    const char *fault = "it is damaged: its checksum is wrong";
    (void)snprintf(sum, sizeof sum, "%08" PRIx32 "\n", checksum(text, body));
    if (length > SUM_LENGTH && memcmp(&text[body], sum, SUM_LENGTH) == 0) {
        json_arena_reset();
        const json_t *root = json_loadb(text, body, JSON_REJECT_DUPLICATES, NULL);
        fault = root == NULL ? "it is no ledger of an iWheel gateway" : read_line(root, bus, &known);
    }
    if (fault != NULL) {
        (void)snprintf(out_reason, GW_MEMORY_REASON_SIZE, "%s", fault);
        return false;
    }
    *out_known = known;
    return true;
}
