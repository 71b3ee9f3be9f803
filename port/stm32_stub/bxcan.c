// SPDX-License-Identifier: MIT
#include "bxcan.h"

#include "bxcan_filters.h"

#include <string.h>

#define INTERRUPTS (IW_IER_TMEIE | IW_IER_FMPIE0 | IW_IER_EPVIE | IW_IER_BOFIE | IW_IER_ERRIE)
#define COMPLETED  (IW_TSR_RQCP(0) | IW_TSR_RQCP(1) | IW_TSR_RQCP(2))
#define ABORT      (IW_TSR_ABRQ(0) | IW_TSR_ABRQ(1) | IW_TSR_ABRQ(2))
#define EMPTY      (IW_TSR_TME(0) | IW_TSR_TME(1) | IW_TSR_TME(2))

/// MCR, bxCAN 9.2. Zero are NART (unacknowledged frames are repeated until aborted), TXFP (the lowest id first, so left
/// before right), RFLM (a full FIFO keeps the newest), ABOM (bus-off is left by us) and SLEEP.
static void write_mcr(const iw_bxcan_t *self, uint32_t request) {
    iw_register_write(&self->config.registers->MCR, IW_MCR_DBF | request);
}

void iw_bxcan_init(iw_bxcan_t *self, const iw_bxcan_config_t *config) {
    memset(self, 0, sizeof *self);
    self->config = *config;
    write_mcr(self, IW_MCR_INRQ);
}

/// In initialisation mode only, bxCAN 4.1 and 9.1.
static void configure(iw_bxcan_t *self) {
    iw_bxcan_registers_t *const registers = self->config.registers;
    iw_register_write(&registers->BTR, self->config.bit_timing | (self->config.silent ? IW_BTR_SILM : 0U));
    iw_bxcan_filters_write(self->config.filters, self->config.first_bank);
    iw_register_write(&registers->IER, INTERRUPTS);
}

static bool is_bus_off(const iw_bxcan_t *self) {
    return (iw_register_read(&self->config.registers->ESR) & IW_ESR_BOFF) != 0U;
}

static uint32_t word_of(const uint8_t *bytes) {
    return bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static void bytes_of(uint32_t word, uint8_t *out_bytes) {
    for (uint32_t i = 0; i < 4U; i++) {
        out_bytes[i] = (uint8_t)(word >> (8U * i));
    }
}

/// While masked, `iw_bxcan_on_transmit` does not run. Reading back makes sure that the write has arrived.
static void mask_transmit(const iw_bxcan_t *self) {
    iw_register_t *const ier = &self->config.registers->IER;
    iw_register_write(ier, INTERRUPTS & ~IW_IER_TMEIE);
    (void)iw_register_read(ier);
    atomic_signal_fence(memory_order_seq_cst);
}

static void unmask_transmit(const iw_bxcan_t *self) {
    atomic_signal_fence(memory_order_seq_cst);
    iw_register_write(&self->config.registers->IER, INTERRUPTS);
}

static bool poll_tsr(const iw_bxcan_t *self, uint32_t flags) {
    // Bounded: an abort ends at the latest with the frame that is on the bus, unless the controller is stuck.
    for (uint32_t poll = 0; poll < self->config.poll_limit; poll++) {
        if ((iw_register_read(&self->config.registers->TSR) & flags) == flags) {
            return true;
        }
    }
    return false;
}

/// Aborts the mailbox, bxCAN 7.1, and hands the echoes it owes on to `heir`, the frame that replaces it. False if the
/// abort does not end. If the frame was sent after all, mailbox and echoes are left to `iw_bxcan_on_transmit`.
static bool withdraw(iw_bxcan_t *self, uint32_t mailbox, iw_bxcan_outgoing_t *heir) {
    iw_register_t *const tsr = &self->config.registers->TSR;
    iw_register_write(tsr, IW_TSR_ABRQ(mailbox));
    if (!poll_tsr(self, IW_TSR_RQCP(mailbox) | IW_TSR_TME(mailbox))) {
        return false;
    }
    if ((iw_register_read(tsr) & IW_TSR_TXOK(mailbox)) == 0U) {
        *heir = self->outgoing[mailbox];
        self->outgoing[mailbox].owed = 0;
        iw_register_write(tsr, IW_TSR_RQCP(mailbox));
    }
    return true;
}

/// What waits with this id is withdrawn; at most one does. False if it cannot be, or owes as many echoes as can be
/// kept.
static bool withdraw_id(iw_bxcan_t *self, uint32_t id, iw_bxcan_outgoing_t *heir) {
    bool done = true;
    for (uint32_t mailbox = 0; mailbox < IW_BXCAN_MAILBOXES && done; mailbox++) {
        const iw_bxcan_outgoing_t *const outgoing = &self->outgoing[mailbox];
        if (outgoing->owed > 0U && outgoing->frame[0].id == id) {
            done = outgoing->owed < IW_BXCAN_ECHOES && withdraw(self, mailbox, heir);
        }
    }
    return done;
}

/// Transmit mailbox registers, bxCAN 9.3: all but TIR, which makes the request. Returns the mailbox, or
/// IW_BXCAN_MAILBOXES if none is free.
static uint32_t load_free_mailbox(iw_bxcan_t *self, const iw_can_frame_t *frame, iw_bxcan_outgoing_t *heir) {
    for (uint32_t i = 0; i < IW_BXCAN_MAILBOXES; i++) {
        if (self->outgoing[i].owed == 0U) {
            iw_bxcan_mailbox_t *const mailbox = &self->config.registers->tx[i];
            heir->frame[heir->owed] = *frame;
            heir->frame[heir->owed].kind = IW_CAN_ECHO;
            heir->owed++;
            self->outgoing[i] = *heir;
            iw_register_write(&mailbox->TDTR, frame->dlc);
            iw_register_write(&mailbox->TDLR, word_of(&frame->data[0]));
            iw_register_write(&mailbox->TDHR, word_of(&frame->data[4]));
            return i;
        }
    }
    return IW_BXCAN_MAILBOXES;
}

/// Takes the place of what waits with this id. The interrupt is masked for each frame apart: what was sent while the
/// first one was placed frees its mailbox before the second one needs it.
static uint32_t place(iw_bxcan_t *self, const iw_can_frame_t *frame) {
    iw_bxcan_outgoing_t heir;
    heir.owed = 0;
    mask_transmit(self);
    const bool withdrawn = withdraw_id(self, frame->id, &heir);
    const uint32_t mailbox = withdrawn ? load_free_mailbox(self, frame, &heir) : IW_BXCAN_MAILBOXES;
    unmask_transmit(self);
    return mailbox;
}

static bool can_be_sent(const iw_bxcan_t *self, const iw_can_frame_t *frames, uint32_t count) {
    bool good = self->phase == IW_BXCAN_RUNNING && !self->config.silent && !is_bus_off(self);
    for (uint32_t i = 0; i < count; i++) {
        good = good && frames[i].id <= IW_CAN_ID_MASK && frames[i].dlc <= IW_CAN_DATA_MAX;
    }
    return good;
}

/// Every mailbox is filled before the first one is requested. The controller has no request for two mailboxes: TXRQ is
/// a bit of each TIR (bxCAN 9.3), and on an idle bus the left frame begins with the first write. The second write comes
/// a few cycles later, long before that frame ends, so the right one is next in this controller. Not guaranteed:
/// another node's lower id goes between, a frame that fails is repeated first, and a reset of the CPU between both
/// writes leaves the left one alone.
int iw_bxcan_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    iw_bxcan_t *const self = context;
    uint32_t mailbox[IW_SIDES];
    uint32_t filled = 0;
    if (!can_be_sent(self, frames, count)) {
        return -1;
    }
    while (filled < count && filled < IW_SIDES) {
        mailbox[filled] = place(self, &frames[filled]);
        if (mailbox[filled] == IW_BXCAN_MAILBOXES) {
            break;
        }
        filled++;
    }
    for (uint32_t i = 0; i < filled; i++) {
        iw_register_t *const tir = &self->config.registers->tx[mailbox[i]].TIR;
        iw_register_write(tir, (frames[i].id << IW_IR_STID_SHIFT) | IW_TIR_TXRQ);
    }
    return (int)filled;
}

/// True once after frames were lost: the controller's report of it, which the core counts.
static bool tell_loss(iw_bxcan_t *self, iw_can_frame_t *out_frame) {
    const uint32_t losses = self->overruns + self->lost;
    if (losses == self->losses_told) {
        return false;
    }
    self->losses_told = losses;
    *out_frame = (iw_can_frame_t){.id = IW_CAN_ERROR, .kind = IW_CAN_RECEIVED};
    return true;
}

int iw_bxcan_receive(void *context, iw_can_frame_t *out_frame) {
    iw_bxcan_t *const self = context;
    iw_can_frame_t frame;
    uint8_t epoch;
    if (tell_loss(self, out_frame)) {
        return 1;
    }
    while (iw_frame_ring_take(&self->ring, &frame, &epoch)) {
        if (frame.kind == IW_CAN_RECEIVED || epoch == self->epoch) {
            *out_frame = frame;
            return 1;
        }
    }
    return (self->phase == IW_BXCAN_RUNNING) ? 0 : -1;
}

/// Aborts all mailboxes, bxCAN 7.1, and forgets what they owe. TSR is written, never read and written back: a
/// completion that comes between would be cleared with it.
static bool abort_all(iw_bxcan_t *self) {
    iw_register_t *const tsr = &self->config.registers->TSR;
    iw_register_write(tsr, ABORT);
    if (!poll_tsr(self, EMPTY)) {
        return false;
    }
    iw_register_write(tsr, COMPLETED);
    return true;
}

/// After a purge no echo may reach the core (hal.h): those already in the ring have the old epoch.
static void forget(iw_bxcan_t *self) {
    memset(self->outgoing, 0, sizeof self->outgoing);
    self->epoch++;
}

/// Takes back all that waits, or leaves it to a later call. The interrupts are masked meanwhile.
static bool take_back(iw_bxcan_t *self) {
    mask_transmit(self);
    const bool done = abort_all(self);
    if (done) {
        forget(self);
    }
    unmask_transmit(self);
    return done;
}

/// An abort that does not end: the frame is lost in the controller, which is reset, mailboxes and all. STARTING is told
/// as a loss of the bus, and nothing is sent before it has been joined anew: until then the reset masks the interrupts.
static void start_anew(iw_bxcan_t *self) {
    iw_register_t *const reset = self->config.reset_register;
    iw_register_write(reset, iw_register_read(reset) | self->config.reset_bits);
    iw_register_write(reset, iw_register_read(reset) & ~self->config.reset_bits);
    forget(self);
    self->resets++;
    self->phase = IW_BXCAN_STARTING;
    write_mcr(self, IW_MCR_INRQ);
}

/// Off the bus nothing leaves: not in bus-off, which only `bus_state` ends, and it joins no bus before all is taken
/// back.
int iw_bxcan_purge(void *context) {
    iw_bxcan_t *const self = context;
    if (take_back(self)) {
        return 1;
    }
    if (self->phase != IW_BXCAN_RUNNING || is_bus_off(self)) {
        return 0;
    }
    start_anew(self);
    return 1;
}

/// Both lead through initialisation mode: bus-off is left by entering and leaving it (bxCAN 7.6), and a device that
/// somebody has reset or put to sleep begins anew. What waits to be sent must not survive either.
static void begin(iw_bxcan_t *self, iw_bxcan_phase_t phase) {
    self->phase = phase;
    (void)take_back(self);
    write_mcr(self, IW_MCR_INRQ);
}

static void leave_init(iw_bxcan_t *self) {
    if (!take_back(self)) {
        return;
    }
    if (self->phase == IW_BXCAN_STARTING) {
        configure(self);
    }
    self->phase = (self->phase == IW_BXCAN_STARTING) ? IW_BXCAN_JOINING : IW_BXCAN_REJOINING;
    write_mcr(self, 0);
}

/// Takes the step that the hardware is ready for, bxCAN 4.1 and 4.2.
static void advance(iw_bxcan_t *self, uint32_t msr) {
    const bool in_init = (msr & IW_MSR_INAK) != 0U;
    if (self->phase == IW_BXCAN_STARTING || self->phase == IW_BXCAN_RECOVERING) {
        if (in_init) {
            leave_init(self);
        } else {
            write_mcr(self, IW_MCR_INRQ);
        }
    } else if (!in_init && !is_bus_off(self)) {
        self->phase = IW_BXCAN_RUNNING;
    }
}

static iw_bus_state_t judge(iw_bxcan_t *self, uint32_t msr) {
    if (is_bus_off(self)) {
        self->bus_offs++;
        begin(self, IW_BXCAN_RECOVERING);
        return IW_BUS_OFF;
    }
    if ((msr & (IW_MSR_INAK | IW_MSR_SLAK)) != 0U) {
        begin(self, IW_BXCAN_STARTING);
        return IW_BUS_DOWN;
    }
    const bool passive = (iw_register_read(&self->config.registers->ESR) & IW_ESR_EPVF) != 0U;
    return passive ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
}

iw_bus_state_t iw_bxcan_bus_state(void *context) {
    iw_bxcan_t *const self = context;
    const uint32_t msr = iw_register_read(&self->config.registers->MSR);
    if (self->phase != IW_BXCAN_RUNNING) {
        advance(self, msr);
    }
    if (self->phase == IW_BXCAN_RUNNING) {
        return judge(self, msr);
    }
    return (self->phase < IW_BXCAN_RUNNING) ? IW_BUS_DOWN : IW_BUS_OFF;
}

iw_bxcan_errors_t iw_bxcan_errors(const iw_bxcan_t *self) {
    const uint32_t esr = iw_register_read(&self->config.registers->ESR);
    return (iw_bxcan_errors_t){(uint8_t)IW_ESR_TEC(esr), (uint8_t)IW_ESR_REC(esr), (uint8_t)IW_ESR_LEC(esr)};
}

/// Lost frames are counted, not waited for: this runs in an interrupt.
static void put(iw_bxcan_t *self, const iw_can_frame_t *frame) {
    if (!iw_frame_ring_put(&self->ring, frame, self->epoch)) {
        self->lost++;
    }
}

void iw_bxcan_on_transmit(iw_bxcan_t *self) {
    iw_register_t *const tsr = &self->config.registers->TSR;
    const uint32_t flags = iw_register_read(tsr);
    for (uint32_t mailbox = 0; mailbox < IW_BXCAN_MAILBOXES; mailbox++) {
        iw_bxcan_outgoing_t *const outgoing = &self->outgoing[mailbox];
        if ((flags & IW_TSR_RQCP(mailbox)) != 0U) {
            iw_register_write(tsr, IW_TSR_RQCP(mailbox));
            for (uint32_t i = 0; i < outgoing->owed && (flags & IW_TSR_TXOK(mailbox)) != 0U; i++) {
                put(self, &outgoing->frame[i]);
            }
            outgoing->owed = 0;
        }
    }
}

/// One frame of FIFO 0, bxCAN 7.3 and 9.3. The interrupt comes again while there are more; a release still under way
/// shows the old frame, so it is left for the next time.
void iw_bxcan_on_receive(iw_bxcan_t *self) {
    iw_bxcan_registers_t *const registers = self->config.registers;
    const uint32_t status = iw_register_read(&registers->RF0R);
    if ((status & IW_RF0R_FOVR0) != 0U) {
        self->overruns++;
        iw_register_write(&registers->RF0R, IW_RF0R_FOVR0);
    }
    if ((status & IW_RF0R_RFOM0) != 0U || (status & IW_RF0R_FMP0) == 0U) {
        return;
    }
    const uint32_t identifier = iw_register_read(&registers->rx[0].RIR);
    const uint32_t dlc = iw_register_read(&registers->rx[0].RDTR) & IW_DTR_DLC;
    const bool extended = (identifier & IW_IR_IDE) != 0U;
    iw_can_frame_t frame = {.kind = IW_CAN_RECEIVED, .dlc = (uint8_t)((dlc < IW_CAN_DATA_MAX) ? dlc : IW_CAN_DATA_MAX)};
    frame.id = extended ? ((identifier >> IW_IR_EXID_SHIFT) | IW_CAN_EXTENDED) : (identifier >> IW_IR_STID_SHIFT);
    frame.id |= ((identifier & IW_IR_RTR) != 0U) ? IW_CAN_REMOTE : 0U;
    bytes_of(iw_register_read(&registers->rx[0].RDLR), &frame.data[0]);
    bytes_of(iw_register_read(&registers->rx[0].RDHR), &frame.data[4]);
    iw_register_write(&registers->RF0R, IW_RF0R_RFOM0);
    put(self, &frame);
}

void iw_bxcan_on_error(iw_bxcan_t *self) {
    iw_register_write(&self->config.registers->MSR, IW_MSR_ERRI);
}
