// SPDX-License-Identifier: MIT
#include "fdcan.h"

#include "fdcan_filters.h"

#include <string.h>

#define TRANSMIT   (BRD_IR_TC | BRD_IR_TCF)
#define INTERRUPTS (BRD_IR_RF0N | BRD_IR_RF0L | TRANSMIT | BRD_IR_EP | BRD_IR_BO)
#define ALL        ((1U << BRD_FDCAN_BUFFERS) - 1U)
#define READY      (BRD_CCCR_INIT | BRD_CCCR_CCE)

/// Writes CCCR (RM0440 44.4). These bits stay zero: DAR (the controller repeats an unacknowledged frame until it is
/// cancelled), FDOE (classic frames only), PXHD (an FD frame is not destroyed), TXP, ASM, CSR and TEST.
static void write_cccr(const brd_fdcan_t *self, uint32_t request) {
    brd_register_write(&self->config.registers->CCCR, (self->config.silent ? BRD_CCCR_MON : 0U) | request);
}

void brd_fdcan_init(brd_fdcan_t *self, const brd_fdcan_config_t *config) {
    memset(self, 0, sizeof *self);
    self->config = *config;
    write_cccr(self, BRD_CCCR_INIT);
}

/// Call it only with CCE (M_CAN 3.1.1). It writes every register on which the behaviour depends, also those that have
/// the right value after a reset.
static void configure(brd_fdcan_t *self) {
    brd_fdcan_registers_t *const registers = self->config.registers;
    brd_register_write(&registers->NBTP, self->config.bit_timing);
    brd_register_write(&registers->CKDIV, 0);
    brd_fdcan_filters_write(registers, self->config.ram);
    brd_register_write(&registers->TXBC, BRD_TXBC_QUEUE);
    brd_register_write(&registers->TXBTIE, ALL);
    brd_register_write(&registers->TXBCIE, ALL);
    brd_register_write(&registers->IR, UINT32_MAX);
    brd_register_write(&registers->IE, INTERRUPTS);
    brd_register_write(&registers->ILS, 0);
    brd_register_write(&registers->ILE, BRD_ILE_0);
}

/// A read clears PXE (RM0440 44.4), so every read of PSR counts it.
static uint32_t read_psr(brd_fdcan_t *self) {
    const uint32_t psr = brd_register_read(&self->config.registers->PSR);
    if ((psr & BRD_PSR_PXE) != 0U) {
        self->exceptions++;
    }
    return psr;
}

static bool is_bus_off(brd_fdcan_t *self) {
    return (read_psr(self) & BRD_PSR_BO) != 0U;
}

static uint32_t word_of(const uint8_t *bytes) {
    return bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static void bytes_of(uint32_t word, uint8_t *out_bytes) {
    for (uint32_t i = 0; i < 4U; i++) {
        out_bytes[i] = (uint8_t)(word >> (8U * i));
    }
}

/// Masks the completions, so that the handler does not change `outgoing`. The read makes sure that the write has
/// arrived.
static void mask_transmit(const brd_fdcan_t *self) {
    brd_register_t *const ie = &self->config.registers->IE;
    brd_register_write(ie, INTERRUPTS & ~TRANSMIT);
    (void)brd_register_read(ie);
    atomic_signal_fence(memory_order_seq_cst);
}

static void unmask_transmit(const brd_fdcan_t *self) {
    atomic_signal_fence(memory_order_seq_cst);
    brd_register_write(&self->config.registers->IE, INTERRUPTS);
}

/// Returns the buffers with a transmission that is not complete. A request moves from TXBAR to TXBRP when the
/// controller has noticed it (RM0440 44.4), so TXBAR must be read first.
static uint32_t read_pending(const brd_fdcan_t *self) {
    const uint32_t requested = brd_register_read(&self->config.registers->TXBAR);
    return (requested | brd_register_read(&self->config.registers->TXBRP)) & ALL;
}

/// Requests the cancellation of these buffers (M_CAN 3.5.5) and waits for its end: at the latest the end of the frame
/// that is on the bus, unless the controller hangs. The loop is limited. Returns false if the limit was reached.
static bool cancel(const brd_fdcan_t *self, uint32_t buffers) {
    brd_register_write(&self->config.registers->TXBCR, buffers);
    for (uint32_t poll = 0; poll < self->config.poll_limit; poll++) {
        if ((read_pending(self) & buffers) == 0U) {
            return true;
        }
    }
    return false;
}

static bool was_sent(const brd_fdcan_t *self, uint32_t buffer) {
    return ((brd_register_read(&self->config.registers->TXBTO) >> buffer) & 1U) != 0U;
}

/// Cancels the buffer and passes the echoes that it owes to `heir`, the frame that replaces it. Returns false if the
/// cancellation does not end. If the frame was sent after all, buffer and echoes stay for the handler.
static bool withdraw(brd_fdcan_t *self, uint32_t buffer, brd_fdcan_outgoing_t *heir) {
    if (!cancel(self, 1U << buffer)) {
        return false;
    }
    if (!was_sent(self, buffer)) {
        *heir = self->outgoing[buffer];
        self->outgoing[buffer].owed = 0;
    }
    return true;
}

/// Cancels the waiting frame with this id, if there is one; there is at most one. Returns false if the cancellation
/// does not end, or if the buffer already owes the maximum of echoes.
static bool withdraw_id(brd_fdcan_t *self, uint32_t id, brd_fdcan_outgoing_t *heir) {
    bool done = true;
    for (uint32_t buffer = 0; buffer < BRD_FDCAN_BUFFERS && done; buffer++) {
        const brd_fdcan_outgoing_t *const outgoing = &self->outgoing[buffer];
        if (outgoing->owed > 0U && outgoing->frame[0].id == id) {
            done = outgoing->owed < BRD_FDCAN_ECHOES && withdraw(self, buffer, heir);
        }
    }
    return done;
}

/// Writes a free buffer without a request. The search begins at the put index (RM0440 44.4) and continues in the
/// direction in which a request moves it. Returns the buffer, or BRD_FDCAN_BUFFERS if none is free.
static uint32_t load_free_buffer(brd_fdcan_t *self, const iw_can_frame_t *frame, brd_fdcan_outgoing_t *heir) {
    const uint32_t put = (brd_register_read(&self->config.registers->TXFQS) >> BRD_TXFQS_PUT_SHIFT) & 3U;
    for (uint32_t i = 0; i < BRD_FDCAN_BUFFERS; i++) {
        const uint32_t buffer = (put + i) % BRD_FDCAN_BUFFERS;
        if (self->outgoing[buffer].owed == 0U) {
            brd_fdcan_element_t *const element = &self->config.ram->transmit[buffer];
            heir->frame[heir->owed] = *frame;
            heir->frame[heir->owed].kind = IW_CAN_ECHO;
            heir->owed++;
            heir->is_requested = false;
            self->outgoing[buffer] = *heir;
            brd_register_write(&element->id, frame->id << BRD_ELEMENT_STD_SHIFT);
            brd_register_write(&element->control, (uint32_t)frame->dlc << BRD_ELEMENT_DLC_SHIFT);
            brd_register_write(&element->data[0], word_of(&frame->data[0]));
            brd_register_write(&element->data[1], word_of(&frame->data[4]));
            return buffer;
        }
    }
    return BRD_FDCAN_BUFFERS;
}

/// Puts the frame into a buffer in place of a waiting frame with the same id. The interrupt is masked for each frame
/// separately: a frame that was sent during the first call frees its buffer before the second call needs one.
static uint32_t place(brd_fdcan_t *self, const iw_can_frame_t *frame) {
    brd_fdcan_outgoing_t heir;
    heir.owed = 0;
    mask_transmit(self);
    const bool withdrawn = withdraw_id(self, frame->id, &heir);
    const uint32_t buffer = withdrawn ? load_free_buffer(self, frame, &heir) : BRD_FDCAN_BUFFERS;
    unmask_transmit(self);
    return buffer;
}

/// Requests all these buffers with one write (RM0440 44.4). With the interrupt masked the handler sees either
/// neither the request nor its mark, or both.
static void request(brd_fdcan_t *self, uint32_t buffers) {
    mask_transmit(self);
    for (uint32_t buffer = 0; buffer < BRD_FDCAN_BUFFERS; buffer++) {
        if (((buffers >> buffer) & 1U) != 0U) {
            self->outgoing[buffer].is_requested = true;
        }
    }
    brd_register_write(&self->config.registers->TXBAR, buffers);
    unmask_transmit(self);
}

static bool can_be_sent(brd_fdcan_t *self, const iw_can_frame_t *frames, uint32_t count) {
    bool good = self->phase == BRD_FDCAN_RUNNING && !self->config.silent && !is_bus_off(self);
    for (uint32_t i = 0; i < count; i++) {
        good = good && frames[i].id <= IW_CAN_ID_MASK && frames[i].dlc <= IW_CAN_DATA_MAX;
    }
    return good;
}

int brd_fdcan_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    brd_fdcan_t *const self = context;
    uint32_t buffers = 0;
    uint32_t filled = 0;
    if (!can_be_sent(self, frames, count)) {
        return -1;
    }
    while (filled < count && filled < IW_SIDES) {
        const uint32_t buffer = place(self, &frames[filled]);
        if (buffer == BRD_FDCAN_BUFFERS) {
            break;
        }
        buffers |= 1U << buffer;
        filled++;
    }
    if (filled > 0U) {
        request(self, buffers);
    }
    return (int)filled;
}

/// Returns true once after a loss of frames, with the report of the controller in `*out_frame`. The core counts it.
static bool report_loss(brd_fdcan_t *self, iw_can_frame_t *out_frame) {
    const uint32_t losses = self->overruns + self->lost + self->exceptions;
    if (losses == self->losses_reported) {
        return false;
    }
    self->losses_reported = losses;
    *out_frame = (iw_can_frame_t){.id = IW_CAN_ERROR, .kind = IW_CAN_RECEIVED};
    return true;
}

int brd_fdcan_receive(void *context, iw_can_frame_t *out_frame) {
    brd_fdcan_t *const self = context;
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
    return (self->phase == BRD_FDCAN_RUNNING) ? 0 : -1;
}

/// Drops all owed echoes. After a purge no echo may reach the core (hal.h): those in the ring have the old epoch, so
/// that `receive` drops them.
static void forget(brd_fdcan_t *self) {
    memset(self->outgoing, 0, sizeof self->outgoing);
    self->epoch++;
}

/// Cancels all waiting frames with the interrupt masked. Returns false if this is left to a later call.
static bool take_back(brd_fdcan_t *self) {
    mask_transmit(self);
    const bool done = cancel(self, ALL);
    if (done) {
        forget(self);
    }
    unmask_transmit(self);
    return done;
}

/// Resets the controller with its buffers after a cancellation that does not end. `bus_state` reports STARTING as a
/// loss of the bus, and nothing is sent before the controller has joined the bus again. Until then the reset masks its
/// interrupts.
static void start_again(brd_fdcan_t *self) {
    brd_register_t *const reset = self->config.reset_register;
    brd_register_write(reset, brd_register_read(reset) | self->config.reset_bits);
    brd_register_write(reset, brd_register_read(reset) & ~self->config.reset_bits);
    forget(self);
    self->resets++;
    self->phase = BRD_FDCAN_STARTING;
    write_cccr(self, BRD_CCCR_INIT);
}

/// Off the bus no frame leaves the controller, so 0 is safe: only `bus_state` ends bus-off, and CCE drops all frames
/// before.
int brd_fdcan_purge(void *context) {
    brd_fdcan_t *const self = context;
    if (take_back(self)) {
        return 1;
    }
    if (self->phase != BRD_FDCAN_RUNNING || is_bus_off(self)) {
        return 0;
    }
    start_again(self);
    return 1;
}

/// Off the bus: CCE drops all frames that wait in the controller. It has no effect before INIT is set.
static void drop(brd_fdcan_t *self) {
    mask_transmit(self);
    write_cccr(self, READY);
    forget(self);
    unmask_transmit(self);
}

/// Configures with CCE, which also drops all frames that wait (M_CAN 3.1.1), and leaves the initialisation. MON can be
/// set only while CCE is set already. If one of them is missing, or a frame still waits, a later call tries again.
static void leave_init(brd_fdcan_t *self) {
    const uint32_t needed = READY | (self->config.silent ? BRD_CCCR_MON : 0U);
    drop(self);
    write_cccr(self, READY);
    if ((brd_register_read(&self->config.registers->CCCR) & needed) != needed || read_pending(self) != 0U) {
        return;
    }
    configure(self);
    self->phase = (self->phase == BRD_FDCAN_STARTING) ? BRD_FDCAN_JOINING : BRD_FDCAN_REJOINING;
    write_cccr(self, 0);
}

/// Does the next step if the hardware is ready for it. After INIT a controller that is bus-off counts 129 times 11
/// recessive bits (M_CAN 3.1.4), another one waits for 11 of them. INIT that is set again is an unexpected reset.
static void advance(brd_fdcan_t *self) {
    const bool in_init = (brd_register_read(&self->config.registers->CCCR) & BRD_CCCR_INIT) != 0U;
    const bool is_waiting = self->phase == BRD_FDCAN_JOINING || self->phase == BRD_FDCAN_REJOINING;
    if (is_waiting && in_init) {
        self->phase = (self->phase == BRD_FDCAN_JOINING) ? BRD_FDCAN_STARTING : BRD_FDCAN_RECOVERING;
    } else if (is_waiting) {
        const uint32_t psr = read_psr(self);
        if ((psr & BRD_PSR_BO) == 0U && (psr & BRD_PSR_ACT) != 0U) {
            self->phase = BRD_FDCAN_RUNNING;
        }
        return;
    }
    if (in_init) {
        leave_init(self);
    } else {
        write_cccr(self, BRD_CCCR_INIT);
    }
}

/// Both losses begin with INIT, which a bus-off sets in the hardware. With it the controller sends nothing, and the
/// frames from before are dropped in this call.
static iw_bus_state_t judge(brd_fdcan_t *self) {
    const uint32_t psr = read_psr(self);
    if ((psr & BRD_PSR_BO) != 0U) {
        self->bus_offs++;
        self->phase = BRD_FDCAN_RECOVERING;
        drop(self);
        return IW_BUS_OFF;
    }
    if ((brd_register_read(&self->config.registers->CCCR) & BRD_CCCR_INIT) != 0U) {
        self->phase = BRD_FDCAN_STARTING;
        drop(self);
        return IW_BUS_DOWN;
    }
    return ((psr & BRD_PSR_EP) != 0U) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
}

iw_bus_state_t brd_fdcan_bus_state(void *context) {
    brd_fdcan_t *const self = context;
    if (self->phase != BRD_FDCAN_RUNNING) {
        advance(self);
    }
    if (self->phase == BRD_FDCAN_RUNNING) {
        return judge(self);
    }
    return (self->phase < BRD_FDCAN_RUNNING) ? IW_BUS_DOWN : IW_BUS_OFF;
}

/// Counts a lost frame and does not wait, because it runs in an interrupt.
static void put(brd_fdcan_t *self, const iw_can_frame_t *frame) {
    if (!brd_frame_ring_put(&self->ring, frame, self->epoch)) {
        self->lost++;
    }
}

/// The flag was cleared before, so a completion after these reads raises the interrupt again.
static void on_transmit(brd_fdcan_t *self) {
    const uint32_t pending = read_pending(self);
    for (uint32_t buffer = 0; buffer < BRD_FDCAN_BUFFERS; buffer++) {
        brd_fdcan_outgoing_t *const outgoing = &self->outgoing[buffer];
        if (outgoing->owed > 0U && outgoing->is_requested && ((pending >> buffer) & 1U) == 0U) {
            const bool sent = was_sent(self, buffer);
            for (uint32_t i = 0; i < outgoing->owed && sent; i++) {
                put(self, &outgoing->frame[i]);
            }
            outgoing->owed = 0;
        }
    }
}

/// Reads the oldest frame of FIFO 0 and releases it. Returns false if there is none. The controller stores no FD frame
/// in classic mode; if one is there, its id marks it.
static bool take_received(brd_fdcan_t *self) {
    brd_fdcan_registers_t *const registers = self->config.registers;
    const uint32_t status = brd_register_read(&registers->RXF0S);
    const uint32_t index = (status >> BRD_RXF0S_GET_SHIFT) & 3U;
    if ((status & BRD_RXF0S_LEVEL) == 0U || index >= BRD_FDCAN_DEPTH) {
        return false;
    }
    brd_fdcan_element_t *const element = &self->config.ram->receive[0][index];
    const uint32_t header = brd_register_read(&element->id);
    const uint32_t control = brd_register_read(&element->control);
    const uint32_t dlc = (control >> BRD_ELEMENT_DLC_SHIFT) & 0xFU;
    const bool extended = (header & BRD_ELEMENT_XTD) != 0U;
    const uint32_t number = header & BRD_ELEMENT_ID;
    iw_can_frame_t frame = {.kind = IW_CAN_RECEIVED, .dlc = (uint8_t)((dlc < IW_CAN_DATA_MAX) ? dlc : IW_CAN_DATA_MAX)};
    frame.id = extended ? (number | IW_CAN_EXTENDED) : (number >> BRD_ELEMENT_STD_SHIFT);
    frame.id |= ((header & BRD_ELEMENT_RTR) != 0U) ? IW_CAN_REMOTE : 0U;
    frame.id |= ((control & BRD_ELEMENT_FDF) != 0U) ? IW_CAN_FD : 0U;
    bytes_of(brd_register_read(&element->data[0]), &frame.data[0]);
    bytes_of(brd_register_read(&element->data[1]), &frame.data[4]);
    brd_register_write(&registers->RXF0A, index);
    put(self, &frame);
    return true;
}

/// Clears the flags first and empties the FIFO then: the flag is set by a new frame, not by the level of the FIFO.
void brd_fdcan_on_interrupt(brd_fdcan_t *self) {
    brd_fdcan_registers_t *const registers = self->config.registers;
    const uint32_t flags = brd_register_read(&registers->IR) & brd_register_read(&registers->IE);
    brd_register_write(&registers->IR, flags);
    if ((flags & BRD_IR_RF0L) != 0U) {
        self->overruns++;
    }
    if ((flags & TRANSMIT) != 0U) {
        on_transmit(self);
    }
    while (take_received(self)) {
    }
}
