// SPDX-License-Identifier: MIT
#include "bxcan.h"

#include "bxcan_filters.h"

#include <string.h>

#define INTERRUPTS (BRD_IER_TMEIE | BRD_IER_FMPIE0 | BRD_IER_EPVIE | BRD_IER_BOFIE | BRD_IER_ERRIE)
#define COMPLETED  (BRD_TSR_RQCP(0) | BRD_TSR_RQCP(1) | BRD_TSR_RQCP(2))
#define ABORT      (BRD_TSR_ABRQ(0) | BRD_TSR_ABRQ(1) | BRD_TSR_ABRQ(2))
#define EMPTY      (BRD_TSR_TME(0) | BRD_TSR_TME(1) | BRD_TSR_TME(2))

/// Writes MCR (bxCAN 9.2). These bits stay zero: NART (the controller repeats an unacknowledged frame until it is
/// aborted), TXFP (the lowest id is sent first, so left before right), RFLM (a full FIFO retains the newest frame),
/// ABOM (the driver itself ends bus-off) and SLEEP.
static void write_mcr(const brd_bxcan_t *self, uint32_t request) {
    brd_register_write(&self->config.registers->MCR, BRD_MCR_DBF | request);
}

void brd_bxcan_init(brd_bxcan_t *self, const brd_bxcan_config_t *config) {
    memset(self, 0, sizeof *self);
    self->config = *config;
    write_mcr(self, BRD_MCR_INRQ);
}

/// Call it only in initialisation mode (bxCAN 4.1 and 9.1).
static void configure(brd_bxcan_t *self) {
    brd_bxcan_registers_t *const registers = self->config.registers;
    brd_register_write(&registers->BTR, self->config.bit_timing | (self->config.silent ? BRD_BTR_SILM : 0U));
    brd_bxcan_filters_write(self->config.filters, self->config.first_bank);
    brd_register_write(&registers->IER, INTERRUPTS);
}

static bool is_bus_off(const brd_bxcan_t *self) {
    return (brd_register_read(&self->config.registers->ESR) & BRD_ESR_BOFF) != 0U;
}

static uint32_t word_of(const uint8_t *bytes) {
    return bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static void bytes_of(uint32_t word, uint8_t *out_bytes) {
    for (uint32_t i = 0; i < 4U; i++) {
        out_bytes[i] = (uint8_t)(word >> (8U * i));
    }
}

/// Masks the interrupt, so that `brd_bxcan_on_transmit` does not run. The read makes sure that the write has arrived.
static void mask_transmit(const brd_bxcan_t *self) {
    brd_register_t *const ier = &self->config.registers->IER;
    brd_register_write(ier, INTERRUPTS & ~BRD_IER_TMEIE);
    (void)brd_register_read(ier);
    atomic_signal_fence(memory_order_seq_cst);
}

static void unmask_transmit(const brd_bxcan_t *self) {
    atomic_signal_fence(memory_order_seq_cst);
    brd_register_write(&self->config.registers->IER, INTERRUPTS);
}

static bool poll_tsr(const brd_bxcan_t *self, uint32_t flags) {
    // The loop is limited: an abort ends at the latest with the frame that is on the bus, unless the controller hangs.
    for (uint32_t poll = 0; poll < self->config.poll_limit; poll++) {
        if ((brd_register_read(&self->config.registers->TSR) & flags) == flags) {
            return true;
        }
    }
    return false;
}

/// Aborts the mailbox (bxCAN 7.1) and passes the echoes that it owes to `heir`, the frame that replaces it. Returns
/// false if the abort does not end. If the frame was sent after all, mailbox and echoes stay for
/// `brd_bxcan_on_transmit`.
static bool withdraw(brd_bxcan_t *self, uint32_t mailbox, brd_bxcan_outgoing_t *heir) {
    brd_register_t *const tsr = &self->config.registers->TSR;
    brd_register_write(tsr, BRD_TSR_ABRQ(mailbox));
    if (!poll_tsr(self, BRD_TSR_RQCP(mailbox) | BRD_TSR_TME(mailbox))) {
        return false;
    }
    if ((brd_register_read(tsr) & BRD_TSR_TXOK(mailbox)) == 0U) {
        *heir = self->outgoing[mailbox];
        self->outgoing[mailbox].owed = 0;
        brd_register_write(tsr, BRD_TSR_RQCP(mailbox));
    }
    return true;
}

/// Aborts the waiting frame with this id, if there is one; there is at most one. Returns false if the abort does not
/// end, or if the mailbox already owes the maximum of echoes.
static bool withdraw_id(brd_bxcan_t *self, uint32_t id, brd_bxcan_outgoing_t *heir) {
    bool done = true;
    for (uint32_t mailbox = 0; mailbox < BRD_BXCAN_MAILBOXES && done; mailbox++) {
        const brd_bxcan_outgoing_t *const outgoing = &self->outgoing[mailbox];
        if (outgoing->owed > 0U && outgoing->frame[0].id == id) {
            done = outgoing->owed < BRD_BXCAN_ECHOES && withdraw(self, mailbox, heir);
        }
    }
    return done;
}

/// Writes the registers of a free transmit mailbox (bxCAN 9.3) except TIR, which makes the request. Returns the
/// mailbox, or BRD_BXCAN_MAILBOXES if none is free.
static uint32_t load_free_mailbox(brd_bxcan_t *self, const iw_can_frame_t *frame, brd_bxcan_outgoing_t *heir) {
    for (uint32_t i = 0; i < BRD_BXCAN_MAILBOXES; i++) {
        if (self->outgoing[i].owed == 0U) {
            brd_bxcan_mailbox_t *const mailbox = &self->config.registers->tx[i];
            heir->frame[heir->owed] = *frame;
            heir->frame[heir->owed].kind = IW_CAN_ECHO;
            heir->owed++;
            self->outgoing[i] = *heir;
            brd_register_write(&mailbox->TDTR, frame->dlc);
            brd_register_write(&mailbox->TDLR, word_of(&frame->data[0]));
            brd_register_write(&mailbox->TDHR, word_of(&frame->data[4]));
            return i;
        }
    }
    return BRD_BXCAN_MAILBOXES;
}

/// Puts the frame into a mailbox in place of a waiting frame with the same id. The interrupt is masked for each frame
/// separately: a frame that was sent during the first call frees its mailbox before the second call needs one.
static uint32_t place(brd_bxcan_t *self, const iw_can_frame_t *frame) {
    brd_bxcan_outgoing_t heir;
    heir.owed = 0;
    mask_transmit(self);
    const bool withdrawn = withdraw_id(self, frame->id, &heir);
    const uint32_t mailbox = withdrawn ? load_free_mailbox(self, frame, &heir) : BRD_BXCAN_MAILBOXES;
    unmask_transmit(self);
    return mailbox;
}

static bool can_be_sent(const brd_bxcan_t *self, const iw_can_frame_t *frames, uint32_t count) {
    bool good = self->phase == BRD_BXCAN_RUNNING && !self->config.silent && !is_bus_off(self);
    for (uint32_t i = 0; i < count; i++) {
        good = good && frames[i].id <= IW_CAN_ID_MASK && frames[i].dlc <= IW_CAN_DATA_MAX;
    }
    return good;
}

/// Fills every mailbox before it requests the first one. The controller has no request for two mailboxes: TXRQ is a bit
/// of each TIR (bxCAN 9.3), and on an idle bus the left frame begins with the first write. The second write comes a few
/// cycles later, long before that frame ends, so the right frame is the next one from this controller. This is not
/// guaranteed: a lower id of another node goes between, a frame that fails is repeated first, and a reset of the CPU
/// between both writes leaves the left frame alone.
int brd_bxcan_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    brd_bxcan_t *const self = context;
    uint32_t mailbox[IW_SIDES];
    uint32_t filled = 0;
    if (!can_be_sent(self, frames, count)) {
        return -1;
    }
    while (filled < count && filled < IW_SIDES) {
        mailbox[filled] = place(self, &frames[filled]);
        if (mailbox[filled] == BRD_BXCAN_MAILBOXES) {
            break;
        }
        filled++;
    }
    for (uint32_t i = 0; i < filled; i++) {
        brd_register_t *const tir = &self->config.registers->tx[mailbox[i]].TIR;
        brd_register_write(tir, (frames[i].id << BRD_IR_STID_SHIFT) | BRD_TIR_TXRQ);
    }
    return (int)filled;
}

/// Returns true once after a loss of frames, with the report of the controller in `*out_frame`. The core counts it.
static bool report_loss(brd_bxcan_t *self, iw_can_frame_t *out_frame) {
    const uint32_t losses = self->overruns + self->lost;
    if (losses == self->losses_reported) {
        return false;
    }
    self->losses_reported = losses;
    *out_frame = (iw_can_frame_t){.id = IW_CAN_ERROR, .kind = IW_CAN_RECEIVED};
    return true;
}

int brd_bxcan_receive(void *context, iw_can_frame_t *out_frame) {
    brd_bxcan_t *const self = context;
    iw_can_frame_t frame;
    uint8_t epoch;
    if (report_loss(self, out_frame)) {
        return 1;
    }
    while (brd_frame_ring_take(&self->ring, &frame, &epoch)) {
        if (frame.kind == IW_CAN_RECEIVED || epoch == self->epoch) {
            *out_frame = frame;
            return 1;
        }
    }
    return (self->phase == BRD_BXCAN_RUNNING) ? 0 : -1;
}

/// Aborts all mailboxes (bxCAN 7.1) and clears their completions. Returns false if an abort does not end. It writes TSR
/// without a read before, because writing back a read value would also clear a completion that came in between.
static bool abort_all(brd_bxcan_t *self) {
    brd_register_t *const tsr = &self->config.registers->TSR;
    brd_register_write(tsr, ABORT);
    if (!poll_tsr(self, EMPTY)) {
        return false;
    }
    brd_register_write(tsr, COMPLETED);
    return true;
}

/// Drops all owed echoes. After a purge no echo may reach the core (hal.h): those in the ring have the old epoch, so
/// that `receive` drops them.
static void forget(brd_bxcan_t *self) {
    memset(self->outgoing, 0, sizeof self->outgoing);
    self->epoch++;
}

/// Aborts all waiting frames with the interrupt masked. Returns false if this is left to a later call.
static bool take_back(brd_bxcan_t *self) {
    mask_transmit(self);
    const bool done = abort_all(self);
    if (done) {
        forget(self);
    }
    unmask_transmit(self);
    return done;
}

/// Resets the controller with its mailboxes after an abort that does not end. `bus_state` reports STARTING as a loss of
/// the bus, and nothing is sent before the controller has joined the bus again. Until then the reset masks its
/// interrupts.
static void restart(brd_bxcan_t *self) {
    brd_register_t *const reset = self->config.reset_register;
    brd_register_write(reset, brd_register_read(reset) | self->config.reset_bits);
    brd_register_write(reset, brd_register_read(reset) & ~self->config.reset_bits);
    forget(self);
    self->resets++;
    self->phase = BRD_BXCAN_STARTING;
    write_mcr(self, BRD_MCR_INRQ);
}

/// Off the bus no frame leaves the controller, so 0 is safe: only `bus_state` ends bus-off, and the driver joins no bus
/// before all frames are aborted.
int brd_bxcan_purge(void *context) {
    brd_bxcan_t *const self = context;
    if (take_back(self)) {
        return 1;
    }
    if (self->phase != BRD_BXCAN_RUNNING || is_bus_off(self)) {
        return 0;
    }
    restart(self);
    return 1;
}

/// Both phases start with initialisation mode: the driver ends bus-off by entering and leaving it (bxCAN 7.6), and it
/// starts a device again that was reset or put to sleep from outside. Waiting frames must survive neither of them.
static void begin(brd_bxcan_t *self, brd_bxcan_phase_t phase) {
    self->phase = phase;
    (void)take_back(self);
    write_mcr(self, BRD_MCR_INRQ);
}

static void leave_init(brd_bxcan_t *self) {
    if (!take_back(self)) {
        return;
    }
    if (self->phase == BRD_BXCAN_STARTING) {
        configure(self);
    }
    self->phase = (self->phase == BRD_BXCAN_STARTING) ? BRD_BXCAN_JOINING : BRD_BXCAN_REJOINING;
    write_mcr(self, 0);
}

/// Does the next step if the hardware is ready for it (bxCAN 4.1 and 4.2).
static void advance(brd_bxcan_t *self, uint32_t msr) {
    const bool in_init = (msr & BRD_MSR_INAK) != 0U;
    if (self->phase == BRD_BXCAN_STARTING || self->phase == BRD_BXCAN_RECOVERING) {
        if (in_init) {
            leave_init(self);
        } else {
            write_mcr(self, BRD_MCR_INRQ);
        }
    } else if (!in_init && !is_bus_off(self)) {
        self->phase = BRD_BXCAN_RUNNING;
    }
}

static iw_bus_state_t judge(brd_bxcan_t *self, uint32_t msr) {
    if (is_bus_off(self)) {
        self->bus_offs++;
        begin(self, BRD_BXCAN_RECOVERING);
        return IW_BUS_OFF;
    }
    if ((msr & (BRD_MSR_INAK | BRD_MSR_SLAK)) != 0U) {
        begin(self, BRD_BXCAN_STARTING);
        return IW_BUS_DOWN;
    }
    const bool passive = (brd_register_read(&self->config.registers->ESR) & BRD_ESR_EPVF) != 0U;
    return passive ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
}

iw_bus_state_t brd_bxcan_bus_state(void *context) {
    brd_bxcan_t *const self = context;
    const uint32_t msr = brd_register_read(&self->config.registers->MSR);
    if (self->phase != BRD_BXCAN_RUNNING) {
        advance(self, msr);
    }
    if (self->phase == BRD_BXCAN_RUNNING) {
        return judge(self, msr);
    }
    return (self->phase < BRD_BXCAN_RUNNING) ? IW_BUS_DOWN : IW_BUS_OFF;
}

/// Counts a lost frame and does not wait, because it runs in an interrupt.
static void put(brd_bxcan_t *self, const iw_can_frame_t *frame) {
    if (!brd_frame_ring_put(&self->ring, frame, self->epoch)) {
        self->lost++;
    }
}

void brd_bxcan_on_transmit(brd_bxcan_t *self) {
    brd_register_t *const tsr = &self->config.registers->TSR;
    const uint32_t flags = brd_register_read(tsr);
    for (uint32_t mailbox = 0; mailbox < BRD_BXCAN_MAILBOXES; mailbox++) {
        brd_bxcan_outgoing_t *const outgoing = &self->outgoing[mailbox];
        if ((flags & BRD_TSR_RQCP(mailbox)) != 0U) {
            brd_register_write(tsr, BRD_TSR_RQCP(mailbox));
            for (uint32_t i = 0; i < outgoing->owed && (flags & BRD_TSR_TXOK(mailbox)) != 0U; i++) {
                put(self, &outgoing->frame[i]);
            }
            outgoing->owed = 0;
        }
    }
}

/// Reads one frame of FIFO 0 (bxCAN 7.3 and 9.3). The interrupt is raised again while there are more. While a release
/// is in progress the FIFO still shows the old frame, so the handler leaves it for the next interrupt.
void brd_bxcan_on_receive(brd_bxcan_t *self) {
    brd_bxcan_registers_t *const registers = self->config.registers;
    const uint32_t status = brd_register_read(&registers->RF0R);
    if ((status & BRD_RF0R_FOVR0) != 0U) {
        self->overruns++;
        brd_register_write(&registers->RF0R, BRD_RF0R_FOVR0);
    }
    if ((status & BRD_RF0R_RFOM0) != 0U || (status & BRD_RF0R_FMP0) == 0U) {
        return;
    }
    const uint32_t identifier = brd_register_read(&registers->rx[0].RIR);
    const uint32_t dlc = brd_register_read(&registers->rx[0].RDTR) & BRD_DTR_DLC;
    const bool extended = (identifier & BRD_IR_IDE) != 0U;
    iw_can_frame_t frame = {.kind = IW_CAN_RECEIVED, .dlc = (uint8_t)((dlc < IW_CAN_DATA_MAX) ? dlc : IW_CAN_DATA_MAX)};
    frame.id = extended ? ((identifier >> BRD_IR_EXID_SHIFT) | IW_CAN_EXTENDED) : (identifier >> BRD_IR_STID_SHIFT);
    frame.id |= ((identifier & BRD_IR_RTR) != 0U) ? IW_CAN_REMOTE : 0U;
    bytes_of(brd_register_read(&registers->rx[0].RDLR), &frame.data[0]);
    bytes_of(brd_register_read(&registers->rx[0].RDHR), &frame.data[4]);
    brd_register_write(&registers->RF0R, BRD_RF0R_RFOM0);
    put(self, &frame);
}

void brd_bxcan_on_error(brd_bxcan_t *self) {
    brd_register_write(&self->config.registers->MSR, BRD_MSR_ERRI);
}
