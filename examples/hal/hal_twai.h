// SPDX-License-Identifier: MIT
/// @file
/// HAL of the core on the TWAI controller of an ESP32, ESP32-S2, S3 or C3, with ESP-IDF's driver `driver/twai.h`.
///
/// The project tests this file on a PC with headers that only declare what it uses, and a model of the driver
/// (test/examples). It was not compiled with ESP-IDF, and did not run on a chip: test it on your board first
/// (docs/developer/porting.md, section 5).
///
/// **Driver.** ESP-IDF 5.5 and newer call this driver deprecated. The new one (`esp_twai.h`) is not used: it cannot
/// purge, because its `twai_node_enable` sends again the frame that `twai_node_disable` has interrupted.
///
/// **Time limit.** No function waits: every timeout is 0 ticks. Call them all from one task. Give it the highest
/// priority of its core: between the two requests of a pair only an interrupt can then run.
///
/// **Echo.** Each frame is sent with self-reception in normal mode, so the controller receives it after another node
/// has acknowledged it. Received frames and echoes are in one queue, in the order of the bus. A setpoint that has the
/// bytes of a waiting one counts as its echo. If another master sent it, the own frame follows and counts as foreign.
///
/// **Purge.** `twai_stop` ends a transmission immediately and empties the queue; `twai_start` also drops received
/// frames, so `receive` then reports a loss. A frame that was on the bus is cut off: the other nodes see an error.
///
/// **Full.** The controller has one buffer and the driver's queue has one place. `send` accepts a pair only if both are
/// free. Until they are, or until `purge`, an older setpoint waits before the new one.
///
/// **Bus-off.** The driver stays off the bus until `bus_state` starts the recovery, so no loss is too short to see.
/// `bus_state` reports it in at least one call, after it has dropped all frames.
///
/// **Time stamps.** The driver has none. A frame has the time of the step that reads it.
///
/// **Bit timing.** 1 Mbit/s at 62.5 % needs 8 quanta, and the prescaler must be even: 80 MHz / 10 can do it. Chips that
/// clock TWAI with 40 MHz (ESP32-C6, H2) cannot: `hal_twai_start` returns false.
#ifndef HAL_TWAI_H
#define HAL_TWAI_H

#include "driver/gpio.h"
#include "iwheel/hal.h"

#include <stdatomic.h>

typedef struct {
    gpio_num_t tx;    ///< To the transceiver.
    gpio_num_t rx;    ///< From the transceiver.
    gpio_num_t estop; ///< Contact to ground, closed while released: a broken wire counts as pressed.
} hal_twai_pins_t;

#define HAL_TWAI_WAITING 4U ///< Frames whose echo can be recognised; the controller and its driver hold two.

typedef struct {
    hal_twai_pins_t pins;
    iw_can_frame_t waiting[HAL_TWAI_WAITING]; ///< Accepted frames without echo, the oldest first.
    uint32_t waits;
    uint32_t losses;       ///< Frames that the driver has lost since the start.
    bool has_lost;         ///< `receive` must report a loss.
    atomic_bool estop_set; ///< An edge of the e-stop since the last reading.
} hal_twai_t;

/// Configures pins and controller and joins the bus. Returns false if the driver refuses one of the settings.
bool hal_twai_start(hal_twai_t *self, const hal_twai_pins_t *pins);

/// Returns the functions for `iw_gateway_init`.
iw_hal_t hal_twai(hal_twai_t *self);

/// Returns the time for the core, since the start of the chip.
iw_time_us_t hal_twai_time_us(void);

#endif
