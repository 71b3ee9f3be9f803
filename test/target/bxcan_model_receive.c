// SPDX-License-Identifier: MIT
// The receive side of the model: filters, FIFOs, receive errors.
#include "bxcan_model_private.h"

#include <string.h>

#define FIRST_BANK 0x240U

void model_bytes_of(uint32_t low, uint32_t high, uint8_t *out_bytes) {
    for (uint32_t i = 0; i < 4U; i++) {
        out_bytes[i] = (uint8_t)(low >> (8U * i));
        out_bytes[4U + i] = (uint8_t)(high >> (8U * i));
    }
}

void model_fifo_release(model_fifo_t *fifo) {
    fifo->count--;
    fifo->full = false;
    memmove(&fifo->entry[0], &fifo->entry[1], (MODEL_DEPTH - 1U) * sizeof fifo->entry[0]);
}

static uint32_t *filter_register(bxcan_model_t *self, uint32_t offset) {
    const uint32_t index = (offset - FIRST_BANK) / 8U;
    switch (offset) {
    case 0x200:
        return &self->fmr;
    case 0x204:
        return &self->fm1r;
    case 0x20C:
        return &self->fs1r;
    case 0x214:
        return &self->ffa1r;
    case 0x21C:
        return &self->fa1r;
    default:
        return (offset >= FIRST_BANK && index < self->banks) ? &self->bank[index][(offset / 4U) % 2U] : NULL;
    }
}

uint32_t model_filter_read(bxcan_model_t *self, uint32_t offset) {
    const uint32_t *const found = filter_register(self, offset);
    if (found == NULL) {
        model_violate(self, "a register was read that does not exist", offset);
        return 0;
    }
    return *found;
}

/// 9.4: mode, scale and assignment can change only in filter initialisation. The values of a bank can change only there
/// or while the bank is inactive.
void model_filter_write(bxcan_model_t *self, uint32_t offset, uint32_t value) {
    uint32_t *const found = filter_register(self, offset);
    const bool initialising = (self->fmr & 1U) != 0U;
    if (found == NULL) {
        model_violate(self, "a register was written that does not exist", offset);
        return;
    }
    const uint32_t index = (offset - FIRST_BANK) / 8U;
    const bool is_bank = offset >= FIRST_BANK;
    const bool allowed =
        initialising || offset == 0x200U || offset == 0x21CU || (is_bank && ((self->fa1r >> index) & 1U) == 0U);
    if (!allowed) {
        model_violate(self, "a filter was changed while it is in force", offset);
        return;
    }
    if (offset != 0x200U && !is_bank && (value >> self->banks) != 0U && self->banks < 32U) {
        model_violate(self, "a bank was chosen that does not exist", offset);
    }
    *found = (offset == 0x200U) ? (value & 0x00003F01U) | 0x2A1C0000U : value;
}

/// Returns the identifier as a 32-bit filter reads it: STID, EXID, IDE, RTR, 0.
static uint32_t wide_of(const model_frame_t *frame) {
    const uint32_t identifier = frame->extended ? frame->id << 3 : frame->id << 21;
    return identifier | (frame->extended ? 4U : 0U) | (frame->remote ? 2U : 0U);
}

/// Returns the identifier as a 16-bit filter reads it: STID, RTR, IDE, the upper three bits of EXID.
static uint32_t narrow_of(const model_frame_t *frame) {
    const uint32_t wide = wide_of(frame);
    return ((wide >> 16) & 0xFFE0U) | (frame->remote ? 0x10U : 0U) | (frame->extended ? 0x08U : 0U) |
           ((wide >> 18) & 7U);
}

static bool bank_passes(const bxcan_model_t *self, uint32_t index, const model_frame_t *frame) {
    const uint32_t one = self->bank[index][0];
    const uint32_t two = self->bank[index][1];
    const bool is_list = ((self->fm1r >> index) & 1U) != 0U;
    if (((self->fs1r >> index) & 1U) != 0U) {
        const uint32_t wide = wide_of(frame);
        return is_list ? wide == one || wide == two : ((wide ^ one) & two) == 0U;
    }
    const uint32_t narrow = narrow_of(frame);
    if (is_list) {
        return narrow == (one & 0xFFFFU) || narrow == one >> 16 || narrow == (two & 0xFFFFU) || narrow == two >> 16;
    }
    return ((narrow ^ one) & (one >> 16)) == 0U || ((narrow ^ two) & (two >> 16)) == 0U;
}

static void store(bxcan_model_t *self, model_fifo_t *fifo, const model_frame_t *frame) {
    model_received_t entry = {wide_of(frame), frame->dlc, 0, 0};
    for (uint32_t i = 0; i < 4U; i++) {
        entry.rdlr |= (uint32_t)frame->data[i] << (8U * i);
        entry.rdhr |= (uint32_t)frame->data[4U + i] << (8U * i);
    }
    if (fifo->count < MODEL_DEPTH) {
        fifo->entry[fifo->count++] = entry;
        fifo->full = fifo->count == MODEL_DEPTH;
        return;
    }
    fifo->overrun = true;
    self->overruns++;
    if ((self->mcr & MCR_RFLM) == 0U) { // 7.3: overwrites the last stored frame; with RFLM the new one is lost.
        fifo->entry[MODEL_DEPTH - 1] = entry;
    }
}

bool bxcan_model_receive(bxcan_model_t *self, const model_frame_t *frame) {
    bxcan_model_dominant(self);
    if (!bxcan_model_is_on(self)) {
        return false;
    }
    self->rec = (self->rec > 127U) ? 119U : self->rec - ((self->rec > 0U) ? 1U : 0U);
    self->lec = 0;
    for (uint32_t i = 0; i < self->banks && (self->fmr & 1U) == 0U; i++) {
        if (((self->fa1r >> i) & 1U) != 0U && bank_passes(self, i, frame)) {
            store(self, &self->fifo[(self->ffa1r >> i) & 1U], frame);
            break;
        }
    }
    return (self->btr & BTR_SILM) == 0U;
}

void model_note_errors(bxcan_model_t *self) {
    const bool passive = self->tec > 127U || self->rec > 127U;
    if (self->tec > 255U && !self->bus_off) {
        self->bus_off = true;
        self->msr |= ((self->ier & IER_BOFIE) != 0U) ? MSR_ERRI : 0U;
    }
    if (passive && (self->ier & IER_EPVIE) != 0U) {
        self->msr |= MSR_ERRI;
    }
}

/// Rule of the bus, not of the controller: after the error flag every 8 dominant bits add 8 to the counter, the first
/// time after 14. A receiver becomes error passive, a transmitter bus-off.
void bxcan_model_hold(bxcan_model_t *self, uint32_t bits, bool transmitting) {
    bxcan_model_dominant(self);
    for (; bits > 0U && bxcan_model_is_on(self); bits--) {
        self->held_bits++;
        if (self->held_bits < 14U || (self->held_bits - 14U) % 8U != 0U) {
            continue;
        }
        if (transmitting) {
            self->tec += 8U;
        } else {
            self->rec = (self->rec < 247U) ? self->rec + 8U : 255U;
        }
        model_note_errors(self);
    }
}

void bxcan_model_receive_error(bxcan_model_t *self) {
    bxcan_model_dominant(self);
    if (bxcan_model_is_on(self)) {
        self->rec = (self->rec < 255U) ? self->rec + 1U : 255U;
        self->lec = 1;
        model_note_errors(self);
    }
}
