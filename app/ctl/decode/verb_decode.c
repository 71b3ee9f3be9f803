// SPDX-License-Identifier: MIT
#include "decode_fields.h"
#include "frame.h"
#include "recordings/ctl_recording.h"
#include "talk/ctl.h"
#include "text/ctl_text.h"

#include "iwheel_northbound/json_out.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/// An earlier time does not count from 1970, so it is printed as seconds.
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
    char time_text[TEXT_CELL];
    text_number(frame->time_us - self->begin_us, 6U, "", time_text);
    frame_print(time_text, frame, decoded);
}

static void write_csv_header(void) {
    (void)fputs("time_s,interface,direction,id,id_hex,dlc_bytes,data_hex,wheel,message", stdout);
    for (unsigned field = 0; field < FIELDS; field++) {
        (void)printf(",%s", field_column((field_t)field));
    }
    (void)puts(",note");
}

/// A comma or quote would begin another column.
static char csv_character(char c) {
    return (c == ',' || c == '"' || c == '\'') ? '_' : c;
}

static const char commas[] = ",,,,,,,,,,,,,,,,,";
IW_STATIC_ASSERT(sizeof commas == FIELDS + 1U, a_comma_for_each_field);

static void write_csv_fields(const decoded_t *decoded, iwn_text_t *line) {
    unsigned written = 0;
    for (unsigned field = 0; field < FIELDS; field++) {
        if ((decoded->present & (1U << field)) != 0U) {
            iwn_text_span(line, commas, field + 1U - written);
            iwn_text_int(line, decoded->value[field]);
            written = field + 1U;
        }
    }
    iwn_text_span(line, commas, FIELDS - written);
}

static void write_csv(const candump_t *frame, const decoded_t *decoded) {
    char text[FRAME_LINE_SIZE];
    char time_text[TEXT_CELL];
    char name[CANDUMP_INTERFACE_SIZE];
    iwn_text_t line = iwn_text_begin(text, sizeof text);
    size_t length = 0;
    for (; frame->interface[length] != '\0'; length++) {
        name[length] = csv_character(frame->interface[length]);
    }
    name[length] = '\0';
    text_number(frame->time_us, 6U, "", time_text);
    IWN_TEXT_JOIN(&line, time_text, ",", name, ",", frame_direction(frame), ",");
    iwn_text_int(&line, frame->id);
    iwn_text_add(&line, ",");
    frame_add_id(frame, &line);
    iwn_text_add(&line, ",");
    iwn_text_int(&line, frame->length);
    iwn_text_add(&line, ",");
    frame_add_bytes(frame, "", &line);
    IWN_TEXT_JOIN(&line, ",", decoded->wheel, ",", decoded->message);
    write_csv_fields(decoded, &line);
    IWN_TEXT_JOIN(&line, ",\"", decoded->note, "\"\n");
    (void)fwrite(text, 1, line.length, stdout);
}

/// Returns the text, or NULL (written as null) if it is empty.
static const char *or_null(const char *text) {
    return (text[0] != '\0') ? text : NULL;
}

/// Writes one object: time and interface, id and bytes, wheel and message, and under `values` the values with the names
/// of the CSV. An unknown value is null.
static void write_json(const candump_t *frame, const decoded_t *decoded) {
    char line[2U * FRAME_LINE_SIZE];
    char data[2U * CANDUMP_DATA_MAX + 1U];
    iwn_text_t bytes = iwn_text_begin(data, sizeof data);
    iwn_out_t out;
    frame_add_bytes(frame, "", &bytes);
    iwn_out_init(&out, line, sizeof line);
    iwn_out_open(&out, NULL, '{');
    iwn_out_int(&out, "t_us", frame->time_us);
    iwn_out_text(&out, "interface", or_null(frame->interface));
    iwn_out_text(&out, "direction", or_null(frame_direction(frame)));
    iwn_out_int(&out, "id", frame->id);
    iwn_out_bool(&out, "extended", frame->extended);
    iwn_out_bool(&out, "remote", frame->remote);
    iwn_out_bool(&out, "fd", frame->fd);
    iwn_out_int(&out, "dlc", frame->length);
    iwn_out_text(&out, "data", data);
    iwn_out_text(&out, "wheel", or_null(decoded->wheel));
    iwn_out_text(&out, "message", decoded->message);
    iwn_out_open(&out, "values", '{');
    for (unsigned field = 0; field < FIELDS; field++) {
        if ((decoded->present & (1U << field)) != 0U) {
            iwn_out_int(&out, field_column((field_t)field), decoded->value[field]);
        }
    }
    iwn_out_close(&out, '}');
    iwn_out_text(&out, "note", or_null(decoded->note));
    iwn_out_close(&out, '}');
    (void)fwrite(line, 1, iwn_out_finish(&out), stdout);
}

static void write_frame(decode_t *self, const candump_t *frame, bool json) {
    decoded_t decoded;
    const iw_can_frame_t core = candump_to_core(frame);
    decode_fields(&core, &self->config, &decoded);
    if (json) {
        write_json(frame, &decoded);
    } else if (self->csv) {
        write_csv(frame, &decoded);
    } else {
        write_text(self, frame, &decoded);
    }
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
    while (ferror(stdout) == 0 && recording_next(&decode.recording, &frame)) {
        write_frame(&decode, &frame, self->json);
        if (recording_is_drained(&decode.recording)) {
            (void)fflush(stdout); // Live: each line must be visible before the next one arrives.
        }
    }
    return recording_close(&decode.recording);
}
