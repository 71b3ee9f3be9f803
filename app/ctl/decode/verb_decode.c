// SPDX-License-Identifier: MIT
#include "decode_fields.h"
#include "frame.h"
#include "recordings/ctl_recording.h"
#include "talk/ctl.h"
#include "text/ctl_text.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

/// An earlier time is not counted from 1970.
#define CALENDAR_US 1000000000000000

typedef struct {
    const char *path;
    bool csv;
    iw_config_t config;
    int64_t begin_us; ///< Time of the first frame.
    recording_t recording;
} decode_t;

/// Reads the words. Returns an exit code.
static int parse_words(decode_t *self, int count, char **words) {
    const option_t options[] = {
        {OPTION("--csv", NULL, &self->csv)},
        {OPTION("--config", config_option_load, &self->config)},
        {.name = NULL},
    };
    const words_syntax_t syntax = {"decode", options, words_is_file, &self->path};
    self->path = "-";
    return words_read(&syntax, count, words);
}

static void write_begin(const decode_t *self, const candump_t *frame) {
    char text[TEXT_CELL];
    text_when(frame->time_us, text);
    if (frame->time_us >= CALENDAR_US && text[0] != '-') {
        text_line(stdout, "# %s, from %s.%06" PRId64 " local time; times in seconds from there", self->recording.name,
                  text, frame->time_us % 1000000);
    } else {
        text_line(stdout, "# %s, from %" PRId64 ".%06" PRId64 " s; times in seconds from there", self->recording.name,
                  frame->time_us / 1000000, frame->time_us % 1000000);
    }
}

static void write_text(decode_t *self, const candump_t *frame, const decoded_t *decoded) {
    if (self->recording.frames == 1U) {
        self->begin_us = frame->time_us;
        write_begin(self, frame);
    }
    const int64_t since_us = frame->time_us - self->begin_us;
    const int64_t size_us = (since_us < 0) ? -since_us : since_us;
    char time_text[32];
    (void)snprintf(time_text, sizeof time_text, "%s%" PRId64 ".%06" PRId64, (since_us < 0) ? "-" : "",
                   size_us / 1000000, size_us % 1000000);
    frame_print(time_text, frame, decoded);
}

static void write_csv_header(void) {
    (void)fputs("time_s,interface,direction,id,id_hex,dlc_bytes,data_hex,wheel,message", stdout);
    for (unsigned field = 0; field < FIELDS; field++) {
        (void)printf(",%s", field_column((field_t)field));
    }
    (void)puts(",note");
}

static void write_csv(const candump_t *frame, const decoded_t *decoded) {
    char name[CANDUMP_INTERFACE_SIZE];
    for (size_t i = 0; i < sizeof name; i++) { // A comma or quote would begin another column.
        const char c = frame->interface[i];
        name[i] = (c == ',' || c == '"' || c == '\'') ? '_' : c;
    }
    (void)printf("%" PRId64 ".%06" PRId64 ",%s,%s,%" PRIu32 ",0x%0*" PRIX32 ",%u,", frame->time_us / 1000000,
                 frame->time_us % 1000000, name, frame_direction(frame), frame->id, frame->extended ? 8 : 3, frame->id,
                 frame->length);
    frame_print_bytes(frame, "");
    (void)printf(",%s,%s", decoded->wheel, decoded->message);
    for (unsigned field = 0; field < FIELDS; field++) {
        if ((decoded->present & (1U << field)) != 0U) {
            (void)printf(",%" PRId32, decoded->value[field]);
        } else {
            (void)putchar(',');
        }
    }
    (void)printf(",\"%s\"\n", decoded->note);
}

/// Returns the text, or null if it is empty or not UTF-8.
static json_t *text_or_null(const char *text) {
    json_t *value = (text[0] != '\0') ? json_string(text) : NULL;
    return (value != NULL) ? value : json_null();
}

static json_t *bytes_of(const candump_t *frame) {
    char data[2U * CANDUMP_DATA_MAX + 1U] = "";
    for (size_t i = 0; i < frame->length && !frame->remote; i++) {
        (void)snprintf(&data[2U * i], 3U, "%02X", frame->data[i]);
    }
    return json_string(data);
}

static json_t *values_of(const decoded_t *decoded) {
    json_t *values = json_object();
    for (unsigned field = 0; field < FIELDS; field++) {
        if ((decoded->present & (1U << field)) != 0U) {
            (void)json_object_set_new(values, field_column((field_t)field), json_integer(decoded->value[field]));
        }
    }
    return values;
}

/// Writes one object: time and interface, id and bytes, wheel and message, and under `values` the values with the names
/// of the CSV. An unknown value is null. Returns false if there was no memory; then nothing is written.
static bool write_json(const candump_t *frame, const decoded_t *decoded) {
    json_t *line = json_pack(
        "{s:I, s:o, s:o, s:I, s:b, s:b, s:b, s:i, s:o, s:o, s:s, s:o, s:o}", "t_us", (json_int_t)frame->time_us,
        "interface", text_or_null(frame->interface), "direction", text_or_null(frame_direction(frame)), "id",
        (json_int_t)frame->id, "extended", (int)frame->extended, "remote", (int)frame->remote, "fd", (int)frame->fd,
        "dlc", (int)frame->length, "data", bytes_of(frame), "wheel", text_or_null(decoded->wheel), "message",
        decoded->message, "values", values_of(decoded), "note", text_or_null(decoded->note));
    const bool written = line != NULL && text_json_value(line, stdout);
    json_decref(line);
    return written;
}

/// Writes one frame. Returns an exit code.
static int write_frame(decode_t *self, const candump_t *frame, bool json) {
    decoded_t decoded;
    const iw_can_frame_t core = candump_to_core(frame);
    decode_fields(&core, &self->config, &decoded);
    if (json) {
        return write_json(frame, &decoded) ? CTL_OK : ctl_fail(CTL_INTERNAL, "not enough memory for a line");
    }
    if (self->csv) {
        write_csv(frame, &decoded);
    } else {
        write_text(self, frame, &decoded);
    }
    return CTL_OK;
}

int verb_decode(ctl_t *self, int count, char **words) {
    static decode_t decode;
    candump_t frame;
    iw_config_default(&decode.config);
    decode.recording.every_interface = true;
    int code = parse_words(&decode, count, words);
    if (code == CTL_OK && decode.csv && self->json) {
        return ctl_fail(CTL_USAGE, "decode writes --csv or --json, not both");
    }
    if (code == CTL_OK) {
        code = recording_open(&decode.recording, NULL, decode.path);
    }
    if (code != CTL_OK) {
        return code;
    }
    if (decode.csv) {
        write_csv_header();
    }
    while (code == CTL_OK && ferror(stdout) == 0 && recording_next(&decode.recording, &frame)) {
        code = write_frame(&decode, &frame, self->json);
        if (recording_is_drained(&decode.recording)) {
            (void)fflush(stdout); // Live: each line must be visible before the next one comes.
        }
    }
    const int read = recording_close(&decode.recording);
    return (code == CTL_OK) ? read : code;
}
