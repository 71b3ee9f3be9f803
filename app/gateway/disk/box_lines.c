// SPDX-License-Identifier: MIT
#include "box_files.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/words.h"

#include <string.h>

#define FORMAT_VERSION 1

static iwn_out_t begin(char out_line[GW_BOX_LINE_SIZE], const char *type) {
    iwn_out_t json;
    iwn_out_init(&json, out_line, GW_BOX_LINE_SIZE);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "type", type);
    return json;
}

static size_t end(iwn_out_t *json) {
    iwn_out_close(json, '}');
    return iwn_out_finish(json);
}

size_t gw_box_line_head(const gw_box_config_t *config, const gw_box_order_t *order, bool from_start,
                        char out_line[GW_BOX_LINE_SIZE]) {
    iwn_out_t json = begin(out_line, "blackbox");
    iwn_out_int(&json, "format", FORMAT_VERSION);
    iwn_out_text(&json, "version", IWHEEL_VERSION);
    iwn_out_text(&json, "bus", config->bus);
    iwn_out_text(&json, "estop", config->estop);
    iwn_out_int(&json, "wall_minus_monotonic_us", order->wall_minus_us);
    iwn_out_bool(&json, "from_start", from_start);
    return end(&json);
}

size_t gw_box_line_stop(const gw_box_order_t *order, bool in_motion, char out_line[GW_BOX_LINE_SIZE]) {
    const iw_stop_t *stop = &order->note.stop;
    iwn_out_t json = begin(out_line, "why");
    iwn_out_int(&json, "number", stop->number);
    iwn_out_text(&json, "cause", order->cause);
    iwn_out_text(&json, "side", (order->side[0] != '\0') ? order->side : NULL);
    iwn_out_int(&json, "detail", stop->detail);
    iwn_out_text(&json, "from", order->from);
    iwn_out_bool(&json, "latched", stop->latched);
    iwn_out_bool(&json, "in_motion", in_motion);
    iwn_out_known(&json, "client", stop->client != IW_CLIENT_NONE, stop->client);
    iwn_out_text(&json, "client_name", (order->note.client_name[0] != '\0') ? order->note.client_name : NULL);
    iwn_out_int(&json, "applied_left_mm_s", stop->applied.wheel[IW_LEFT].speed_mm_s);
    iwn_out_int(&json, "applied_right_mm_s", stop->applied.wheel[IW_RIGHT].speed_mm_s);
    iwn_out_int(&json, "at_us", (int64_t)stop->at_us);
    iwn_out_int(&json, "wall_us", order->note.wall_us);
    iwn_out_text(&json, "sentence", order->note.sentence);
    return end(&json);
}

bool gw_box_line_is_harmless(const char *lines) {
    const char *stop = strstr(lines, "\n{\"type\":\"why\"");
    if (stop == NULL) {
        return false;
    }
    if (strstr(stop, "\"in_motion\":") != NULL) {
        return strstr(stop, "\"in_motion\":false") != NULL;
    }
    return strstr(stop, "\"applied_left_mm_s\":0,\"applied_right_mm_s\":0,") != NULL;
}

static void put_refusal(iwn_out_t *json, uint8_t refusal) {
    iwn_out_text(json, "refused",
                 (refusal == (uint8_t)IW_REFUSE_NONE) ? NULL : iwn_error_name(iwn_error_of((iw_refusal_t)refusal)));
}

static void put_drive(iwn_out_t *json, const blackbox_entry_t *entry) {
    const blackbox_drive_t *drive = &entry->as.drive;
    iwn_out_int(json, "client", entry->number);
    iwn_out_int(json, "left_mm_s", drive->speed_mm_s[IW_LEFT]);
    iwn_out_int(json, "right_mm_s", drive->speed_mm_s[IW_RIGHT]);
    iwn_out_known(json, "left_mA", entry->a != 0U, drive->current_mA[IW_LEFT]);
    iwn_out_known(json, "right_mA", entry->a != 0U, drive->current_mA[IW_RIGHT]);
    iwn_out_int(json, "age_us", drive->age_us);
    put_refusal(json, entry->b);
}

static void put_decision(iwn_out_t *json, const blackbox_entry_t *entry) {
    if (entry->kind == (uint8_t)BLACKBOX_STATE) {
        iwn_out_text(json, "state", iwn_state_name((iw_state_t)entry->a));
        iwn_out_text(json, "before", iwn_state_name((iw_state_t)entry->b));
        iwn_out_known(json, "client", entry->number != IW_CLIENT_NONE, entry->number);
        iwn_out_int(json, "applied_left_mm_s", entry->as.drive.speed_mm_s[IW_LEFT]);
        iwn_out_int(json, "applied_right_mm_s", entry->as.drive.speed_mm_s[IW_RIGHT]);
    } else {
        iwn_out_int(json, "number", entry->number);
        iwn_out_text(json, "cause", iwn_cause_name((iw_cause_t)entry->a));
        iwn_out_text(json, "side", iwn_sides_name(entry->b));
        iwn_out_int(json, "detail", entry->as.value);
    }
}

static void put_answer(iwn_out_t *json, const blackbox_entry_t *entry) {
    switch (entry->kind) {
    case BLACKBOX_BUS:
        iwn_out_text(json, "state", iwn_bus_state_name((iw_bus_state_t)entry->a));
        break;
    case BLACKBOX_FACTS:
        iwn_out_bool(json, "timing_contradicted", entry->a != 0U);
        iwn_out_bool(json, "echo_proven", entry->b != 0U);
        break;
    case BLACKBOX_START:
        iwn_out_bool(json, "restarted", entry->a != 0U);
        iwn_out_bool(json, "listen_only", entry->b != 0U);
        break;
    case BLACKBOX_SUSPENDED:
        iwn_out_int(json, "suspended_us", entry->as.value);
        break;
    case BLACKBOX_NOT_SENT:
        iwn_out_int(json, "id", entry->number);
        iwn_out_int(json, "answer", entry->as.value);
        break;
    default:
        iwn_out_int(json, "answer", entry->as.value);
        break;
    }
}

static void put_request(iwn_out_t *json, const blackbox_entry_t *entry) {
    switch (entry->kind) {
    case BLACKBOX_ARM:
        iwn_out_int(json, "client", entry->number);
        iwn_out_bool(json, "takeover", entry->a != 0U);
        put_refusal(json, entry->b);
        break;
    case BLACKBOX_STOP:
        iwn_out_int(json, "client", entry->number);
        iwn_out_text(json, "cause", iwn_cause_name((iw_cause_t)entry->a));
        break;
    case BLACKBOX_RESET:
    case BLACKBOX_RELEASE:
        put_refusal(json, entry->b);
        break;
    case BLACKBOX_ASSUMPTION:
        iwn_out_text(json, "item", iwn_assumption_item_name((iw_assumption_item_t)entry->a));
        iwn_out_text(json, "state", iwn_assumption_state_name((iw_assumption_state_t)entry->b));
        iwn_out_text(json, "evidence", iwn_source_name((iw_source_t)entry->number));
        iwn_out_int(json, "figure", entry->as.value);
        break;
    case BLACKBOX_TARE:
        iwn_out_text(json, "side", (entry->a == (uint8_t)IW_LEFT) ? "left" : "right");
        iwn_out_bool(json, "done", entry->b == (uint8_t)IW_TARE_OK);
        break;
    default:
        iwn_out_int(json, "client", entry->number);
        break;
    }
}

size_t gw_box_line_entry(const blackbox_entry_t *entry, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]) {
    iwn_out_t json = begin(out_line, blackbox_kind_name((blackbox_kind_t)entry->kind));
    iwn_out_int(&json, "frames", (int64_t)frames);
    iwn_out_int(&json, "t_us", (int64_t)entry->at_us);
    switch (entry->kind) {
    case BLACKBOX_STEP:
        break;
    case BLACKBOX_DRIVE:
        put_drive(&json, entry);
        break;
    case BLACKBOX_STATE:
    case BLACKBOX_STOPPED:
        put_decision(&json, entry);
        break;
    case BLACKBOX_ARM:
    case BLACKBOX_STOP:
    case BLACKBOX_ESTOPPED:
    case BLACKBOX_RESET:
    case BLACKBOX_RELEASE:
    case BLACKBOX_GONE:
    case BLACKBOX_TARE:
    case BLACKBOX_ASSUMPTION:
        put_request(&json, entry);
        break;
    default:
        put_answer(&json, entry);
        break;
    }
    return end(&json);
}

size_t gw_box_line_lost(uint64_t entries, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]) {
    iwn_out_t json = begin(out_line, "lost");
    iwn_out_int(&json, "frames", (int64_t)frames);
    iwn_out_int(&json, "entries", (int64_t)entries);
    return end(&json);
}

size_t gw_box_line_end(uint64_t frames, char out_line[GW_BOX_LINE_SIZE]) {
    iwn_out_t json = begin(out_line, "end");
    iwn_out_int(&json, "frames", (int64_t)frames);
    return end(&json);
}
