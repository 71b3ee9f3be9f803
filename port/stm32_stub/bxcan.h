// SPDX-License-Identifier: MIT
/// bxCAN as the HAL's bus: send, receive, bus_state, purge. See iwheel/hal.h for their contracts.
///
/// The completion of a mailbox is the echo: the controller reports it only after another node has acknowledged the frame.
/// Automatic recovery from bus-off is off, so that no loss of the bus goes unreported; `bus_state` recovers step by step.
#ifndef IW_STM32_BXCAN_H
#define IW_STM32_BXCAN_H

#include "iwheel/hal.h"

#define IW_BXCAN_MAILBOXES 3U

typedef struct {
    iw_can_frame_t sent[IW_BXCAN_MAILBOXES];
    bool awaiting[IW_BXCAN_MAILBOXES]; ///< Handed to the controller, echo not delivered yet.
    bool is_recovering;                ///< The loss was reported and recovery has been asked for.
} iw_bxcan_t;

/// Configures 1 Mbit/s at 62.5 % and leaves initialisation without waiting for the bus, which may be dead for ever: until it is
/// there `bus_state` says IW_BUS_DOWN. False if the controller does not answer.
bool iw_bxcan_init(iw_bxcan_t *self);

int iw_bxcan_send(void *context, const iw_can_frame_t *frame);
int iw_bxcan_receive(void *context, iw_can_frame_t *out_frame);
iw_bus_state_t iw_bxcan_bus_state(void *context);
int iw_bxcan_purge(void *context);

#endif
