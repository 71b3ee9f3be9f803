// SPDX-License-Identifier: MIT
/// The driver on two modelled controllers, with a bus between what the test plays and the model.
///
/// Interrupts are as rude as the hardware's: while a line is up and none is being served, one strikes right after any access to a
/// register.
#ifndef BXCAN_RIG_H
#define BXCAN_RIG_H

#include "bxcan.h"
#include "bxcan_model.h"

#define RIG_DEVICES 2

/// Fields of ESR.
#define RIG_ESR_LEC(value) (((value) >> 4) & 0x7U)   ///< Last error code.
#define RIG_ESR_TEC(value) (((value) >> 16) & 0xFFU) ///< Transmit error counter, lower 8 bits.
#define RIG_ESR_REC(value) (((value) >> 24) & 0xFFU) ///< Receive error counter.

typedef struct {
    bxcan_model_t model;
    brd_bxcan_registers_t window; ///< Only its address means something.
    brd_register_t reset;         ///< RCC's, with a bit for this device.
    brd_bxcan_t driver;
    bool mask_unread;    ///< Interrupts were masked, and IER was not read back yet: that write may still be under way.
    uint32_t interrupts; ///< Served so far.
    bool (*on_read)(uint32_t offset);  ///< Called after each read of this device; false: not again.
    void (*on_write)(uint32_t offset); ///< Called before each write that the driver makes outside its interrupts.
} rig_device_t;

extern rig_device_t rig[RIG_DEVICES];

/// Both models reset, both drivers poisoned and not initialised, no hook; device 0 holds the filters of both.
void rig_reset(void);

/// Initialises the driver of a device with valid settings; silent or not.
void rig_init(int device, bool silent);

/// Initialises the driver and brings it to RUNNING with a quiet bus. Fails the test if it does not get there.
void rig_start(int device);

/// Plays a whole frame with arbitration won and an acknowledgement. Returns true and writes the frame if the device had one to send.
bool rig_send_next(int device, model_frame_t *out_frame);

/// Another node sends a data frame with an 11-bit id.
bool rig_hear(int device, uint32_t id, uint8_t dlc);

/// A setpoint-like frame: `mark` is its first byte.
iw_can_frame_t rig_frame(uint32_t id, uint8_t mark);

/// Reads the error counters and the last error code.
uint32_t rig_read_esr(int device);

/// Fails the test if a model saw something that the manual forbids.
void rig_assert_no_violation(void);

#endif
