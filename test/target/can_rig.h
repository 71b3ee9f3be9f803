// SPDX-License-Identifier: MIT
/// A driver on two modelled controllers, with a bus between the test and the model. The same tests judge the drivers of bxCAN and of
/// FDCAN (IWHEEL_RIG_FDCAN), so this file names both alike.
///
/// After each test, no model may have seen something that the manual forbids.
///
/// Interrupts are as rude as those of the hardware: while a line is up and no handler runs, an interrupt strikes right after any access to
/// a register.
#ifndef CAN_RIG_H
#define CAN_RIG_H

#ifdef IWHEEL_RIG_FDCAN
#include "fdcan.h"
#include "fdcan_model.h"

typedef brd_fdcan_t can_driver_t;
typedef fdcan_model_t can_model_t;
#define can_init                   brd_fdcan_init
#define can_send                   brd_fdcan_send
#define can_receive                brd_fdcan_receive
#define can_bus_state              brd_fdcan_bus_state
#define can_purge                  brd_fdcan_purge
#define can_model_reset            fdcan_model_reset
#define can_model_read             fdcan_model_read
#define can_model_write            fdcan_model_write
#define can_model_is_on            fdcan_model_is_on
#define can_model_recessive        fdcan_model_recessive
#define can_model_dominant         fdcan_model_dominant
#define can_model_hold             fdcan_model_hold
#define can_model_offer            fdcan_model_offer
#define can_model_begin            fdcan_model_begin
#define can_model_end              fdcan_model_end
#define can_model_receive          fdcan_model_receive
#define can_model_receive_error    fdcan_model_receive_error
#define can_model_violation        fdcan_model_violation
#define can_model_irq_error(model) (fdcan_model_lines(model) != 0U)
#define RIG_MASK_REGISTER          0x54U ///< IE, with the bits that mask the completions.
#define RIG_MASK_BITS              0x180U
#define RIG_POLL_REGISTER          0xC8U ///< TXBRP, which the driver polls for the end of a cancellation.
#define RIG_MODE_REGISTER          0x18U ///< CCCR: initialisation requested, and the value while running.
#define RIG_MODE_INIT              0x1U
#define RIG_MODE_RUNNING           0x0U
#define RIG_TIMING_REGISTER        0x1CU
#define RIG_TIMING                 0x3A00301DU
#define RIG_IS_REQUEST(offset)     ((offset) == 0xCCU)
#define RIG_IS_BUFFER(offset)      ((offset) >= 0x678U)
#define RIG_REQUESTS               1U ///< Writes that request a pair.
#define RIG_REJOIN_BITS            (129U * 11U)
#define RIG_IS_PENDING(model, i)   ((((model)->pending >> (i)) & 1U) != 0U)
#define RIG_IS_ON_BUS(model, i)    ((((model)->on_bus >> (i)) & 1U) != 0U)
#define RIG_ID_OF(model, i)        (((model)->ram[158U + 18U * (uint32_t)(i)] & 0x1FFFFFFFU) >> 18)
#else
#include "bxcan.h"
#include "bxcan_model.h"

typedef brd_bxcan_t can_driver_t;
typedef bxcan_model_t can_model_t;
#define can_init                   brd_bxcan_init
#define can_send                   brd_bxcan_send
#define can_receive                brd_bxcan_receive
#define can_bus_state              brd_bxcan_bus_state
#define can_purge                  brd_bxcan_purge
#define can_model_reset            bxcan_model_reset
#define can_model_read             bxcan_model_read
#define can_model_write            bxcan_model_write
#define can_model_is_on            bxcan_model_is_on
#define can_model_recessive        bxcan_model_recessive
#define can_model_dominant         bxcan_model_dominant
#define can_model_hold             bxcan_model_hold
#define can_model_offer            bxcan_model_offer
#define can_model_begin            bxcan_model_begin
#define can_model_end              bxcan_model_end
#define can_model_receive          bxcan_model_receive
#define can_model_receive_error    bxcan_model_receive_error
#define can_model_violation        bxcan_model_violation
#define can_model_irq_error(model) bxcan_model_irq_error(model)
#define RIG_MASK_REGISTER          0x14U ///< IER
#define RIG_MASK_BITS              BRD_IER_TMEIE
#define RIG_POLL_REGISTER          0x08U ///< TSR
#define RIG_MODE_REGISTER          0x00U ///< MCR
#define RIG_MODE_INIT              0x00010001U
#define RIG_MODE_RUNNING           0x00010000U
#define RIG_TIMING_REGISTER        0x1CU
#define RIG_TIMING                 0x03590001U
#define RIG_IS_REQUEST(offset)     (((offset)&0x18FU) == 0x180U)
#define RIG_IS_BUFFER(offset)      ((offset) >= 0x180U && (offset) < 0x1B0U)
#define RIG_REQUESTS               2U
#define RIG_REJOIN_BITS            (128U * 11U)
#define RIG_IS_PENDING(model, i)   ((model)->mailbox[i].pending)
#define RIG_IS_ON_BUS(model, i)    ((model)->mailbox[i].on_bus)
#define RIG_ID_OF(model, i)        ((model)->mailbox[i].tir >> 21)
#endif

#define RIG_DEVICES 2

typedef struct {
    can_model_t model;
#ifdef IWHEEL_RIG_FDCAN
    brd_fdcan_registers_t window; ///< Only their addresses mean something.
    brd_fdcan_ram_t ram;
#else
    brd_bxcan_registers_t window; ///< Only its address means something.
#endif
    brd_register_t reset; ///< RCC's, with a bit for this device.
    can_driver_t driver;
    bool
        mask_unread; ///< Interrupts were masked, and the register was not read back yet: that write may still be under way.
    uint32_t interrupts;               ///< Served so far.
    bool (*on_read)(uint32_t offset);  ///< Called after each read of this device; false: not again.
    void (*on_write)(uint32_t offset); ///< Called before each write that the driver makes outside its interrupts.
} rig_device_t;

extern rig_device_t rig[RIG_DEVICES];

/// Those of device 0, the only one in most tests.
static can_driver_t *const driver = &rig[0].driver;
static can_model_t *const model = &rig[0].model;

/// Both models reset, both drivers poisoned and not initialised, no hook; bxCAN: device 0 holds the filters of both.
void rig_reset(void);

/// Initialises the driver of a device with valid settings; silent or not.
void rig_init(int device, bool silent);

/// Initialises the driver and brings it to RUNNING with a quiet bus. Fails the test if it does not get there.
void rig_start(int device);

/// The driver is asked for its state, and the bus is quiet. Fails the test if the device does not take part in the bus then.
void rig_assert_joins(int device);

/// The bus is recessive for that many bits. Fails the test if the device does not take part in the bus then.
void rig_assert_active_after(int device, uint32_t bits);

/// Plays one attempt to send the next frame, and serves no interrupt. Returns true and writes the frame if the device had one to send.
bool rig_attempt_next(int device, model_end_t end, model_frame_t *out_frame);

/// Plays a whole frame with arbitration won and an acknowledgement. Returns true and writes the frame if the device had one to send.
bool rig_send_next(int device, model_frame_t *out_frame);

/// Another node sends a data frame with an 11-bit id.
bool rig_hear(int device, uint32_t id, uint8_t dlc);

/// Serves the interrupts that wait.
void rig_serve(int device);

/// A setpoint-like frame: `mark` is its first byte.
iw_can_frame_t rig_frame(uint32_t id, uint8_t mark);

/// Gives such a frame to the driver of device 0, and returns the driver's result.
int rig_send(uint32_t id, uint8_t mark);

/// Device 0 sends its next frame, and it is this one.
void rig_assert_on_bus(uint32_t id, uint8_t mark);

/// Device 0 has no frame to send.
void rig_assert_nothing_waits(void);

/// The next frame that driver 0 delivers is the echo of this one, or there is no next frame.
void rig_assert_echo(uint32_t id, uint8_t mark);
void rig_assert_no_echo(void);

/// Device 0 has no frame to send, and driver 0 delivers none.
void rig_assert_idle(void);

/// The next frame that driver 0 delivers reports that frames were lost.
void rig_assert_loss_reported(void);

/// Another node sends that many frames to device 0, and interrupts are served after the last one. Their first bytes count from 0.
void rig_hear_burst(uint32_t count);

/// Driver 0 delivers that many of these frames, the first ones, and no other frame.
void rig_assert_received(uint32_t count);

/// Read the error counters. The receive counter of FDCAN has no value beyond 128.
uint32_t rig_read_tec(int device);
uint32_t rig_read_rec(int device);

/// Fails the test if the last error code is another one. FDCAN: no check, because a read of it clears it.
void rig_assert_lec(int device, uint32_t code);

#endif
