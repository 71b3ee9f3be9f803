// SPDX-License-Identifier: MIT
#include "bxcan_model.h"

#include "bxcan_model_private.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void model_violate(bxcan_model_t *self, const char *what, uint32_t offset) {
    if (self->violations++ == 0U) {
        (void)snprintf(self->violation, sizeof self->violation, "%s (register 0x%03X)", what, (unsigned)offset);
    }
}

bxcan_model_t *bxcan_model_create(uint32_t banks) {
    bxcan_model_t *self = malloc(sizeof *self);
    if (self != NULL) {
        bxcan_model_reset(self, banks);
    }
    return self;
}

void bxcan_model_destroy(bxcan_model_t *self) {
    free(self);
}

void bxcan_model_reset(bxcan_model_t *self, uint32_t banks) {
    memset(self, 0, sizeof *self);
    self->banks = banks;
    self->mcr = 0x00010002U;
    self->msr = 0x00000C02U;
    self->btr = 0x01230000U;
    self->fmr = 0x2A1C0E01U;
}

/// The handshakes of chapter 4: the requests of INRQ and SLEEP, and the time of their acknowledgement.
static void settle_mode(bxcan_model_t *self) {
    bool on_bus = false;
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        on_bus = on_bus || self->mailbox[i].on_bus;
    }
    if (self->deaf || on_bus) {
        return; // Initialisation waits for the end of the frame under way.
    }
    if ((self->mcr & MCR_INRQ) != 0U && (self->mcr & MCR_SLEEP) == 0U) {
        self->msr = (self->msr & ~MSR_SLAK) | MSR_INAK;
        self->joining = false;
        self->recovering = false;
    } else if ((self->mcr & MCR_SLEEP) != 0U) {
        if ((self->msr & MSR_INAK) == 0U) {
            self->msr |= MSR_SLAK;
        }
    } else if ((self->msr & (MSR_INAK | MSR_SLAK)) != 0U && !self->joining) {
        self->joining = true;
        self->recessive_bits = 0;
        self->recovered = 0;
        self->recovering = self->bus_off && (self->msr & MSR_INAK) != 0U;
    }
}

static void write_mcr(bxcan_model_t *self, uint32_t value) {
    if ((value & MCR_RESET) != 0U) {
        bxcan_model_reset(self, self->banks);
        return;
    }
    self->mcr = value & 0x000100FFU;
    settle_mode(self);
}

static void complete(bxcan_model_t *self, int mailbox, uint32_t flags) {
    model_mailbox_t *const box = &self->mailbox[mailbox];
    box->pending = false;
    box->aborting = false;
    box->on_bus = false;
    box->tir &= ~1U;
    self->tsr = (self->tsr & ~(0xFU << (8U * (uint32_t)mailbox))) | ((TSR_RQCP | flags) << (8U * (uint32_t)mailbox));
}

/// Aborts a scheduled mailbox. The result of the last attempt stays readable.
static void complete_abort(bxcan_model_t *self, int mailbox) {
    complete(self, mailbox, (self->tsr >> (8U * (uint32_t)mailbox)) & (TSR_ALST | TSR_TERR));
}

static void write_tsr(bxcan_model_t *self, uint32_t value) {
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        const uint32_t ours = value >> (8U * (uint32_t)i);
        if ((ours & TSR_RQCP) != 0U) { // Clears RQCP, TXOK, ALST and TERR together.
            self->tsr &= ~(0xFU << (8U * (uint32_t)i));
        }
        if ((ours & TSR_ABRQ) != 0U && self->mailbox[i].pending && !self->mailbox[i].aborting) {
            self->mailbox[i].aborting = true;
            self->mailbox[i].delayed = self->abort_reads;
            if (!self->mailbox[i].on_bus && self->abort_reads == 0U) {
                complete_abort(self, i);
            }
        }
    }
}

static uint32_t read_tsr(bxcan_model_t *self) {
    uint32_t value = self->tsr;
    uint32_t code = MODEL_MAILBOXES - 1U;
    for (int i = MODEL_MAILBOXES - 1; i >= 0; i--) {
        model_mailbox_t *const box = &self->mailbox[i];
        if (box->aborting && !box->on_bus && (box->delayed == 0U || --box->delayed == 0U)) {
            complete_abort(self, i);
            value = self->tsr;
        }
    }
    for (int i = MODEL_MAILBOXES - 1; i >= 0; i--) {
        const model_mailbox_t *const box = &self->mailbox[i];
        value |= box->aborting ? TSR_ABRQ << (8U * (uint32_t)i) : 0U;
        value |= box->pending ? 0U : TSR_TME << (uint32_t)i;
        code = box->pending ? code : (uint32_t)i;
    }
    return value | (code << 24);
}

static void write_mailbox(bxcan_model_t *self, uint32_t offset, uint32_t value) {
    model_mailbox_t *const box = &self->mailbox[(offset - 0x180U) / 0x10U];
    uint32_t *const registers[4] = {&box->tir, &box->tdtr, &box->tdlr, &box->tdhr};
    if (box->pending) {
        model_violate(self, "a mailbox that is not empty was written", offset);
        return;
    }
    *registers[(offset / 4U) % 4U] = value;
    if (offset % 0x10U == 0U && (value & 1U) != 0U) {
        if ((self->msr & (MSR_INAK | MSR_SLAK)) != 0U) {
            model_violate(self, "transmission requested outside normal mode", offset);
        }
        box->pending = true;
        box->order = ++self->requests;
        self->tsr &= ~(0xFU << (8U * (uint32_t)(box - self->mailbox)));
    }
}

static uint32_t read_fifo_status(bxcan_model_t *self, model_fifo_t *fifo) {
    if (fifo->release_reads > 0U && --fifo->release_reads == 0U) {
        model_fifo_release(fifo);
    }
    const uint32_t flags = (fifo->full ? RFR_FULL : 0U) | (fifo->overrun ? RFR_FOVR : 0U);
    (void)self;
    return fifo->count | flags | ((fifo->release_reads > 0U) ? RFR_RFOM : 0U);
}

static void write_fifo_status(bxcan_model_t *self, model_fifo_t *fifo, uint32_t value, uint32_t offset) {
    fifo->full = fifo->full && (value & RFR_FULL) == 0U;
    fifo->overrun = fifo->overrun && (value & RFR_FOVR) == 0U;
    if ((value & RFR_RFOM) == 0U) {
        return;
    }
    if (fifo->count == 0U || fifo->release_reads > 0U) {
        model_violate(self, "a FIFO was released that is empty or being released", offset);
    } else if (self->release_slow > 0U) {
        fifo->release_reads = self->release_slow;
    } else {
        model_fifo_release(fifo);
    }
}

static uint32_t read_fifo_output(bxcan_model_t *self, uint32_t offset) {
    const model_fifo_t *const fifo = &self->fifo[(offset - 0x1B0U) / 0x10U];
    const model_received_t *const entry = &fifo->entry[0];
    const uint32_t words[4] = {entry->rir, entry->rdtr, entry->rdlr, entry->rdhr};
    if (fifo->count == 0U || fifo->release_reads > 0U) {
        model_violate(self, "the output of a FIFO was read that shows no new frame", offset);
    }
    return words[(offset / 4U) % 4U];
}

static uint32_t read_esr(const bxcan_model_t *self) {
    const uint32_t most = (self->tec > self->rec) ? self->tec : self->rec;
    return ((most >= 96U) ? 1U : 0U) | ((most > 127U) ? ESR_EPVF : 0U) | (self->bus_off ? ESR_BOFF : 0U) |
           (self->lec << 4) | ((self->tec & 0xFFU) << 16) | (self->rec << 24);
}

uint32_t bxcan_model_read(bxcan_model_t *self, uint32_t offset) {
    if (offset >= 0x180U && offset < 0x1B0U) {
        const model_mailbox_t *const box = &self->mailbox[(offset - 0x180U) / 0x10U];
        const uint32_t words[4] = {box->tir, box->tdtr, box->tdlr, box->tdhr};
        return words[(offset / 4U) % 4U];
    }
    if (offset >= 0x1B0U && offset < 0x1D0U) {
        return read_fifo_output(self, offset);
    }
    switch (offset) {
    case 0x00:
        return self->mcr;
    case 0x04:
        settle_mode(self);
        return self->msr;
    case 0x08:
        return read_tsr(self);
    case 0x0C:
    case 0x10:
        return read_fifo_status(self, &self->fifo[(offset - 0x0CU) / 4U]);
    case 0x14:
        return self->ier;
    case 0x18:
        return read_esr(self);
    case 0x1C:
        return self->btr;
    default:
        return model_filter_read(self, offset);
    }
}

void bxcan_model_write(bxcan_model_t *self, uint32_t offset, uint32_t value) {
    if (offset >= 0x180U && offset < 0x1B0U) {
        write_mailbox(self, offset, value);
        return;
    }
    switch (offset) {
    case 0x00:
        write_mcr(self, value);
        break;
    case 0x04:
        self->msr &= ~(value & (MSR_ERRI | 0x18U));
        break;
    case 0x08:
        write_tsr(self, value);
        break;
    case 0x0C:
    case 0x10:
        write_fifo_status(self, &self->fifo[(offset - 0x0CU) / 4U], value, offset);
        break;
    case 0x14:
        self->ier = value & 0x00038F7FU;
        break;
    case 0x18:
        self->lec = (value >> 4) & 7U;
        break;
    case 0x1C:
        if ((self->msr & MSR_INAK) == 0U || self->joining) {
            model_violate(self, "BTR was written outside initialisation mode", offset);
        } else {
            self->btr = value & 0xC37F03FFU;
        }
        break;
    default:
        model_filter_write(self, offset, value);
        break;
    }
}

bool bxcan_model_is_on(const bxcan_model_t *self) {
    return (self->msr & (MSR_INAK | MSR_SLAK)) == 0U && !self->bus_off;
}

/// 4.2: normal mode begins after 11 recessive bits. 7.6: bus-off ends after 128 times 11, if software has begun the
/// recovery.
static void check_idle(bxcan_model_t *self) {
    if (self->joining) {
        self->joining = false;
        self->msr &= ~(MSR_INAK | MSR_SLAK);
    }
    const bool may_recover = self->recovering || (self->bus_off && (self->mcr & MCR_ABOM) != 0U);
    if (may_recover && ++self->recovered >= 128U) {
        self->bus_off = false;
        self->recovering = false;
        self->tec = 0;
        self->rec = 0;
    }
}

void bxcan_model_recessive(bxcan_model_t *self, uint32_t bits) {
    if (self->deaf) {
        return;
    }
    settle_mode(self);
    self->held_bits = 0;
    for (; bits > 0U; bits--) {
        if (++self->recessive_bits >= 11U) {
            self->recessive_bits = 0;
            check_idle(self);
        }
    }
}

void bxcan_model_dominant(bxcan_model_t *self) {
    self->recessive_bits = 0;
}

/// 7.1: the lowest identifier is first; of equal identifiers, the lowest mailbox. With TXFP, the order of the requests
/// applies.
static uint64_t rank(const bxcan_model_t *self, const model_mailbox_t *box) {
    if ((self->mcr & MCR_TXFP) != 0U) {
        return box->order;
    }
    const bool extended = (box->tir & IR_IDE) != 0U;
    const uint64_t base = box->tir >> 21;
    const uint64_t rest = extended ? (box->tir >> 3) & 0x3FFFFU : 0U;
    const uint64_t remote = (box->tir >> 1) & 1U;
    // Order on the bus: 11 bits, RTR or SRR, IDE, 18 bits, RTR.
    return (base << 21) | ((extended ? 1U : remote) << 20) | ((extended ? 1ULL : 0ULL) << 19) | (rest << 1) |
           (extended ? remote : 0U);
}

int bxcan_model_offer(const bxcan_model_t *self, model_frame_t *out_frame) {
    int best = MODEL_NONE;
    if (!bxcan_model_is_on(self) || (self->btr & BTR_SILM) != 0U || (self->mcr & MCR_INRQ) != 0U) {
        return MODEL_NONE;
    }
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        const model_mailbox_t *const box = &self->mailbox[i];
        if (box->pending && !box->aborting && (best < 0 || rank(self, box) < rank(self, &self->mailbox[best]))) {
            best = i;
        }
    }
    if (best >= 0) {
        const model_mailbox_t *const box = &self->mailbox[best];
        out_frame->extended = (box->tir & IR_IDE) != 0U;
        out_frame->remote = (box->tir & IR_RTR) != 0U;
        out_frame->id = out_frame->extended ? box->tir >> 3 : box->tir >> 21;
        out_frame->dlc = (uint8_t)(box->tdtr & 0xFU);
        model_bytes_of(box->tdlr, box->tdhr, out_frame->data);
    }
    return best;
}

void bxcan_model_begin(bxcan_model_t *self, int mailbox) {
    self->mailbox[mailbox].on_bus = true;
}

static void count_transmit_error(bxcan_model_t *self, model_end_t end) {
    const bool passive = self->tec > 127U || self->rec > 127U;
    self->lec = (end == MODEL_NO_ACKNOWLEDGEMENT) ? 3U : 5U;
    if (end != MODEL_NO_ACKNOWLEDGEMENT || !passive) { // A passive node alone on the bus does not become bus-off.
        self->tec += 8U;
    }
    model_note_errors(self);
}

/// 7.1 and 9.2: ALST and TERR describe the last attempt, also while the mailbox is scheduled again. RQCP is set at the
/// end of the request, and TXOK only with a success.
static void note_failure(bxcan_model_t *self, int mailbox, model_end_t end) {
    const uint32_t flag = (end == MODEL_LOST_ARBITRATION) ? TSR_ALST : TSR_TERR;
    if (end != MODEL_LOST_ARBITRATION) {
        count_transmit_error(self, end);
    }
    if (self->mailbox[mailbox].aborting || (self->mcr & MCR_NART) != 0U) {
        complete(self, mailbox, flag);
    } else {
        self->tsr = (self->tsr & ~(0xFU << (8U * (uint32_t)mailbox))) | (flag << (8U * (uint32_t)mailbox));
    }
}

void bxcan_model_end(bxcan_model_t *self, int mailbox, model_end_t end) {
    self->mailbox[mailbox].on_bus = false;
    if (end == MODEL_SENT) {
        self->lec = 0;
        self->tec -= (self->tec > 0U) ? 1U : 0U;
        complete(self, mailbox, TSR_TXOK);
    } else {
        note_failure(self, mailbox, end);
    }
    settle_mode(self);
}

bool bxcan_model_irq_transmit(const bxcan_model_t *self) {
    return (self->ier & 1U) != 0U && (self->tsr & (TSR_RQCP | (TSR_RQCP << 8) | (TSR_RQCP << 16))) != 0U;
}

bool bxcan_model_irq_fifo0(const bxcan_model_t *self) {
    const model_fifo_t *const fifo = &self->fifo[0];
    return ((self->ier & 2U) != 0U && fifo->count > 0U) || ((self->ier & 4U) != 0U && fifo->full) ||
           ((self->ier & 8U) != 0U && fifo->overrun);
}

bool bxcan_model_irq_error(const bxcan_model_t *self) {
    return (self->ier & IER_ERRIE) != 0U && (self->msr & MSR_ERRI) != 0U;
}

uint32_t bxcan_model_lines(const bxcan_model_t *self) {
    return (bxcan_model_irq_transmit(self) ? 1U : 0U) | (bxcan_model_irq_fifo0(self) ? 2U : 0U) |
           (bxcan_model_irq_error(self) ? 4U : 0U);
}

const char *bxcan_model_violation(const bxcan_model_t *self) {
    return self->violation;
}

void bxcan_model_slow_aborts(bxcan_model_t *self, uint32_t reads) {
    self->abort_reads = reads;
}

uint32_t bxcan_model_overruns(const bxcan_model_t *self) {
    return self->overruns;
}
