// SPDX-License-Identifier: MIT
#include "wheels.h"

#include "iwheel_linux/clock.h"

#include <string.h>

const uint16_t gw_gap_limits_ms[GW_GAP_BUCKETS - 1U] = {5, 10, 15, 20, 25, 30, 40, 50, 100};

void gw_gaps_note(gw_gaps_t *self, const iw_sent_t *sent) {
    if (sent->pairs == self->pairs) {
        return;
    }
    self->pairs = sent->pairs;
    const uint32_t gap_us = sent->gap_us;
    if (gap_us == 0U) {
        return; // The first pair after a pause.
    }
    uint32_t bucket = 0;
    while (bucket < GW_GAP_BUCKETS - 1U && gap_us > gw_gap_limits_ms[bucket] * IW_US_PER_MS) {
        bucket++;
    }
    self->count[bucket]++;
    if (gap_us > self->worst_us) {
        self->worst_us = gap_us;
    }
}

void gw_gaps_write(const gw_gaps_t *self, iwn_out_t *json) {
    iwn_out_open(json, "limits_ms", '[');
    for (uint32_t i = 0; i < GW_GAP_BUCKETS - 1U; i++) {
        iwn_out_int(json, NULL, gw_gap_limits_ms[i]);
    }
    iwn_out_close(json, ']');
    iwn_out_open(json, "count", '[');
    for (uint32_t i = 0; i < GW_GAP_BUCKETS; i++) {
        iwn_out_int(json, NULL, self->count[i]);
    }
    iwn_out_close(json, ']');
    iwn_out_known(json, "worst_us", self->worst_us > 0U, self->worst_us);
}

iw_config_fault_t gw_wheels_begin(gw_wheels_t *self, const iw_config_t *config, blackbox_ring_t *ring, bool restarted) {
    gw_tape_init(&self->tape, ring);
    iw_observation_init(&self->observation);
    const iw_hal_t port = iwl_hal(&self->hal);
    const iw_hal_t hal = gw_tape_hal(&self->tape, &port);
    const iw_config_fault_t fault = iw_gateway_init(&self->core, config, &hal, self->now_us, restarted);
    if (fault == IW_CONFIG_OK) {
        gw_wheels_note(self, IW_CLIENT_NONE,
                       &(blackbox_entry_t){.kind = BLACKBOX_START, .a = restarted, .b = config->listen_only});
    }
    return fault;
}

iw_snapshot_t gw_wheels_snapshot(const gw_wheels_t *self) {
    iw_snapshot_t seen;
    iw_gateway_snapshot(&self->core, self->now_us, &seen);
    return seen;
}

void gw_wheels_time(gw_wheels_t *self, iw_time_us_t now_us) {
    if (now_us > self->now_us) {
        self->now_us = now_us;
    }
    self->time_used = false;
}

void gw_wheels_time_request(gw_wheels_t *self) {
    if (self->time_used) {
        gw_wheels_time(self, iwl_clock_now_us());
    }
    self->time_used = true;
}

const char *gw_wheels_estop(const gw_wheels_t *self) {
    const int first = self->hal.contact_last[0];
    const int second = self->hal.contact_last[1];
    const bool worse = first >= 0 && (second < 0 || (first == 0 && second > 0));
    return (self->hal.two_contacts && worse) ? self->estop2 : self->estop;
}

bool gw_wheels_are_sent_to(const gw_wheels_t *self) {
    return iw_gateway_is_sending(&self->core);
}

iw_snapshot_t gw_wheels_step(gw_wheels_t *self) {
    gw_tape_step_begin(&self->tape, self->now_us);
    self->step_us = iw_gateway_step(&self->core, self->now_us);
    gw_tape_step_end(&self->tape);
    self->requested = false;
    const iw_snapshot_t seen = gw_wheels_snapshot(self);
    gw_gaps_note(&self->gaps, seen.sent);
    return seen;
}

void gw_wheels_slept(gw_wheels_t *self, iw_time_us_t for_us) {
    iw_gateway_suspended(&self->core, for_us);
    self->requested = true;
    gw_wheels_note(self, IW_CLIENT_NONE,
                   &(blackbox_entry_t){.kind = BLACKBOX_SUSPENDED, .as = {.value = (int64_t)for_us}});
}

void gw_wheels_stop(gw_wheels_t *self, iw_client_t client, iw_cause_t cause) {
    iw_gateway_stop(&self->core, self->now_us, client, cause);
    gw_wheels_note(self, client, &(blackbox_entry_t){.kind = BLACKBOX_STOP, .a = (uint8_t)cause});
    self->requested = true;
}

void gw_wheels_leave(gw_wheels_t *self, iw_client_t client) {
    iw_gateway_disconnect(&self->core, self->now_us, client);
    gw_wheels_note(self, client, &(blackbox_entry_t){.kind = BLACKBOX_GONE});
    self->requested = true;
}

static void note_assumption(gw_wheels_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry) {
    gw_wheels_note(self, (uint32_t)entry->source,
                   &(blackbox_entry_t){.kind = BLACKBOX_ASSUMPTION,
                                       .a = (uint8_t)item,
                                       .b = (uint8_t)entry->state,
                                       .as = {.value = entry->figure}});
}

void gw_wheels_set_assumption(gw_wheels_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *entry) {
    iw_gateway_set_assumption(&self->core, item, entry);
    note_assumption(self, item, &gw_wheels_snapshot(self).assumed[item]);
}

void gw_wheels_note(gw_wheels_t *self, uint32_t number, const blackbox_entry_t *entry) {
    blackbox_entry_t whole = *entry;
    whole.at_us = self->now_us;
    whole.number = number;
    gw_tape_put(&self->tape, &whole);
}

void gw_wheels_note_stop(gw_wheels_t *self, const iw_stop_t *stop) {
    gw_wheels_note(
        self, stop->number,
        &(blackbox_entry_t){
            .kind = BLACKBOX_STOPPED, .a = (uint8_t)stop->cause, .b = stop->sides, .as = {.value = stop->detail}});
    if (stop->from != IW_STATE_LATCHED) { // Otherwise the frames of the latch's first cause remain.
        gw_tape_mark(&self->tape);
    }
}

void gw_wheels_note_state(gw_wheels_t *self, const iw_snapshot_t *seen, iw_state_t before) {
    blackbox_entry_t entry = {.kind = BLACKBOX_STATE, .a = (uint8_t)seen->state, .b = (uint8_t)before};
    for (unsigned side = 0; side < IW_SIDES; side++) {
        entry.as.drive.speed_mm_s[side] = seen->applied.wheel[side].speed_mm_s;
        entry.as.drive.current_mA[side] = seen->applied.wheel[side].current_mA;
    }
    gw_wheels_note(self, seen->holder, &entry);
}

void gw_wheels_note_again(gw_wheels_t *self) {
    if (gw_tape_again(&self->tape, self->now_us)) {
        const iw_snapshot_t seen = gw_wheels_snapshot(self);
        gw_wheels_note_state(self, &seen, seen.state);
        if (seen.doubt != IW_ASSUMPTION_ITEMS) {
            note_assumption(self, seen.doubt, &seen.assumed[seen.doubt]);
        }
    }
}

static void write_frames(iwn_out_t *json, const char *name, const blackbox_entry_t *frames, uint32_t count) {
    iwn_out_open(json, name, '[');
    for (uint32_t i = 0; i < count; i++) {
        iw_can_frame_t frame = {.id = frames[i].number, .dlc = frames[i].a, .kind = frames[i].b};
        memcpy(frame.data, frames[i].as.data, sizeof frame.data);
        iwn_out_open(json, NULL, '{');
        iwn_out_frame(&frame, frames[i].at_us, json);
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, ']');
}

void gw_wheels_write_around(const gw_wheels_t *self, iwn_out_t *json) {
    const bool any = gw_wheels_snapshot(self).stop->number != 0U;
    write_frames(json, "frames_before", self->tape.before, self->tape.before_count);
    write_frames(json, "frames_after", self->tape.after, any ? self->tape.after_count : 0U);
}
