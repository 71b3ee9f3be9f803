// SPDX-License-Identifier: MIT
#include "can_rig.h"

#include "unity.h"

#include <string.h>

#define STORM     100000
#define RESET_BIT 0x02000000U

rig_device_t rig[RIG_DEVICES];
static bool is_serving;

static bool is_inside(const brd_register_t *address, const void *window, size_t size, uint32_t *out_offset) {
    const uintptr_t base = (uintptr_t)window;
    const uintptr_t at = (uintptr_t)address;
    *out_offset = (uint32_t)(at - base);
    return at >= base && at < base + size;
}

static rig_device_t *device_at(const brd_register_t *address, uint32_t *out_offset) {
    for (int i = 0; i < RIG_DEVICES; i++) {
        if (is_inside(address, &rig[i].window, sizeof rig[i].window, out_offset)) {
            return &rig[i];
        }
#ifdef IWHEEL_RIG_FDCAN
        if (is_inside(address, &rig[i].ram, sizeof rig[i].ram, out_offset)) {
            *out_offset += FDCAN_MODEL_RAM;
            return &rig[i];
        }
#endif
    }
    TEST_FAIL_MESSAGE("an address was accessed that is no register");
    return NULL;
}

/// Returns false if no interrupt waits.
static bool serve_one(rig_device_t *device) {
#ifdef IWHEEL_RIG_FDCAN
    if (fdcan_model_lines(&device->model) == 0U) {
        return false;
    }
    brd_fdcan_on_interrupt(&device->driver);
#else
    if (bxcan_model_irq_transmit(&device->model)) {
        brd_bxcan_on_transmit(&device->driver);
    } else if (bxcan_model_irq_fifo0(&device->model)) {
        brd_bxcan_on_receive(&device->driver);
    } else if (bxcan_model_irq_error(&device->model)) {
        brd_bxcan_on_error(&device->driver);
    } else {
        return false;
    }
#endif
    return true;
}

static void serve(rig_device_t *device) {
    if (is_serving) {
        return;
    }
    is_serving = true;
    for (int storm = 0; serve_one(device); storm++) {
        device->interrupts++;
        TEST_ASSERT_TRUE_MESSAGE(storm < STORM, "an interrupt never ends");
    }
    is_serving = false;
}

/// Returns the device of this reset register of RCC: while its bit is set, the device is in reset.
static rig_device_t *reset_at(const brd_register_t *address) {
    for (int i = 0; i < RIG_DEVICES; i++) {
        if (address == &rig[i].reset) {
            return &rig[i];
        }
    }
    return NULL;
}

uint32_t brd_register_read(const brd_register_t *address) {
    uint32_t offset = 0;
    if (reset_at(address) != NULL) {
        return *address;
    }
    rig_device_t *const device = device_at(address, &offset);
    TEST_ASSERT_TRUE_MESSAGE(is_serving || !device->mask_unread || offset == RIG_MASK_REGISTER,
                             "the mask was not read back");
    device->mask_unread = device->mask_unread && is_serving;
    const uint32_t value = can_model_read(&device->model, offset);
    if (device->on_read != NULL && !is_serving && !device->on_read(offset)) {
        device->on_read = NULL;
    }
    serve(device);
    return value;
}

void brd_register_write(brd_register_t *address, uint32_t value) {
    uint32_t offset = 0;
    rig_device_t *const resetting = reset_at(address);
    if (resetting != NULL) {
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, value & ~RESET_BIT, "another device was reset too");
        *address = value;
        can_model_reset(&resetting->model, 28);
        resetting->mask_unread = false;
        return;
    }
    rig_device_t *const device = device_at(address, &offset);
    TEST_ASSERT_TRUE_MESSAGE(is_serving || !device->mask_unread, "the mask was not read back");
    device->mask_unread = !is_serving && offset == RIG_MASK_REGISTER && (value & RIG_MASK_BITS) == 0U;
    if (device->on_write != NULL && !is_serving) {
        device->on_write(offset);
    }
    can_model_write(&device->model, offset, value);
    serve(device);
}

void rig_reset(void) {
    is_serving = false;
    for (int i = 0; i < RIG_DEVICES; i++) {
        memset(&rig[i], 0xA5, sizeof rig[i]);
        rig[i].on_read = NULL;
        rig[i].on_write = NULL;
        rig[i].reset = 0;
        rig[i].mask_unread = false;
        rig[i].interrupts = 0;
        can_model_reset(&rig[i].model, 28);
    }
}

void rig_init(int device, bool silent) {
#ifdef IWHEEL_RIG_FDCAN
    const brd_fdcan_config_t config = {
        .registers = &rig[device].window,
        .ram = &rig[device].ram,
#else
    const brd_bxcan_config_t config = {
        .registers = &rig[device].window,
        .filters = &rig[0].window,
        .first_bank = (device == 0) ? 0U : 14U,
#endif
        .bit_timing = RIG_TIMING,
        .poll_limit = 1000,
        .silent = silent,
        .reset_register = &rig[device].reset,
        .reset_bits = RESET_BIT,
    };
    can_init(&rig[device].driver, &config);
}

void rig_start(int device) {
    rig_init(device, false);
    rig_assert_joins(device);
}

void rig_assert_joins(int device) {
    (void)can_bus_state(&rig[device].driver);
    rig_assert_active_after(device, 11);
}

void rig_assert_active_after(int device, uint32_t bits) {
    can_model_recessive(&rig[device].model, bits);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, can_bus_state(&rig[device].driver));
}

bool rig_attempt_next(int device, model_end_t end, model_frame_t *out_frame) {
    can_model_t *const its = &rig[device].model;
    const int mailbox = can_model_offer(its, out_frame);
    if (mailbox == MODEL_NONE) {
        return false;
    }
    can_model_begin(its, mailbox);
    can_model_end(its, mailbox, end);
    return true;
}

bool rig_send_next(int device, model_frame_t *out_frame) {
    const bool was_sent = rig_attempt_next(device, MODEL_SENT, out_frame);
    if (was_sent) {
        serve(&rig[device]);
    }
    return was_sent;
}

void rig_serve(int device) {
    serve(&rig[device]);
}

#ifdef IWHEEL_RIG_FDCAN
uint32_t rig_read_tec(int device) {
    return brd_register_read(&rig[device].window.ECR) & BRD_ECR_TEC;
}

uint32_t rig_read_rec(int device) {
    const uint32_t ecr = brd_register_read(&rig[device].window.ECR);
    return ((ecr & 0x8000U) != 0U) ? 128U : (ecr & BRD_ECR_REC) >> 8;
}

void rig_assert_lec(int device, uint32_t code) {
    (void)device;
    (void)code;
}
#else
uint32_t rig_read_tec(int device) {
    return brd_register_read(&rig[device].window.ESR) >> 16 & 0xFFU;
}

uint32_t rig_read_rec(int device) {
    return brd_register_read(&rig[device].window.ESR) >> 24 & 0xFFU;
}

void rig_assert_lec(int device, uint32_t code) {
    TEST_ASSERT_EQUAL(code, brd_register_read(&rig[device].window.ESR) >> 4 & 7U);
}
#endif

bool rig_hear(int device, uint32_t id, uint8_t dlc) {
    const model_frame_t frame = {.id = id, .dlc = dlc, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
    const bool acknowledged = can_model_receive(&rig[device].model, &frame);
    serve(&rig[device]);
    return acknowledged;
}

iw_can_frame_t rig_frame(uint32_t id, uint8_t mark) {
    return (iw_can_frame_t){.id = id, .dlc = 5, .data = {mark, 0x11, 0x22, 0x33, 0x44}};
}

int rig_send(uint32_t id, uint8_t mark) {
    const iw_can_frame_t frame = rig_frame(id, mark);
    return can_send(driver, &frame, 1);
}

void rig_assert_on_bus(uint32_t id, uint8_t mark) {
    model_frame_t frame;
    TEST_ASSERT_TRUE_MESSAGE(rig_send_next(0, &frame), "nothing waits to be sent");
    TEST_ASSERT_EQUAL(id, frame.id);
    TEST_ASSERT_EQUAL(mark, frame.data[0]);
}

void rig_assert_nothing_waits(void) {
    model_frame_t frame;
    TEST_ASSERT_FALSE(rig_send_next(0, &frame));
}

void rig_assert_idle(void) {
    rig_assert_nothing_waits();
    rig_assert_no_echo();
}

void rig_assert_echo(uint32_t id, uint8_t mark) {
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL_MESSAGE(1, can_receive(driver, &echo), "no echo");
    TEST_ASSERT_EQUAL(IW_CAN_ECHO, echo.kind);
    TEST_ASSERT_EQUAL(id, echo.id);
    TEST_ASSERT_EQUAL(mark, echo.data[0]);
}

void rig_assert_no_echo(void) {
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL(0, can_receive(driver, &echo));
}

void rig_assert_loss_reported(void) {
    iw_can_frame_t received;
    memset(&received, 0xA5, sizeof received);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
    TEST_ASSERT_EQUAL_HEX32(IW_CAN_ERROR, received.id);
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, received.kind);
    TEST_ASSERT_EQUAL(0, received.dlc);
}

void rig_hear_burst(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        const model_frame_t frame = {.id = 256, .dlc = 1, .data = {(uint8_t)i}};
        (void)can_model_receive(model, &frame);
    }
    serve(&rig[0]);
}

void rig_assert_received(uint32_t count) {
    iw_can_frame_t received;
    for (uint32_t i = 0; i < count; i++) {
        TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
        TEST_ASSERT_EQUAL(256, received.id);
        TEST_ASSERT_EQUAL(i, received.data[0]);
    }
    TEST_ASSERT_EQUAL(0, can_receive(driver, &received));
}

void tearDown(void) {
    for (int i = 0; i < RIG_DEVICES; i++) {
        TEST_ASSERT_EQUAL_STRING("", can_model_violation(&rig[i].model));
    }
}
