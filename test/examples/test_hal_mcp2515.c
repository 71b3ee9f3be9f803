// SPDX-License-Identifier: MIT
// The example HAL of the MCP2515, against a model of the chip after its data sheet.
#include "hal_mcp2515.h"

#include "first_drive.h"
#include "hal_check.h"

#include <string.h>

#define CANSTAT         0x0EU
#define CANCTRL         0x0FU
#define CNF3            0x28U
#define CNF2            0x29U
#define CNF1            0x2AU
#define CANINTF         0x2CU
#define EFLG            0x2DU
#define TXREQ           0x08U
#define CONFIG          0x80U
#define CONTROL(buffer) (0x30U + 0x10U * (buffer))

static hal_mcp2515_t self;
static iw_hal_t hal;

static struct {
    uint8_t reg[128];
    uint8_t receive[2][13];
    uint8_t transmit[3][13];
    uint8_t requested_together; ///< Argument of the last request.
    uint8_t on_bus;             ///< Buffers that an abort does not stop.
    bool absent;                ///< MISO is always low.
    uint32_t resets, transfers, masks;
    uint32_t now_us;
    int estop;
    void (*during_read)(void); ///< Called once, while buffer 0 is being read.
    void (*at_status)(void);   ///< Called once, before the status is read.
} model;

static uint8_t status(void) {
    const uint8_t flags = model.reg[CANINTF];
    uint32_t value = flags & 3U;
    for (uint32_t buffer = 0; buffer < 3U; buffer++) {
        value |= ((model.reg[CONTROL(buffer)] & TXREQ) != 0U) ? 4U << (2U * buffer) : 0U;
        value |= (((flags >> (2U + buffer)) & 1U) != 0U) ? 8U << (2U * buffer) : 0U;
    }
    return (uint8_t)value;
}

static void reset(void) {
    memset(model.reg, 0, sizeof model.reg);
    model.reg[CANSTAT] = CONFIG;
    model.reg[CANCTRL] = CONFIG;
    model.resets++;
}

/// The settings can be written in the configuration mode only, and the error flags by the chip only.
static void write_bits(uint8_t address, uint8_t mask, uint8_t value) {
    const bool setting = address >= CNF3 && address <= CNF1;
    if (address == CANSTAT || (setting && model.reg[CANSTAT] != CONFIG)) {
        return;
    }
    if (address == EFLG) {
        mask &= 0xC0U;
    }
    const uint8_t kept = ((model.on_bus != 0U) && address == CONTROL(model.on_bus)) ? (model.reg[address] & TXREQ) : 0U;
    model.reg[address] = (uint8_t)((model.reg[address] & ~mask) | (value & mask) | kept);
}

static void call_once(void (**callback)(void)) {
    void (*const function)(void) = *callback;
    *callback = NULL;
    if (function != NULL) {
        function();
    }
}

static void read_received(uint8_t buffer, uint8_t *bytes) {
    memcpy(&bytes[1], model.receive[buffer], 13);
    if (buffer == 0U) {
        call_once(&model.during_read);
    }
    model.reg[CANINTF] &= (uint8_t) ~(1U << buffer); // When chip select rises.
}

static void transfer(uint8_t *bytes, uint32_t count) {
    const uint8_t instruction = bytes[0];
    model.transfers++;
    if (instruction == 0xC0U) {
        reset();
    } else if (instruction == 0x03U) {
        bytes[2] = model.reg[bytes[1]];
    } else if (instruction == 0x02U) {
        write_bits(bytes[1], 0xFF, bytes[2]);
    } else if (instruction == 0x05U) {
        write_bits(bytes[1], bytes[2], bytes[3]);
    } else if (instruction == 0xA0U) {
        call_once(&model.at_status);
        bytes[1] = status();
    } else if (instruction == 0x90U || instruction == 0x94U) {
        read_received((instruction == 0x94U) ? 1U : 0U, bytes);
    } else if (instruction >= 0x80U && instruction < 0x88U) {
        model.requested_together = instruction & 7U;
        for (uint32_t buffer = 0; buffer < 3U; buffer++) {
            model.reg[CONTROL(buffer)] |= (((instruction >> buffer) & 1U) != 0U) ? TXREQ : 0U;
        }
    } else {
        memcpy(model.transmit[(instruction - 0x40U) / 2U], &bytes[1], 13);
    }
    if (model.absent) {
        memset(bytes, 0, count);
    }
}

static void mask(bool masked) {
    model.masks += masked ? 1U : 0U - 1U;
}

static uint32_t read_micros(void) {
    return model.now_us;
}

static int estop_pressed(void) {
    return model.estop;
}

static void interrupt(void) {
    hal_mcp2515_on_interrupt(&self);
}

static void acknowledge(uint32_t buffer) {
    model.reg[CONTROL(buffer)] &= (uint8_t)~TXREQ;
    model.reg[CANINTF] |= (uint8_t)(4U << buffer);
}

/// Returns the id of a standard frame in a transmit buffer.
static uint32_t id_of(const uint8_t *buffer) {
    return ((uint32_t)buffer[0] << 3) | (buffer[1] >> 5);
}

/// A standard frame arrives: in buffer 0, or in buffer 1 if that is full.
static void arrive(uint32_t id) {
    const uint8_t buffer = model.reg[CANINTF] & 1U;
    if ((model.reg[CANINTF] & 3U) == 3U) {
        model.reg[EFLG] |= 0x80U;
        return;
    }
    memset(model.receive[buffer], 0, 13);
    model.receive[buffer][0] = (uint8_t)(id >> 3);
    model.receive[buffer][1] = (uint8_t)(id << 5);
    model.reg[CANINTF] |= (uint8_t)(1U << buffer);
}

static void join(void) {
    model.now_us += 2000;
    expect_state(&hal, self.loss);
    model.reg[CANSTAT] = model.reg[CANCTRL]; // After 11 recessive bits.
    expect_state(&hal, self.loss);
}

void setUp(void) {
    static const hal_mcp2515_board_t board = {transfer, mask, read_micros, estop_pressed};
    memset(&model, 0, sizeof model);
    memset(&self, 0xA5, sizeof self);
    hal_mcp2515_start(&self, &board);
    hal = hal_mcp2515(&self);
    join();
    expect_state(&hal, IW_BUS_ACTIVE);
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_UINT32(0, model.masks);
}

TEST(test_mcp2515_start_has_the_bit_timing_of_the_wheels) {
    const uint32_t before = 1U + (model.reg[CNF2] & 7U) + 1U + ((model.reg[CNF2] >> 3) & 7U) + 1U;
    const uint32_t after = (model.reg[CNF3] & 7U) + 1U;
    TEST_ASSERT_EQUAL_UINT32(8, before + after); // Quanta of 125 ns: the prescaler is 1.
    TEST_ASSERT_EQUAL_UINT32(5, before);         // 62.5 %.
    TEST_ASSERT_EQUAL_HEX8(0, model.reg[CNF1]);
    model.estop = 1;
    TEST_ASSERT_EQUAL_INT(1, hal.estop_pressed(hal.context));
}

TEST(test_mcp2515_absent_chip_is_no_bus) {
    hal_mcp2515_board_t board = self.board;
    model.absent = true;
    hal_mcp2515_start(&self, &board);
    for (uint32_t i = 0; i < 10U; i++) {
        model.now_us += 2000;
        expect_state(&hal, IW_BUS_DOWN);
        TEST_ASSERT_EQUAL_INT(-1, send_pair(&hal, 10));
    }
}

/// The supply fails while the chip joins: it returns in its configuration mode, which it does not leave on its own.
TEST(test_mcp2515_join_that_does_not_end_begins_again) {
    hal_mcp2515_board_t board = self.board;
    hal_mcp2515_start(&self, &board);
    model.now_us += 2000;
    expect_state(&hal, self.loss);
    reset();
    model.now_us += 1000000;
    expect_state(&hal, self.loss);
    join();
    expect_state(&hal, IW_BUS_ACTIVE);
}

TEST(test_mcp2515_echo_comes_only_after_the_acknowledgement) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    TEST_ASSERT_EQUAL_HEX8(0x06, model.requested_together);
    TEST_ASSERT_EQUAL_HEX32(LEFT, id_of(model.transmit[2])); // The higher buffer leaves first.
    TEST_ASSERT_EQUAL_HEX32(RIGHT, id_of(model.transmit[1]));
    TEST_ASSERT_EQUAL_UINT8(5, model.transmit[1][4]);
    TEST_ASSERT_EQUAL_UINT8(10, model.transmit[1][7]);
    expect_none(&hal);
    acknowledge(2);
    interrupt();
    acknowledge(1);
    expect_echoes(&hal, 10);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_HEX8(0, model.reg[CANINTF]);
}

TEST(test_mcp2515_send_refuses_a_pair_while_one_id_waits) {
    const iw_can_frame_t right = setpoint(RIGHT, 0);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(1);
    TEST_ASSERT_EQUAL_INT(0, send_pair(&hal, 11));
    TEST_ASSERT_EQUAL_INT(1, hal.send(hal.context, &right, 1));
    TEST_ASSERT_EQUAL_HEX8(0x02, model.requested_together);
    TEST_ASSERT_EQUAL_INT(0, hal.send(hal.context, &right, 1));
}

static void arrive_in_0(void) {
    arrive(0x102);
}

static void arrive_in_1(void) {
    arrive(0x101); // Buffer 0 is being read, so it is still full.
    model.at_status = arrive_in_0;
}

TEST(test_mcp2515_frames_keep_the_order_of_the_bus) {
    arrive(0x100);
    arrive(0x101);
    interrupt();
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, 0x101, IW_CAN_RECEIVED, 0);
    model.during_read = arrive_in_1;
    arrive(0x100);
    interrupt();
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, 0x101, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, 0x102, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
    arrive(0x100);
    arrive(0x101);
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, 0x101, IW_CAN_RECEIVED, 0);
}

TEST(test_mcp2515_receive_marks_remote_and_extended_frames) {
    iw_can_frame_t frame;
    arrive(0x100);
    model.receive[0][1] |= 0x10U;
    expect_frame(&hal, 0x100U | IW_CAN_REMOTE, IW_CAN_RECEIVED, 0);
    arrive(0x100);
    model.receive[0][1] |= 0x0AU; // Extended, bit 17 of the id.
    model.receive[0][3] = 0x34U;
    model.receive[0][4] = 0x4FU; // Remote, and a length of 15.
    TEST_ASSERT_EQUAL_INT(1, hal.receive(hal.context, &frame));
    TEST_ASSERT_EQUAL_HEX32((0x100U << 18) | (2U << 16) | 0x34U | IW_CAN_EXTENDED | IW_CAN_REMOTE, frame.id);
    TEST_ASSERT_EQUAL_UINT8(8, frame.dlc);
}

TEST(test_mcp2515_lost_frames_are_reported_once) {
    arrive(0x100);
    arrive(0x101);
    arrive(0x102);
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, 0x101, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
    for (uint32_t i = 0; i < HAL_MCP2515_RING + 1U; i++) {
        arrive(0x100);
        interrupt();
    }
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0);
}

TEST(test_mcp2515_purge_removes_every_frame_and_echo) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    arrive(0x100);
    acknowledge(2);
    interrupt();
    acknowledge(1); // Sent during the purge.
    TEST_ASSERT_EQUAL_INT(1, hal.purge(hal.context));
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 11));
    TEST_ASSERT_EQUAL_INT(1, hal.purge(hal.context));
    TEST_ASSERT_EQUAL_HEX8(0, status());
}

TEST(test_mcp2515_purge_with_a_frame_on_the_bus_is_limited) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    model.on_bus = 2;
    model.transfers = 0;
    TEST_ASSERT_EQUAL_INT(0, hal.purge(hal.context));
    TEST_ASSERT_LESS_THAN_UINT32(200, model.transfers);
    acknowledge(2);
    expect_frame(&hal, LEFT, IW_CAN_ECHO, 10); // It was not purged.
    expect_none(&hal);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 11));
}

TEST(test_mcp2515_bus_off_resets_the_chip_and_is_reported) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    arrive(0x100);
    interrupt();
    model.reg[EFLG] = 0x20U;
    interrupt();
    TEST_ASSERT_EQUAL_UINT32(2, model.resets);
    TEST_ASSERT_EQUAL_INT(-1, send_pair(&hal, 11));
    expect_state(&hal, IW_BUS_OFF);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_HEX8(CONFIG, model.reg[CANCTRL]); // Not before 2 ms.
    join();
    expect_state(&hal, IW_BUS_ACTIVE);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 12));
    model.reg[EFLG] = 0x10U;
    expect_state(&hal, IW_BUS_PASSIVE);
}

TEST(test_mcp2515_reset_of_the_chip_is_a_loss) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    reset();
    expect_state(&hal, IW_BUS_DOWN);
    TEST_ASSERT_EQUAL_INT(-1, send_pair(&hal, 10));
    join();
    expect_state(&hal, IW_BUS_ACTIVE);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
}

TEST(test_mcp2515_time_continues_when_the_counter_wraps) {
    model.now_us = UINT32_MAX;
    TEST_ASSERT_EQUAL_UINT64(UINT32_MAX, hal_mcp2515_time_us(&self));
    model.now_us = 9;
    TEST_ASSERT_EQUAL_UINT64((iw_time_us_t)UINT32_MAX + 10U, hal_mcp2515_time_us(&self));
}

/// The wheels acknowledge the setpoint in this buffer and follow it immediately. Returns their speed.
static int16_t follow(uint32_t buffer, iw_side_t side, int16_t speed_mm_s) {
    iw_codec_wheel_t values[IW_SIDES] = {{.speed = {.speed_rpm = (int16_t)(speed_mm_s / 20)}}};
    iw_can_frame_t frame;
    if ((model.reg[CONTROL(buffer)] & TXREQ) != 0U) {
        const uint8_t *const bytes = model.transmit[buffer];
        frame = (iw_can_frame_t){.id = id_of(bytes), .dlc = bytes[4]};
        memcpy(frame.data, &bytes[5], IW_CAN_DATA_MAX);
        TEST_ASSERT_EQUAL_INT(IW_CODEC_SETPOINT, iw_codec_decode(&frame, values));
        speed_mm_s = values[side].setpoint.speed_mm_s;
        acknowledge(buffer);
        values[0].speed.speed_rpm = (int16_t)(speed_mm_s / 20);
    }
    const uint8_t into = model.reg[CANINTF] & 1U;
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_codec_encode(IW_CODEC_SPEED, side, &values[0], &frame));
    arrive(frame.id);
    model.receive[into][4] = frame.dlc;
    memcpy(&model.receive[into][5], frame.data, IW_CAN_DATA_MAX);
    return speed_mm_s;
}

/// The wheels are online from `from_ms` on.
static void run_first_drive(bool restarted, uint32_t from_ms, uint32_t until_ms) {
    static iw_gateway_t gateway;
    const iw_bus_facts_t facts = {.echo_proven = true};
    int16_t speed_mm_s[IW_SIDES] = {0};
    int16_t fastest_mm_s = 0;
    iw_refusal_t refused = IW_REFUSE_NONE;
    TEST_ASSERT_TRUE(first_drive_init(&gateway, &hal, hal_mcp2515_time_us(&self), restarted));
    iw_gateway_bus_facts(&gateway, &facts);
    for (uint32_t ms = 0; ms < until_ms; ms++) {
        model.now_us += 1000;
        if (ms == from_ms) {
            TEST_ASSERT_EQUAL_INT((from_ms > 0U) ? IW_REFUSE_WHEEL_LOST : IW_REFUSE_NONE, refused);
        }
        if (ms >= from_ms) {
            speed_mm_s[IW_LEFT] = follow(2, IW_LEFT, speed_mm_s[IW_LEFT]);
            speed_mm_s[IW_RIGHT] = follow(1, IW_RIGHT, speed_mm_s[IW_RIGHT]);
        }
        fastest_mm_s = (speed_mm_s[IW_LEFT] > fastest_mm_s) ? speed_mm_s[IW_LEFT] : fastest_mm_s;
        interrupt();
        refused = first_drive_command(&gateway, hal_mcp2515_time_us(&self));
        (void)iw_gateway_step(&gateway, hal_mcp2515_time_us(&self));
    }
    TEST_ASSERT_EQUAL_INT(200, fastest_mm_s);
    TEST_ASSERT_EQUAL_INT(0, speed_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_gateway_state(&gateway));
}

TEST(test_mcp2515_first_drive_arms_drives_and_stops) {
    run_first_drive(false, 0, 4000);
}

/// The sketch cannot know whether the reset came in motion, so the zeros come first.
TEST(test_mcp2515_first_drive_after_a_reset_drives_and_stops) {
    run_first_drive(true, 0, 6000);
}

TEST(test_mcp2515_first_drive_waits_for_the_wheels) {
    run_first_drive(false, 3000, 8000);
}
