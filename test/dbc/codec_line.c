// SPDX-License-Identifier: MIT
// The C codec behind a pipe, so that a codec in another language can be compared with it. One line in, one line out:
//
//     decode ID HEXBYTES         ->  ID VALUE...   as the messages below, or: error
//     encode ID VALUE...         ->  ID HEXBYTES
//     row N                      ->  ID LENGTH PERIOD_MS KIND SIDE of the core's table
//
// Values are in the order of the frame's bytes. Ids are decimal.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../support/message.h"
#include "iwheel/codec.h"

#define LINE_MAX_BYTES 160
#define VALUES_MAX     4

/// Writes the message's values in the order of its bytes; returns how many.
static size_t values_of(const message_t *message, long *values) {
    switch (message->kind) {
    case IW_CODEC_SETPOINT:
        values[0] = message->as.setpoint.type;
        values[1] = message->as.setpoint.speed_mm_s;
        values[2] = message->as.setpoint.current_mA;
        return 3;
    case IW_CODEC_SPEED:
        values[0] = message->as.speed.speed_rpm;
        values[1] = message->as.speed.acceleration_raw;
        return 2;
    case IW_CODEC_STATUS:
        values[0] = message->as.status.battery_dV;
        values[1] = message->as.status.temperature_degC;
        values[2] = message->as.status.odometry_ticks;
        values[3] = message->as.status.cpu_percent;
        return 4;
    case IW_CODEC_POSE:
        values[0] = message->as.pose.x_mm;
        values[1] = message->as.pose.y_mm;
        values[2] = message->as.pose.z_mm;
        values[3] = message->as.pose.psi_mrad;
        return 4;
    case IW_CODEC_FORCE:
        values[0] = message->as.force.force_raw;
        values[1] = message->as.force.debug_raw;
        return 2;
    case IW_CODEC_OFFSET:
    default:
        values[0] = message->as.offset.offset_dN;
        return 1;
    }
}

static void set_values(message_t *message, const long *values) {
    switch (message->kind) {
    case IW_CODEC_SETPOINT:
        message->as.setpoint.type = (uint8_t)values[0];
        message->as.setpoint.speed_mm_s = (int16_t)values[1];
        message->as.setpoint.current_mA = (int16_t)values[2];
        break;
    case IW_CODEC_SPEED:
        message->as.speed.speed_rpm = (int16_t)values[0];
        message->as.speed.acceleration_raw = (int16_t)values[1];
        break;
    case IW_CODEC_STATUS:
        message->as.status.battery_dV = (uint8_t)values[0];
        message->as.status.temperature_degC = (uint8_t)values[1];
        message->as.status.odometry_ticks = (int32_t)values[2];
        message->as.status.cpu_percent = (uint8_t)values[3];
        break;
    case IW_CODEC_POSE:
        message->as.pose.x_mm = (int16_t)values[0];
        message->as.pose.y_mm = (int16_t)values[1];
        message->as.pose.z_mm = (int16_t)values[2];
        message->as.pose.psi_mrad = (int16_t)values[3];
        break;
    case IW_CODEC_FORCE:
        message->as.force.force_raw = (int16_t)values[0];
        message->as.force.debug_raw = (int16_t)values[1];
        break;
    case IW_CODEC_OFFSET:
    default:
        message->as.offset.offset_dN = (int16_t)values[0];
        break;
    }
}

static void decode_line(uint32_t id, const char *hex) {
    iw_can_frame_t frame = {.id = id};
    message_t message;
    long values[VALUES_MAX];
    for (; frame.dlc < IW_CAN_DATA_MAX && strlen(hex) >= 2; hex += 2) {
        const char digits[3] = {hex[0], hex[1], '\0'};
        frame.data[frame.dlc++] = (uint8_t)strtoul(digits, NULL, 16);
    }
    if (!message_decode(&frame, &message)) {
        printf("error\n");
        return;
    }
    const size_t count = values_of(&message, values);
    printf("%" PRIu32, id);
    for (size_t i = 0; i < count; i++) {
        printf(" %ld", values[i]);
    }
    printf("\n");
}

static void encode_line(uint32_t id, const char *text) {
    iw_can_frame_t frame = {0};
    message_t message = {IW_CODEC_POSE, IW_LEFT, {.pose = {0, 0, 0, 0}}};
    long values[VALUES_MAX];
    char *rest = NULL;
    for (size_t i = 0; i < VALUES_MAX; i++) {
        values[i] = strtol(text, &rest, 10);
        text = rest;
    }
    const iw_codec_row_t *row = iw_codec_find(id);
    if (row != NULL) {
        message.kind = (iw_codec_kind_t)row->kind;
        message.side = (iw_side_t)row->side;
        set_values(&message, values);
    }
    if (message_encode(&message, &frame) != IW_OK) {
        printf("error\n");
        return;
    }
    printf("%" PRIu32 " ", frame.id);
    for (size_t i = 0; i < frame.dlc; i++) {
        printf("%02X", frame.data[i]);
    }
    printf("\n");
}

static void row_line(uint32_t number) {
    const iw_codec_row_t *row = &iw_codec_rows[number % IW_CODEC_ROWS];
    printf("%u %u %u %s %s\n", row->id, row->length, row->period_ms, iw_codec_name((iw_codec_kind_t)row->kind),
           (row->side == IW_LEFT) ? "left" : "right");
}

int main(void) {
    char line[LINE_MAX_BYTES];
    while (fgets(line, sizeof line, stdin) != NULL) {
        char *rest = line + strcspn(line, " ");
        line[strcspn(line, "\n")] = '\0';
        const uint32_t id = (uint32_t)strtoul(rest, &rest, 10);
        rest += strspn(rest, " ");
        if (strncmp(line, "decode ", 7) == 0) {
            decode_line(id, rest);
        } else if (strncmp(line, "encode ", 7) == 0) {
            encode_line(id, rest);
        } else if (strncmp(line, "row ", 4) == 0) {
            row_line(id);
        } else {
            (void)fprintf(stderr, "codec_line: neither 'decode ID HEX', 'encode ID VALUES' nor 'row N': %s\n", line);
            return 65;
        }
    }
    return 0;
}
