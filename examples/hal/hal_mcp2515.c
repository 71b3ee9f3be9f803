// SPDX-License-Identifier: MIT
#include "hal_mcp2515.h"

#include "iwheel/codec.h"

#include <string.h>

// SPI instructions: data sheet DS20001801, section 12.
#define RESET       0xC0U
#define READ        0x03U
#define WRITE       0x02U
#define BIT_MODIFY  0x05U
#define READ_STATUS 0xA0U
#define REQUEST     0x80U // With one bit for each transmit buffer.
#define READ_RX_0   0x90U
#define READ_RX_1   0x94U

// Registers: section 11.
#define CANSTAT  0x0EU
#define CANCTRL  0x0FU
#define CNF3     0x28U // Followed by CNF2, CNF1, CANINTE, CANINTF, EFLG.
#define CANINTF  0x2CU
#define EFLG     0x2DU
#define RXB0CTRL 0x60U
#define RXB1CTRL 0x70U

#define MODE_MASK    0xE0U // Field of CANSTAT and CANCTRL; 0: normal.
#define INTF_RX_0    0x01U
#define INTF_RX_1    0x02U
#define INTF_ERROR   0x20U
#define EFLG_PASSIVE 0x18U
#define EFLG_BUS_OFF 0x20U
#define EFLG_OVERRUN 0xC0U
#define ANY_ROLLOVER 0x64U // RXBnCTRL: every frame without filters; buffer 1 if buffer 0 is full.
#define TXREQ        0x08U // Bit of TXBnCTRL.

#define REJOIN_us   2000U
#define JOIN_us     1000000U // Then the chip is reset again: a fault of its supply can have put it into configuration mode.
#define PUMP_MAX    8U
#define ABORT_POLLS 125U // At least 2 us each: longer than the longest frame with an error at its end.

/// If buffers have the same priority, the chip sends the one with the higher number first: the left wheel has buffer 2.
typedef struct {
    uint8_t load;    ///< Instruction that writes the buffer.
    uint8_t control; ///< TXBnCTRL.
    uint8_t request; ///< Bit of the instruction REQUEST.
    uint8_t flag;    ///< Bit of CANINTF.
    uint8_t pending; ///< Bits of READ_STATUS: TXREQ and TXnIF.
    uint8_t sent;
} buffer_t;

static const buffer_t buffers[IW_SIDES] = {{0x44U, 0x50U, 0x04U, 0x10U, 0x40U, 0x80U},
                                           {0x42U, 0x40U, 0x02U, 0x08U, 0x10U, 0x20U}};

/// CNF3, CNF2, CNF1, CANINTE: quanta of 125 ns with 16 MHz, 1 + 2 + 2 before the sample point, 3 after it.
static const uint8_t settings[] = {0x02U, 0x89U, 0x00U, 0x3BU};

static uint8_t read_register(const hal_mcp2515_t *self, uint8_t address) {
    uint8_t bytes[3] = {READ, address, 0};
    self->board.transfer(bytes, sizeof bytes);
    return bytes[2];
}

static void write_register(const hal_mcp2515_t *self, uint8_t address, uint8_t value) {
    uint8_t bytes[3] = {WRITE, address, value};
    self->board.transfer(bytes, sizeof bytes);
}

static void clear_bits(const hal_mcp2515_t *self, uint8_t address, uint8_t bits) {
    uint8_t bytes[4] = {BIT_MODIFY, address, bits, 0};
    self->board.transfer(bytes, sizeof bytes);
}

static uint8_t read_status(const hal_mcp2515_t *self) {
    uint8_t bytes[2] = {READ_STATUS, 0};
    self->board.transfer(bytes, sizeof bytes);
    return bytes[1];
}

static void put(hal_mcp2515_t *self, const iw_can_frame_t *frame) {
    if (self->count == HAL_MCP2515_RING) {
        self->has_lost = true;
        return;
    }
    self->ring[(self->first + self->count) % HAL_MCP2515_RING] = *frame;
    self->count++;
}

static iw_can_frame_t take(hal_mcp2515_t *self) {
    const iw_can_frame_t frame = self->ring[self->first];
    self->first = (self->first + 1U) % HAL_MCP2515_RING;
    self->count--;
    return frame;
}

/// The chip leaves the bus. The reset also drops its frames.
static void lose(hal_mcp2515_t *self, iw_bus_state_t loss) {
    uint8_t reset = RESET;
    self->board.transfer(&reset, 1);
    self->phase = HAL_MCP2515_RESET;
    self->loss = loss;
    self->reset_us = self->board.micros();
}

void hal_mcp2515_start(hal_mcp2515_t *self, const hal_mcp2515_board_t *board) {
    memset(self, 0, sizeof *self);
    self->board = *board;
    lose(self, IW_BUS_DOWN);
}

/// Bytes of a received frame after the instruction: SIDH, SIDL, EID8, EID0, DLC, data.
static void receive_buffer(hal_mcp2515_t *self, uint8_t instruction) {
    uint8_t bytes[14] = {instruction};
    self->board.transfer(bytes, sizeof bytes); // Also clears RXnIF.
    iw_can_frame_t frame = {.id = ((uint32_t)bytes[1] << 3) | (bytes[2] >> 5), .kind = IW_CAN_RECEIVED};
    if ((bytes[2] & 0x08U) != 0U) {
        const uint32_t low = ((uint32_t)(bytes[2] & 3U) << 16) | ((uint32_t)bytes[3] << 8) | bytes[4];
        frame.id = (frame.id << 18) | low | IW_CAN_EXTENDED;
        frame.id |= ((bytes[5] & 0x40U) != 0U) ? IW_CAN_REMOTE : 0U;
    } else {
        frame.id |= ((bytes[2] & 0x10U) != 0U) ? IW_CAN_REMOTE : 0U;
    }
    const uint8_t length = bytes[5] & 0x0FU;
    frame.dlc = (length < IW_CAN_DATA_MAX) ? length : (uint8_t)IW_CAN_DATA_MAX;
    memcpy(frame.data, &bytes[6], frame.dlc);
    put(self, &frame);
    self->buffer_1_older = instruction == READ_RX_0;
}

/// Until buffer 0 was read, a new frame went to buffer 1: then buffer 1 has the older one.
static void receive_frames(hal_mcp2515_t *self, uint8_t status) {
    const bool in_0 = (status & INTF_RX_0) != 0U;
    const bool in_1 = (status & INTF_RX_1) != 0U;
    const bool reverse = self->buffer_1_older && in_1;
    if (in_0 && !reverse) {
        receive_buffer(self, READ_RX_0);
    }
    if (in_1) {
        receive_buffer(self, READ_RX_1);
    }
    if (in_0 && reverse) {
        receive_buffer(self, READ_RX_0);
    }
}

static void receive_echoes(hal_mcp2515_t *self, uint8_t status) {
    for (uint32_t side = 0; side < IW_SIDES; side++) {
        if ((status & buffers[side].sent) != 0U) {
            clear_bits(self, CANINTF, buffers[side].flag);
            if (self->waits[side]) {
                self->waits[side] = false;
                put(self, &self->waiting[side]);
            }
        }
    }
}

/// Returns true if the bus is lost.
static bool check_errors(hal_mcp2515_t *self) {
    clear_bits(self, CANINTF, INTF_ERROR); // First: a later change sets it again.
    const uint8_t errors = read_register(self, EFLG);
    if ((errors & EFLG_BUS_OFF) != 0U) {
        lose(self, IW_BUS_OFF);
        return true;
    }
    if ((errors & EFLG_OVERRUN) != 0U) {
        self->has_lost = true;
        clear_bits(self, EFLG, EFLG_OVERRUN);
    }
    return false;
}

/// Moves frames and echoes to the ring. Call it in the interrupt or with the interrupt masked. It checks the errors after
/// the flags of each frame are cleared: an error that came before keeps INT low, so no other interrupt would follow.
static void pump(hal_mcp2515_t *self) {
    const uint8_t wanted = INTF_RX_0 | INTF_RX_1 | buffers[IW_LEFT].sent | buffers[IW_RIGHT].sent;
    if (self->phase != HAL_MCP2515_RUNNING) {
        return;
    }
    for (uint32_t i = 0; i < PUMP_MAX && !check_errors(self); i++) {
        const uint8_t status = read_status(self);
        if ((status & wanted) == 0U) {
            self->buffer_1_older = false; // Both are free, and buffer 0 is filled first.
            return;
        }
        receive_frames(self, status);
        receive_echoes(self, status);
    }
}

void hal_mcp2515_on_interrupt(hal_mcp2515_t *self) {
    pump(self);
}

static void load(hal_mcp2515_t *self, iw_side_t side, const iw_can_frame_t *frame) {
    uint8_t bytes[14] = {buffers[side].load, (uint8_t)(frame->id >> 3), (uint8_t)(frame->id << 5), 0, 0, frame->dlc};
    memcpy(&bytes[6], frame->data, IW_CAN_DATA_MAX);
    self->board.transfer(bytes, sizeof bytes);
    self->waiting[side] = *frame;
    self->waiting[side].kind = IW_CAN_ECHO;
    self->waits[side] = true;
}

static int send_masked(hal_mcp2515_t *self, const iw_can_frame_t *frames, uint32_t count) {
    uint8_t request = REQUEST;
    pump(self);
    if (self->phase != HAL_MCP2515_RUNNING) {
        return -1;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (self->waits[iw_codec_side(frames[i].id)]) {
            return 0;
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        const iw_side_t side = iw_codec_side(frames[i].id);
        load(self, side, &frames[i]);
        request |= buffers[side].request;
    }
    self->board.transfer(&request, 1);
    return (int)count;
}

static int send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    hal_mcp2515_t *const self = context;
    self->board.mask(true);
    const int accepted = send_masked(self, frames, count);
    self->board.mask(false);
    return accepted;
}

static int receive(void *context, iw_can_frame_t *out_frame) {
    hal_mcp2515_t *const self = context;
    int result = 1;
    self->board.mask(true);
    pump(self);
    if (self->has_lost) {
        self->has_lost = false;
        *out_frame = (iw_can_frame_t){.id = IW_CAN_ERROR, .kind = IW_CAN_RECEIVED};
    } else if (self->count > 0U) {
        *out_frame = take(self);
    } else {
        result = 0;
    }
    self->board.mask(false);
    return result;
}

/// Returns false if the chip does not answer: a line of SPI that is always low would look like the normal mode.
static bool configure(hal_mcp2515_t *self) {
    for (uint8_t i = 0; i < sizeof settings; i++) {
        write_register(self, (uint8_t)(CNF3 + i), settings[i]);
    }
    write_register(self, RXB0CTRL, ANY_ROLLOVER);
    write_register(self, RXB1CTRL, ANY_ROLLOVER);
    for (uint8_t i = 0; i < sizeof settings; i++) {
        if (read_register(self, (uint8_t)(CNF3 + i)) != settings[i]) {
            return false;
        }
    }
    write_register(self, CANCTRL, 0);
    return true;
}

static bool is_normal(const hal_mcp2515_t *self) {
    return (read_register(self, CANSTAT) & MODE_MASK) == 0U;
}

/// A chip that is not in the normal mode while RUNNING was reset by a fault of its supply.
static iw_bus_state_t judge(hal_mcp2515_t *self) {
    pump(self);
    if (self->phase == HAL_MCP2515_RUNNING && !is_normal(self)) {
        lose(self, IW_BUS_DOWN);
    }
    if (self->phase == HAL_MCP2515_RUNNING) {
        return ((read_register(self, EFLG) & EFLG_PASSIVE) != 0U) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
    }
    if (self->phase == HAL_MCP2515_JOINING) {
        if (is_normal(self)) {
            self->phase = HAL_MCP2515_RUNNING;
        } else if (self->board.micros() - self->reset_us >= JOIN_us) {
            lose(self, self->loss);
        }
        return self->loss;
    }
    self->count = 0; // Frames from before the loss.
    memset(self->waits, 0, sizeof self->waits);
    self->buffer_1_older = false;
    if (self->board.micros() - self->reset_us >= REJOIN_us && configure(self)) {
        self->phase = HAL_MCP2515_JOINING;
    }
    return self->loss;
}

static iw_bus_state_t bus_state(void *context) {
    hal_mcp2515_t *const self = context;
    self->board.mask(true);
    const iw_bus_state_t state = judge(self);
    self->board.mask(false);
    return state;
}

static void drop_echoes(hal_mcp2515_t *self) {
    const uint32_t count = self->count;
    for (uint32_t i = 0; i < count; i++) {
        const iw_can_frame_t frame = take(self);
        if (frame.kind == IW_CAN_RECEIVED) {
            put(self, &frame);
        }
    }
}

/// The flag of a frame that was sent before its abort stays; `pump` clears it without an echo.
/// Returns the status at the end of the aborts, or after the last poll.
static uint8_t abort_all(const hal_mcp2515_t *self, uint8_t pending) {
    clear_bits(self, buffers[IW_LEFT].control, TXREQ);
    clear_bits(self, buffers[IW_RIGHT].control, TXREQ);
    uint8_t status = read_status(self);
    for (uint32_t poll = 0; poll < ABORT_POLLS && (status & pending) != 0U; poll++) {
        status = read_status(self);
    }
    return status;
}

static int purge_masked(hal_mcp2515_t *self) {
    const uint8_t pending = buffers[IW_LEFT].pending | buffers[IW_RIGHT].pending;
    const uint8_t status =
        (self->phase == HAL_MCP2515_RUNNING) ? abort_all(self, pending) : 0U; // Dropped by the reset.
    if ((status & pending) == 0U) {
        memset(self->waits, 0, sizeof self->waits);
        drop_echoes(self);
        return 1;
    }
    for (uint32_t side = 0; side < IW_SIDES; side++) {
        if ((status & (buffers[side].pending | buffers[side].sent)) == 0U) {
            self->waits[side] = false; // Aborted: it has no echo.
        }
    }
    return 0;
}

static int purge(void *context) {
    hal_mcp2515_t *const self = context;
    self->board.mask(true);
    const int result = purge_masked(self);
    self->board.mask(false);
    return result;
}

static int estop_pressed(void *context) {
    const hal_mcp2515_t *const self = context;
    return self->board.estop_pressed();
}

iw_hal_t hal_mcp2515(hal_mcp2515_t *self) {
    return (iw_hal_t){.send = send,
                      .receive = receive,
                      .bus_state = bus_state,
                      .purge = purge,
                      .estop_pressed = estop_pressed,
                      .context = self};
}

iw_time_us_t hal_mcp2515_time_us(hal_mcp2515_t *self) {
    self->time_us += (uint32_t)(self->board.micros() - (uint32_t)self->time_us);
    return self->time_us;
}
