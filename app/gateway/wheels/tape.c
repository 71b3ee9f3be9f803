// SPDX-License-Identifier: MIT
#include "tape.h"

#include <string.h>

/// Number of entries to search for frames among requests and steps.
#define READ_BACK  ((uint64_t)8U * GW_AROUND)
#define UNREPORTED 0xFFU
#define AGAIN_US   1000000U
/// Bits of `facts`.
#define TIMING 1U
#define ECHO   2U

void gw_tape_init(gw_tape_t *self, blackbox_ring_t *ring) {
    memset(self, 0, sizeof *self);
    self->ring = ring;
    self->facts = UNREPORTED;
    self->after_count = GW_AROUND; // No frames are awaited.
}

void gw_tape_put(gw_tape_t *self, const blackbox_entry_t *entry) {
    if (self->ring != NULL) {
        blackbox_ring_put(self->ring, entry);
    }
}

static void put_frame(gw_tape_t *self, const iw_can_frame_t *frame) {
    blackbox_entry_t entry = {
        .at_us = self->step_us, .kind = BLACKBOX_FRAME, .number = frame->id, .a = frame->dlc, .b = frame->kind};
    memcpy(entry.as.data, frame->data, sizeof entry.as.data);
    gw_tape_put(self, &entry);
    if (self->tapped < GW_FRAMES) {
        self->tap[self->tapped++] = (gw_tapped_t){.at_us = self->step_us, .frame = *frame};
    }
    if (self->after_count < GW_AROUND) {
        self->after[self->after_count++] = entry;
    }
}

static void put_value(gw_tape_t *self, blackbox_kind_t kind, uint32_t number, int64_t value) {
    const blackbox_entry_t entry = {
        .at_us = self->step_us, .kind = (uint8_t)kind, .number = number, .as = {.value = value}};
    gw_tape_put(self, &entry);
}

/// Records the first frame that the port refused. The core passes the frame after it in a separate call, or not at all.
static int tape_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    gw_tape_t *self = (gw_tape_t *)context;
    const int answer = self->port.send(self->port.context, frames, count);
    const uint32_t accepted = (answer > 0) ? (uint32_t)answer : 0U;
    if (accepted < count) {
        put_value(self, BLACKBOX_NOT_SENT, frames[accepted].id, (answer < 0) ? answer : 0);
    }
    return answer;
}

static int tape_receive(void *context, iw_can_frame_t *out_frame) {
    gw_tape_t *self = (gw_tape_t *)context;
    const int answer = self->port.receive(self->port.context, out_frame);
    if (answer > 0) {
        self->step_frames++;
        put_frame(self, out_frame);
    }
    return answer;
}

static iw_bus_state_t tape_bus_state(void *context) {
    gw_tape_t *self = (gw_tape_t *)context;
    const iw_bus_state_t state = self->port.bus_state(self->port.context);
    if (!self->answered || state != self->bus) {
        const blackbox_entry_t entry = {.at_us = self->step_us, .kind = BLACKBOX_BUS, .a = (uint8_t)state};
        gw_tape_put(self, &entry);
    }
    self->bus = state;
    self->answered = true; // The core reads the e-stop first.
    return state;
}

static int tape_purge(void *context) {
    gw_tape_t *self = (gw_tape_t *)context;
    const int answer = self->port.purge(self->port.context);
    put_value(self, BLACKBOX_PURGE, 0, answer);
    return answer;
}

static int tape_estop_pressed(void *context) {
    gw_tape_t *self = (gw_tape_t *)context;
    const int answer = self->port.estop_pressed(self->port.context);
    if (!self->answered || answer != self->estop) {
        put_value(self, BLACKBOX_ESTOP, 0, answer);
    }
    self->estop = answer;
    return answer;
}

iw_hal_t gw_tape_hal(gw_tape_t *self, const iw_hal_t *port) {
    self->port = *port;
    return (iw_hal_t){
        .send = tape_send,
        .receive = tape_receive,
        .bus_state = tape_bus_state,
        .purge = tape_purge,
        .estop_pressed = tape_estop_pressed,
        .context = self,
    };
}

void gw_tape_step_begin(gw_tape_t *self, iw_time_us_t now_us) {
    self->step_us = now_us;
    self->step_frames = 0;
}

void gw_tape_step_end(gw_tape_t *self) {
    if (self->step_frames == 0U) {
        const blackbox_entry_t entry = {.at_us = self->step_us, .kind = BLACKBOX_STEP};
        gw_tape_put(self, &entry);
    }
}

void gw_tape_facts(gw_tape_t *self, iw_time_us_t now_us, const iw_bus_facts_t *facts) {
    const uint8_t bits = (uint8_t)((facts->timing_contradicted ? TIMING : 0U) | (facts->echo_proven ? ECHO : 0U));
    if (bits != self->facts) {
        const blackbox_entry_t entry = {
            .at_us = now_us, .kind = BLACKBOX_FACTS, .a = facts->timing_contradicted, .b = facts->echo_proven};
        gw_tape_put(self, &entry);
    }
    self->facts = bits;
}

bool gw_tape_again(gw_tape_t *self, iw_time_us_t now_us) {
    if (!self->answered || now_us - self->again_us < AGAIN_US) {
        return false;
    }
    self->again_us = now_us;
    const blackbox_entry_t bus = {.at_us = now_us, .kind = BLACKBOX_BUS, .a = (uint8_t)self->bus};
    const blackbox_entry_t estop = {.at_us = now_us, .kind = BLACKBOX_ESTOP, .as = {.value = self->estop}};
    const blackbox_entry_t facts = {
        .at_us = now_us, .kind = BLACKBOX_FACTS, .a = self->facts & TIMING, .b = (self->facts & ECHO) != 0U};
    gw_tape_put(self, &estop);
    gw_tape_put(self, &bus);
    gw_tape_put(self, &facts);
    return true;
}

static int16_t saturate(int32_t value) {
    return (int16_t)((value > INT16_MAX) ? INT16_MAX : (value < INT16_MIN) ? INT16_MIN : value);
}

void gw_tape_drive(gw_tape_t *self, const blackbox_entry_t *entry, const iw_drive_t *request, iw_time_us_t sent_us) {
    blackbox_entry_t whole = *entry;
    whole.kind = BLACKBOX_DRIVE;
    whole.a = request->has_current;
    whole.as.drive.age_us = (uint32_t)((entry->at_us - sent_us < UINT32_MAX) ? entry->at_us - sent_us : UINT32_MAX);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        whole.as.drive.speed_mm_s[side] = request->speed_mm_s[side];
        whole.as.drive.current_mA[side] = request->has_current ? saturate(request->current_mA[side]) : (int16_t)0;
    }
    gw_tape_put(self, &whole);
}

void gw_tape_mark(gw_tape_t *self) {
    static blackbox_entry_t last[READ_BACK]; // Too large for a stack.
    size_t count = 0;
    self->before_count = 0;
    self->after_count = 0;
    if (self->ring == NULL) {
        return;
    }
    const uint64_t written = blackbox_ring_written(self->ring);
    (void)blackbox_ring_copy(self->ring, (written > READ_BACK) ? written - READ_BACK : 0U, written, last, &count);
    size_t first = count;
    for (uint32_t frames = 0; first > 0U && frames < GW_AROUND; first--) {
        frames += (last[first - 1U].kind == (uint8_t)BLACKBOX_FRAME) ? 1U : 0U;
    }
    for (; first < count; first++) {
        if (last[first].kind == (uint8_t)BLACKBOX_FRAME) {
            self->before[self->before_count++] = last[first];
        }
    }
}
