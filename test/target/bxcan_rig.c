// SPDX-License-Identifier: MIT
#include "bxcan_rig.h"

#include "unity.h"

#include <string.h>

#define STORM     100000
#define IER       0x14U
#define RESET_BIT 0x02000000U

rig_device_t rig[RIG_DEVICES];
static bool is_serving;

static rig_device_t *device_at(const brd_register_t *address, uint32_t *out_offset) {
    for (int i = 0; i < RIG_DEVICES; i++) {
        const uintptr_t base = (uintptr_t)&rig[i].window;
        const uintptr_t at = (uintptr_t)address;
        if (at >= base && at < base + sizeof rig[i].window) {
            *out_offset = (uint32_t)(at - base);
            return &rig[i];
        }
    }
    TEST_FAIL_MESSAGE("an address was accessed that is no register");
    return NULL;
}

static void serve(rig_device_t *device) {
    if (is_serving) {
        return;
    }
    is_serving = true;
    for (int storm = 0;; storm++) {
        if (bxcan_model_irq_transmit(&device->model)) {
            brd_bxcan_on_transmit(&device->driver);
        } else if (bxcan_model_irq_fifo0(&device->model)) {
            brd_bxcan_on_receive(&device->driver);
        } else if (bxcan_model_irq_error(&device->model)) {
            brd_bxcan_on_error(&device->driver);
        } else {
            break;
        }
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
    TEST_ASSERT_TRUE_MESSAGE(is_serving || !device->mask_unread || offset == IER, "the mask was not read back");
    device->mask_unread = device->mask_unread && is_serving;
    const uint32_t value = bxcan_model_read(&device->model, offset);
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
        bxcan_model_reset(&resetting->model, 28);
        resetting->mask_unread = false;
        return;
    }
    rig_device_t *const device = device_at(address, &offset);
    TEST_ASSERT_TRUE_MESSAGE(is_serving || !device->mask_unread, "the mask was not read back");
    device->mask_unread = !is_serving && offset == IER && (value & BRD_IER_TMEIE) == 0U;
    if (device->on_write != NULL && !is_serving) {
        device->on_write(offset);
    }
    bxcan_model_write(&device->model, offset, value);
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
        bxcan_model_reset(&rig[i].model, 28);
    }
}

void rig_init(int device, bool silent) {
    const brd_bxcan_config_t config = {
        .registers = &rig[device].window,
        .filters = &rig[0].window,
        .first_bank = (device == 0) ? 0U : 14U,
        .bit_timing = 0x03590001U,
        .poll_limit = 1000,
        .silent = silent,
        .reset_register = &rig[device].reset,
        .reset_bits = RESET_BIT,
    };
    brd_bxcan_init(&rig[device].driver, &config);
}

void rig_start(int device) {
    rig_init(device, false);
    (void)brd_bxcan_bus_state(&rig[device].driver);
    bxcan_model_recessive(&rig[device].model, 11);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, brd_bxcan_bus_state(&rig[device].driver));
}

bool rig_send_next(int device, model_frame_t *out_frame) {
    bxcan_model_t *const model = &rig[device].model;
    const int mailbox = bxcan_model_offer(model, out_frame);
    if (mailbox == MODEL_NONE) {
        return false;
    }
    bxcan_model_begin(model, mailbox);
    bxcan_model_end(model, mailbox, MODEL_SENT);
    serve(&rig[device]);
    return true;
}

uint32_t rig_read_esr(int device) {
    return brd_register_read(&rig[device].driver.config.registers->ESR);
}

bool rig_hear(int device, uint32_t id, uint8_t dlc) {
    const model_frame_t frame = {.id = id, .dlc = dlc, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
    const bool acknowledged = bxcan_model_receive(&rig[device].model, &frame);
    serve(&rig[device]);
    return acknowledged;
}

iw_can_frame_t rig_frame(uint32_t id, uint8_t mark) {
    return (iw_can_frame_t){.id = id, .dlc = 5, .data = {mark, 0x11, 0x22, 0x33, 0x44}};
}

void rig_assert_no_violation(void) {
    for (int i = 0; i < RIG_DEVICES; i++) {
        TEST_ASSERT_EQUAL_STRING("", bxcan_model_violation(&rig[i].model));
    }
}
