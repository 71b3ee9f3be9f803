// SPDX-License-Identifier: MIT
#include "assumptions_file.h"

#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/line.h"
#include "iwheel_northbound/words.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FORMAT  "iwheel-ledger"
#define VERSION 1
/// Eight hexadecimal digits and a newline.
#define SUM_LENGTH 9U

void gw_assumptions_file_name(const char *bus, char *out_name, size_t size) {
    (void)snprintf(out_name, size, "ledger-%s", bus);
    for (char *c = out_name; *c != '\0'; c++) {
        if (isalnum((unsigned char)*c) == 0 && *c != '-' && *c != '.') {
            *c = '_';
        }
    }
}

static void write_item(const gw_stored_item_t *known, const char *name, iwn_out_t *json) {
    iwn_out_open(json, name, '{');
    iwn_out_text(json, "state", iwn_assumption_state_name(known->entry.state));
    iwn_out_text(json, "evidence", iwn_source_name(known->entry.source));
    iwn_out_int(json, "figure", known->entry.figure);
    iwn_out_text(json, "value", known->value);
    iwn_out_text(json, "found", known->word.found);
    iwn_out_int(json, "since_wall_us", known->since_wall_us);
    if (known->word.how[0] != '\0') {
        iwn_out_text(json, "how", known->word.how); // Omitted otherwise, so that earlier versions can read it.
    }
    iwn_out_close(json, '}');
}

static void write_offset(const gw_stored_offset_t *known, const char *name, iwn_out_t *json) {
    iwn_out_open(json, name, '{');
    iwn_out_text(json, "from", iwn_provenance_name(known->from));
    iwn_out_text(json, "unit", (known->unit == IW_FORCE_CN) ? "cN" : "dN");
    iwn_out_int(json, "offset_mN", known->offset_mN);
    iwn_out_int(json, "drift_mN", known->drift_mN);
    iwn_out_int(json, "deviation_mN", known->deviation_mN);
    iwn_out_int(json, "samples", known->samples);
    iwn_out_int(json, "wall_us", known->wall_us);
    iwn_out_close(json, '}');
}

size_t gw_assumptions_file_write(const gw_stored_t *known, const char *bus, char *out_text, size_t size) {
    iwn_out_t json;
    iwn_out_init(&json, out_text, size - SUM_LENGTH);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "format", FORMAT);
    iwn_out_int(&json, "version", VERSION);
    iwn_out_text(&json, "bus", bus);
    iwn_out_open(&json, "items", '{');
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if (known->item[item].entry.state != IW_ASSUMED) {
            write_item(&known->item[item], iwn_assumption_item_name((iw_assumption_item_t)item), &json);
        }
    }
    iwn_out_close(&json, '}');
    iwn_out_open(&json, "offsets", '{');
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if (known->offset[side].from != IW_OFFSET_NONE) {
            write_offset(&known->offset[side], (side == IW_LEFT) ? "left" : "right", &json);
        }
    }
    iwn_out_close(&json, '}');
    if (known->tried.wall_us != 0) {
        iwn_out_open(&json, "button", '{');
        gw_tried_write(&known->tried, &json);
        iwn_out_close(&json, '}');
    }
    iwn_out_close(&json, '}');
    const size_t length = iwn_out_finish(&json);
    if (length == 0U) {
        return 0;
    }
    (void)snprintf(&out_text[length], SUM_LENGTH + 1U, "%08" PRIx32 "\n", iwn_line_crc(0, out_text, length));
    return length + SUM_LENGTH;
}

/// Reads a number within the limits.
static bool read_number(iwn_json_t object, const char *field, int64_t low, int64_t high, int64_t *out_number) {
    iwn_json_t value;
    if (!iwn_json_find(object, field, &value) || iwn_json_kind(value) != IWN_JSON_INTEGER) {
        return false;
    }
    *out_number = iwn_json_integer(value);
    return *out_number >= low && *out_number <= high;
}

static bool read_text(iwn_json_t object, const char *field, char *out_text, size_t size) {
    iwn_json_t value;
    return iwn_json_find(object, field, &value) && iwn_json_text(value, out_text, size);
}

static bool is_text(iwn_json_t object, const char *field, const char *text) {
    iwn_json_t value;
    return iwn_json_find(object, field, &value) && iwn_json_is(value, text);
}

static size_t count_fields(iwn_json_t object) {
    iwn_json_t rest = iwn_json_inside(object);
    iwn_json_t name;
    iwn_json_t value;
    size_t count = 0;
    while (iwn_json_next(&rest, &name, &value)) {
        count++;
    }
    return count;
}

/// Reads the operator's value and its description, which earlier versions did not write.
static bool read_word(iwn_json_t object, inspect_word_t *out_word) {
    iwn_json_t how;
    const bool has_how = iwn_json_find(object, "how", &how);
    return count_fields(object) == (has_how ? 7U : 6U) &&
           read_text(object, "found", out_word->found, sizeof out_word->found) &&
           (!has_how || iwn_json_text(how, out_word->how, sizeof out_word->how));
}

static bool read_item(const char *name, iwn_json_t object, gw_stored_t *known) {
    iw_assumption_item_t item;
    int64_t figure;
    const bool confirmed = is_text(object, "state", "confirmed");
    const bool by_bus = is_text(object, "evidence", "bus");
    if (!iwn_assumption_item_of(name, &item) || !(confirmed || is_text(object, "state", "contradicted")) ||
        !(by_bus || is_text(object, "evidence", "operator")) ||
        !read_number(object, "figure", INT32_MIN, INT32_MAX, &figure)) {
        return false;
    }
    gw_stored_item_t *found = &known->item[item];
    found->entry = (iw_assumption_entry_t){.state = confirmed ? IW_CONFIRMED : IW_CONTRADICTED,
                                           .source = by_bus ? IW_SOURCE_BUS : IW_SOURCE_OPERATOR,
                                           .figure = (int32_t)figure};
    return read_number(object, "since_wall_us", INT64_MIN, INT64_MAX, &found->since_wall_us) &&
           read_text(object, "value", found->value, sizeof found->value) && read_word(object, &found->word) &&
           gw_bounds_item(item, found);
}

static bool read_provenance(iwn_json_t object, iw_offset_provenance_t *out_from) {
    for (int from = IW_OFFSET_ESTIMATED; from <= (int)IW_OFFSET_OPERATOR; from++) {
        if (is_text(object, "from", iwn_provenance_name((iw_offset_provenance_t)from))) {
            *out_from = (iw_offset_provenance_t)from;
            return true;
        }
    }
    return false;
}

static bool read_offset(const char *name, iwn_json_t object, gw_stored_t *known) {
    int64_t offset;
    int64_t drift;
    int64_t deviation;
    int64_t samples;
    const bool left = strcmp(name, "left") == 0;
    const bool centi = is_text(object, "unit", "cN");
    gw_stored_offset_t *found = &known->offset[left ? IW_LEFT : IW_RIGHT];
    if (!(left || strcmp(name, "right") == 0) || !(centi || is_text(object, "unit", "dN")) ||
        count_fields(object) != 7U || !read_provenance(object, &found->from) ||
        !read_number(object, "offset_mN", -IW_FORCE_OFFSET_MAX_mN, IW_FORCE_OFFSET_MAX_mN, &offset) ||
        !read_number(object, "drift_mN", INT32_MIN, INT32_MAX, &drift) ||
        !read_number(object, "deviation_mN", 0, UINT32_MAX, &deviation) ||
        !read_number(object, "samples", 0, UINT8_MAX, &samples) ||
        !read_number(object, "wall_us", INT64_MIN, INT64_MAX, &found->wall_us)) {
        return false;
    }
    found->unit = centi ? IW_FORCE_CN : IW_FORCE_DN;
    found->offset_mN = (int32_t)offset;
    found->drift_mN = (int32_t)drift;
    found->deviation_mN = (uint32_t)deviation;
    found->samples = (uint32_t)samples;
    return gw_bounds_offset(found);
}

/// Reads each member of the object with that name.
static bool read_all(iwn_json_t root, const char *field, gw_stored_t *known,
                     bool (*read_one)(const char *, iwn_json_t, gw_stored_t *)) {
    char name[32]; // A longer name is not one of ours.
    iwn_json_t object;
    iwn_json_t found;
    iwn_json_t value;
    if (!iwn_json_find(root, field, &object) || iwn_json_kind(object) != IWN_JSON_OBJECT) {
        return false;
    }
    iwn_json_t rest = iwn_json_inside(object);
    while (iwn_json_next(&rest, &found, &value)) {
        if (!iwn_json_text(found, name, sizeof name) || iwn_json_kind(value) != IWN_JSON_OBJECT ||
            !read_one(name, value, known)) {
            return false;
        }
    }
    return true;
}

/// Reads the button, if the line has one.
static bool read_button(iwn_json_t root, gw_tried_t *out_tried) {
    iwn_json_t object;
    return !iwn_json_find(root, "button", &object) || gw_tried_read(object, out_tried);
}

/// Reads the line. Returns NULL, or what is wrong.
static const char *read_line(const char *text, size_t length, const char *bus, gw_stored_t *known) {
    iwn_work_t work;
    char why[GW_ASSUMPTIONS_REASON_SIZE];
    iwn_text_t unused = iwn_text_begin(why, sizeof why); // The text of the parser would not help; the reasons below do.
    iwn_json_t root;
    int64_t version;
    if (!iwn_json_check(text, length, &work, &root, &unused) || !is_text(root, "format", FORMAT)) {
        return "it is not the assumption store of an iWheel gateway";
    }
    if (!read_number(root, "version", VERSION, VERSION, &version)) {
        return "another version of the gateway wrote it";
    }
    if (!is_text(root, "bus", bus)) {
        return "it is for another bus";
    }
    if (!read_all(root, "items", known, read_item) || !read_all(root, "offsets", known, read_offset) ||
        !read_button(root, &known->tried)) {
        return "it contains values that no gateway can have measured";
    }
    return NULL;
}

bool gw_assumptions_file_read(const char *text, size_t length, const char *bus, gw_stored_t *out_known,
                              char out_reason[GW_ASSUMPTIONS_REASON_SIZE]) {
    char sum[SUM_LENGTH + 1U];
    static gw_stored_t known; // Too large for a stack.
    const size_t body = (length < SUM_LENGTH) ? 0U : length - SUM_LENGTH;
    const char *fault = "it is damaged: its checksum is wrong";
    memset(&known, 0, sizeof known);
    (void)snprintf(sum, sizeof sum, "%08" PRIx32 "\n", iwn_line_crc(0, text, body));
    if (length > SUM_LENGTH && memcmp(&text[body], sum, SUM_LENGTH) == 0) {
        fault = read_line(text, body, bus, &known);
    }
    if (fault != NULL) {
        (void)snprintf(out_reason, GW_ASSUMPTIONS_REASON_SIZE, "%s", fault);
        return false;
    }
    *out_known = known;
    return true;
}
