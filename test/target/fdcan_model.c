// SPDX-License-Identifier: MIT
#include "fdcan_model.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CCCR_INIT 0x01U
#define CCCR_CCE  0x02U
#define CCCR_MON  0x20U
#define CCCR_DAR  0x40U
#define CCCR_FDOE 0x100U
#define CCCR_PXHD 0x1000U
#define IR_RF0N   0x01U
#define IR_RF0L   0x04U
#define IR_TC     0x80U
#define IR_TCF    0x100U
#define IR_EP     0x20000U
#define IR_BO     0x80000U
#define XTD       0x40000000U
#define RTR       0x20000000U
#define ID        0x1FFFFFFFU
#define QUEUE     0x01000000U
#define ALL       7U

// Word of the message RAM at which each part begins (RM0440 44.3).
#define EXTENDED 28U
#define FIFO0    44U
#define FIFO1    98U
#define TRANSMIT 158U
#define WORDS    18U

static void violate(fdcan_model_t *self, const char *what, uint32_t offset) {
    if (self->violations++ == 0U) {
        (void)snprintf(self->violation, sizeof self->violation, "%s (register 0x%03X)", what, (unsigned)offset);
    }
}

fdcan_model_t *fdcan_model_create(uint32_t banks) {
    fdcan_model_t *self = malloc(sizeof *self);
    if (self != NULL) {
        memset(self, 0xA5, sizeof *self);
        fdcan_model_reset(self, banks);
    }
    return self;
}

void fdcan_model_destroy(fdcan_model_t *self) {
    free(self);
}

void fdcan_model_reset(fdcan_model_t *self, uint32_t banks) {
    fdcan_model_t fresh = {.cccr = CCCR_INIT, .nbtp = 0x06000A03U, .lec = 7};
    (void)banks;
    memcpy(fresh.ram, self->ram, sizeof fresh.ram);
    *self = fresh;
}

/// M_CAN 3.1.1: the state of FIFOs and buffers is reset when CCE is set.
static void reset_state(fdcan_model_t *self) {
    self->pending = self->unnoticed = self->cancelled = self->on_bus = 0;
    self->txbto = self->txbcf = self->put = 0;
    self->get = self->level = 0;
    self->lost = false;
}

static void write_cccr(fdcan_model_t *self, uint32_t value) {
    const uint32_t was = self->cccr;
    if (self->deaf) {
        return;
    }
    if ((value & CCCR_CCE) != 0U && (was & CCCR_INIT) == 0U) {
        violate(self, "CCE was requested outside initialisation", 0x18);
        value &= ~CCCR_CCE;
    }
    if ((value & CCCR_INIT) == 0U) {
        value &= ~CCCR_CCE;
    }
    // Every other bit can be set only while INIT and CCE are set.
    const uint32_t rest = ~(CCCR_INIT | CCCR_CCE);
    if ((was & (CCCR_INIT | CCCR_CCE)) != (CCCR_INIT | CCCR_CCE)) {
        value = (value & ~rest) | (value & was & rest);
    }
    self->cccr = value & 0xF3E7U;
    if ((value & ~was & CCCR_CCE) != 0U) {
        reset_state(self);
    }
    if ((value & CCCR_INIT) != 0U) {
        self->on_bus = 0; // The transfer stops immediately.
        self->joining = false;
    } else if ((was & CCCR_INIT) != 0U) {
        self->joining = true;
        self->recessive_bits = 0;
        self->recovered = 0;
    }
}

static bool is_protected(uint32_t offset) {
    return offset == 0x0C || offset == 0x10 || offset == 0x14 || offset == 0x1C || offset == 0x20 || offset == 0x80 ||
           offset == 0x84 || offset == 0xC0 || offset == 0x100;
}

static void complete_cancel(fdcan_model_t *self, uint32_t bit) {
    self->pending &= ~bit;
    self->unnoticed &= ~bit;
    self->cancelled &= ~bit;
    self->txbcf |= bit;
    self->ir |= ((self->txbcie & bit) != 0U) ? IR_TCF : 0U;
}

static void request(fdcan_model_t *self, uint32_t bits) {
    if ((self->cccr & CCCR_INIT) != 0U) {
        violate(self, "a transmission was requested in initialisation", 0xCC);
        return;
    }
    for (uint32_t i = 0; i < FDCAN_MODEL_BUFFERS; i++) {
        const uint32_t bit = 1U << i;
        if ((bits & bit) != 0U && (self->pending & bit) == 0U) {
            self->pending |= bit;
            self->unnoticed |= bit;
            self->txbto &= ~bit;
            self->txbcf &= ~bit;
            self->order[i] = ++self->requests;
        }
    }
    for (uint32_t i = 0; i < FDCAN_MODEL_BUFFERS && ((self->pending >> self->put) & 1U) != 0U; i++) {
        self->put = (self->put + 1U) % FDCAN_MODEL_BUFFERS;
    }
}

/// M_CAN 3.5.5: a buffer that waits is cancelled immediately, one that is on the bus when its frame ends.
static void cancel(fdcan_model_t *self, uint32_t bits) {
    for (uint32_t i = 0; i < FDCAN_MODEL_BUFFERS; i++) {
        const uint32_t bit = 1U << i;
        if ((bits & bit) != 0U && (self->pending & bit) == 0U) {
            self->txbcf |= bit;
        } else if ((bits & ~self->cancelled & bit) != 0U) {
            self->cancelled |= bit;
            self->delayed[i] = self->abort_reads;
            if ((self->on_bus & bit) == 0U && self->abort_reads == 0U) {
                complete_cancel(self, bit);
            }
        }
    }
}

/// Requests are noticed, and cancellations take effect, at a read.
static uint32_t read_txbrp(fdcan_model_t *self) {
    for (uint32_t i = 0; i < FDCAN_MODEL_BUFFERS; i++) {
        const uint32_t bit = 1U << i;
        if ((self->cancelled & ~self->on_bus & bit) != 0U && (self->delayed[i] == 0U || --self->delayed[i] == 0U)) {
            complete_cancel(self, bit);
        }
    }
    const uint32_t value = self->pending & ~self->unnoticed;
    self->unnoticed = 0;
    return value;
}

static uint32_t read_psr(fdcan_model_t *self) {
    const uint32_t act = !fdcan_model_is_on(self) ? 0U : (self->on_bus != 0U) ? 3U : 1U;
    const uint32_t most = (self->tec > self->rec) ? self->tec : self->rec;
    const uint32_t value = self->lec | (act << 3) | (self->passive ? 0x20U : 0U) | ((most >= 96U) ? 0x40U : 0U) |
                           (self->bus_off ? 0x80U : 0U) | 0x700U | (self->exception ? 0x4000U : 0U);
    self->lec = 7;
    self->exception = false;
    return value;
}

static uint32_t read_ram(fdcan_model_t *self, uint32_t offset) {
    const uint32_t word = (offset - FDCAN_MODEL_RAM) / 4U;
    if (word >= FIFO0 && word < FIFO1 && (self->level == 0U || (word - FIFO0) / WORDS != self->get)) {
        violate(self, "an element of FIFO 0 was read that shows no new frame", offset);
    }
    return self->ram[word];
}

static void write_ram(fdcan_model_t *self, uint32_t offset, uint32_t value) {
    const uint32_t word = (offset - FDCAN_MODEL_RAM) / 4U;
    if (word < FIFO0 && (self->cccr & CCCR_INIT) == 0U) {
        violate(self, "a filter was changed while it is in force", offset);
    }
    if (word >= FIFO0 && word < TRANSMIT) {
        violate(self, "an element that belongs to the controller was written", offset);
    }
    if (word >= TRANSMIT && ((self->pending >> ((word - TRANSMIT) / WORDS)) & 1U) != 0U) {
        violate(self, "a buffer that is not free was written", offset);
    }
    self->ram[word] = value;
}

static uint32_t put_of_fifo(const fdcan_model_t *self) {
    return (self->get + self->level) % 3U;
}

uint32_t fdcan_model_read(fdcan_model_t *self, uint32_t offset) {
    if (offset >= FDCAN_MODEL_RAM && offset < FDCAN_MODEL_RAM + 4U * FDCAN_MODEL_RAM_WORDS) {
        return read_ram(self, offset);
    }
    switch (offset) {
    case 0x18:
        return self->cccr;
    case 0x1C:
        return self->nbtp;
    case 0x40:
        return (self->tec & 0xFFU) | (((self->rec > 127U) ? 127U : self->rec) << 8) |
               ((self->rec > 127U) ? 0x8000U : 0U);
    case 0x44:
        return read_psr(self);
    case 0x50:
        return self->ir;
    case 0x54:
        return self->ie;
    case 0x58:
        return self->ils;
    case 0x5C:
        return self->ile;
    case 0x80:
        return self->rxgfc;
    case 0x90:
        return self->level | (self->get << 8) | (put_of_fifo(self) << 16) | ((self->level == 3U) ? 1U << 24 : 0U) |
               (self->lost ? 1U << 25 : 0U);
    case 0xC0:
        return self->txbc;
    case 0xC4:
        return (self->put << 16) | ((self->pending == ALL) ? 1U << 21 : 0U);
    case 0xC8:
        return read_txbrp(self);
    case 0xCC:
        return self->unnoticed;
    case 0xD0:
        return self->cancelled;
    case 0xD4:
        return self->txbto;
    case 0xD8:
        return self->txbcf;
    default:
        violate(self, "a register was read that does not exist or is not modelled", offset);
        return 0;
    }
}

static void release(fdcan_model_t *self, uint32_t index) {
    const uint32_t count = (index + 3U - self->get) % 3U + 1U;
    if (index >= 3U || count > self->level) {
        violate(self, "a frame of FIFO 0 was released that is not there", 0x94);
        return;
    }
    self->get = (index + 1U) % 3U;
    self->level -= count;
}

static void write_ir(fdcan_model_t *self, uint32_t value) {
    self->ir &= ~value;
    self->lost = self->lost && (value & IR_RF0L) == 0U;
}

void fdcan_model_write(fdcan_model_t *self, uint32_t offset, uint32_t value) {
    if (offset >= FDCAN_MODEL_RAM && offset < FDCAN_MODEL_RAM + 4U * FDCAN_MODEL_RAM_WORDS) {
        write_ram(self, offset, value);
        return;
    }
    if (is_protected(offset) && (self->cccr & CCCR_CCE) == 0U) {
        violate(self, "a protected register was written without CCE", offset);
        return;
    }
    switch (offset) {
    case 0x18:
        write_cccr(self, value);
        break;
    case 0x1C:
        self->nbtp = value;
        break;
    case 0x50:
        write_ir(self, value);
        break;
    case 0x54:
        self->ie = value & 0xFFFFFFU;
        break;
    case 0x58:
        self->ils = value;
        break;
    case 0x5C:
        self->ile = value & 3U;
        break;
    case 0x80:
        self->rxgfc = value;
        break;
    case 0x84:
        self->xidam = value;
        break;
    case 0x94:
        release(self, value & 7U);
        break;
    case 0xC0:
        self->txbc = value & QUEUE;
        break;
    case 0xCC:
        request(self, value & ALL);
        break;
    case 0xD0:
        cancel(self, value & ALL);
        break;
    case 0xDC:
        self->txbtie = value & ALL;
        break;
    case 0xE0:
        self->txbcie = value & ALL;
        break;
    case 0x100:
        self->ckdiv = value;
        break;
    default:
        violate(self, "a register was written that does not exist or is not modelled", offset);
        break;
    }
}

bool fdcan_model_is_on(const fdcan_model_t *self) {
    return (self->cccr & CCCR_INIT) == 0U && !self->joining && !self->bus_off;
}

/// M_CAN 3.1.4: bus-off ends after 129 times 11 recessive bits since INIT was cleared.
static void see_idle(fdcan_model_t *self) {
    if (self->bus_off && ++self->recovered < 129U) {
        self->lec = 5; // Each sequence writes Bit0Error.
        return;
    }
    if (self->bus_off) {
        self->bus_off = self->passive = false;
        self->tec = self->rec = 0;
        self->ir |= IR_BO | IR_EP;
    }
    self->joining = false;
}

void fdcan_model_recessive(fdcan_model_t *self, uint32_t bits) {
    self->held_bits = 0;
    for (; bits > 0U && self->joining; bits--) {
        if (++self->recessive_bits >= 11U) {
            self->recessive_bits = 0;
            see_idle(self);
        }
    }
}

void fdcan_model_dominant(fdcan_model_t *self) {
    self->recessive_bits = 0;
}

/// Order on the bus, as in bxcan_model.c; without the queue, the order of the requests.
static uint64_t rank(const fdcan_model_t *self, uint32_t buffer) {
    const uint32_t header = self->ram[TRANSMIT + buffer * WORDS];
    const bool extended = (header & XTD) != 0U;
    if ((self->txbc & QUEUE) == 0U) {
        return self->order[buffer];
    }
    const uint64_t id = header & ID;
    return ((id >> 18) << 20) | (extended ? (1ULL << 19) | (id & 0x3FFFFU) : 0U);
}

int fdcan_model_offer(const fdcan_model_t *self, model_frame_t *out_frame) {
    int best = MODEL_NONE;
    if (!fdcan_model_is_on(self) || (self->cccr & CCCR_MON) != 0U) {
        return MODEL_NONE;
    }
    for (uint32_t i = 0; i < FDCAN_MODEL_BUFFERS; i++) {
        const bool waits = ((self->pending & ~self->cancelled) >> i & 1U) != 0U;
        if (waits && (best < 0 || rank(self, i) < rank(self, (uint32_t)best))) {
            best = (int)i;
        }
    }
    if (best >= 0) {
        const uint32_t *const word = &self->ram[TRANSMIT + (uint32_t)best * WORDS];
        out_frame->extended = (word[0] & XTD) != 0U;
        out_frame->remote = (word[0] & RTR) != 0U;
        out_frame->id = out_frame->extended ? word[0] & ID : (word[0] & ID) >> 18;
        out_frame->dlc = (uint8_t)(word[1] >> 16 & 0xFU);
        for (uint32_t i = 0; i < 8U; i++) {
            out_frame->data[i] = (uint8_t)(word[2U + i / 4U] >> (8U * (i % 4U)));
        }
    }
    return best;
}

void fdcan_model_begin(fdcan_model_t *self, int buffer) {
    self->unnoticed &= ~(1U << buffer);
    self->on_bus = 1U << buffer;
}

/// The controller becomes bus-off with INIT, and stays so until the software clears it.
static void note_errors(fdcan_model_t *self) {
    const bool passive = self->tec > 127U || self->rec > 127U;
    if (self->tec > 255U && !self->bus_off) {
        self->bus_off = true;
        self->cccr |= CCCR_INIT;
        self->on_bus = 0;
        self->ir |= IR_BO;
    }
    if (passive != self->passive) {
        self->passive = passive;
        self->ir |= IR_EP;
    }
}

void fdcan_model_end(fdcan_model_t *self, int buffer, model_end_t end) {
    const uint32_t bit = 1U << buffer;
    if ((self->on_bus & bit) == 0U) {
        return; // Initialisation has broken it off.
    }
    self->on_bus = 0;
    if (end == MODEL_SENT) {
        self->lec = 0;
        self->tec -= (self->tec > 0U) ? 1U : 0U;
        self->pending &= ~bit;
        self->txbto |= bit;
        self->txbcf |= self->cancelled & bit;
        self->cancelled &= ~bit;
        self->ir |= ((self->txbtie & bit) != 0U) ? IR_TC : 0U;
        note_errors(self);
        return;
    }
    if ((self->cancelled & bit) != 0U || (self->cccr & CCCR_DAR) != 0U) {
        complete_cancel(self, bit);
    }
    if (end != MODEL_LOST_ARBITRATION) {
        self->lec = (end == MODEL_NO_ACKNOWLEDGEMENT) ? 3U : 5U;
        if (end != MODEL_NO_ACKNOWLEDGEMENT ||
            !self->passive) { // A passive node alone on the bus does not become bus-off.
            self->tec += 8U;
        }
        note_errors(self);
    }
}

static bool matches(uint32_t kind, uint32_t id, uint32_t one, uint32_t two) {
    switch (kind) {
    case 0:
        return id >= one && id <= two;
    case 1:
        return id == one || id == two;
    case 2:
        return ((id ^ one) & two) == 0U;
    default:
        return false;
    }
}

/// Returns true if FIFO 0 gets the frame.
static bool passes(const fdcan_model_t *self, const model_frame_t *frame) {
    const uint32_t count = frame->extended ? self->rxgfc >> 24 & 0xFU : self->rxgfc >> 16 & 0x1FU;
    if (frame->remote && (self->rxgfc & (frame->extended ? 1U : 2U)) != 0U) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t first = frame->extended ? self->ram[EXTENDED + 2U * i] : self->ram[i];
        const uint32_t second = frame->extended ? self->ram[EXTENDED + 2U * i + 1U] : 0U;
        const uint32_t action = frame->extended ? first >> 29 : first >> 27 & 7U;
        const bool hit = frame->extended ? matches(second >> 30, frame->id, first & ID, second & ID)
                                         : matches(first >> 30, frame->id, first >> 16 & 0x7FFU, first & 0x7FFU);
        if (action != 0U && hit) {
            return action == 1U;
        }
    }
    return (self->rxgfc >> (frame->extended ? 2U : 4U) & 3U) == 0U;
}

static void store(fdcan_model_t *self, const model_frame_t *frame) {
    if (self->level == 3U && (self->rxgfc & 0x200U) == 0U) { // Blocking: the new frame is lost.
        self->lost = true;
        self->overruns++;
        self->ir |= IR_RF0L;
        return;
    }
    if (self->level == 3U) {
        self->overruns++;
        self->ir |= IR_RF0L;
        self->get = (self->get + 1U) % 3U;
        self->level--;
    }
    uint32_t *const word = &self->ram[FIFO0 + put_of_fifo(self) * WORDS];
    word[0] = (frame->extended ? frame->id | XTD : frame->id << 18) | (frame->remote ? RTR : 0U);
    word[1] = (uint32_t)frame->dlc << 16;
    word[2] = word[3] = 0;
    for (uint32_t i = 0; i < 8U; i++) {
        word[2U + i / 4U] |= (uint32_t)frame->data[i] << (8U * (i % 4U));
    }
    self->level++;
    self->ir |= IR_RF0N;
}

bool fdcan_model_receive(fdcan_model_t *self, const model_frame_t *frame) {
    fdcan_model_dominant(self);
    if (!fdcan_model_is_on(self)) {
        return false;
    }
    self->rec = (self->rec > 127U) ? 119U : self->rec - ((self->rec > 0U) ? 1U : 0U);
    self->lec = 0;
    note_errors(self);
    if (passes(self, frame)) {
        store(self, frame);
    }
    return (self->cccr & CCCR_MON) == 0U;
}

/// M_CAN 3.1.3: without FDOE the recessive FDF bit is a protocol exception, and an error only if that handling is off.
bool fdcan_model_receive_fd(fdcan_model_t *self) {
    if ((self->cccr & (CCCR_PXHD | CCCR_FDOE)) != 0U) {
        fdcan_model_receive_error(self);
        return true;
    }
    self->exception = fdcan_model_is_on(self);
    return false;
}

void fdcan_model_hold(fdcan_model_t *self, uint32_t bits, bool transmitting) {
    fdcan_model_dominant(self);
    for (; bits > 0U && fdcan_model_is_on(self); bits--) {
        self->held_bits++;
        if (self->held_bits < 14U || (self->held_bits - 14U) % 8U != 0U) {
            continue;
        }
        if (transmitting) {
            self->tec += 8U;
        } else {
            self->rec = (self->rec < 247U) ? self->rec + 8U : 255U;
        }
        note_errors(self);
    }
}

void fdcan_model_receive_error(fdcan_model_t *self) {
    fdcan_model_dominant(self);
    if (fdcan_model_is_on(self)) {
        self->rec = (self->rec < 255U) ? self->rec + 1U : 255U;
        self->lec = 1;
        note_errors(self);
    }
}

uint32_t fdcan_model_lines(const fdcan_model_t *self) {
    return ((self->ir & self->ie) != 0U && self->ils == 0U && (self->ile & 1U) != 0U) ? 1U : 0U;
}

void fdcan_model_slow_aborts(fdcan_model_t *self, uint32_t reads) {
    self->abort_reads = reads;
}

uint32_t fdcan_model_overruns(const fdcan_model_t *self) {
    return self->overruns;
}

const char *fdcan_model_violation(const fdcan_model_t *self) {
    return self->violation;
}
