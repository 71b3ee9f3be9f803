// SPDX-License-Identifier: MIT
#include "bxcan.h"
#include "board.h"
#include "iwheel/bit_timing.h"
#include "registers.h"

#define POLLS_MAX 20000U // More than the longest frame; a running transmission is not aborted before its end.

IW_STATIC_ASSERT(IW_STM32_APB1_HZ % (8U * IW_BUS_BITRATE_HZ) == 0U, sample_point_is_exact);

static uint32_t completed(uint32_t mailbox) {
    return 1U << (8U * mailbox); // RQCPx; TXOKx is the next bit, ABRQx the seventh after it.
}

bool iw_bxcan_init(iw_bxcan_t *self) {
    const iw_bit_timing_limits_t limits = IW_BIT_TIMING_BXCAN;
    const iw_bit_timing_achieved_t wanted = {IW_BUS_BITRATE_HZ, IW_BUS_SAMPLE_POINT_PERMILLE};
    iw_bit_timing_t timing = {0, 0, 0};
    *self = (iw_bxcan_t){0};
    if (iw_bit_timing_solve(&limits, IW_STM32_APB1_HZ, &wanted, &timing) != IW_OK) {
        return false;
    }
    IW_STM32_RCC->APB1ENR |= 1U << 25;
    IW_STM32_CAN->MCR = 1U; // INRQ, not SLEEP.
    uint32_t poll = 0;
    while ((IW_STM32_CAN->MSR & 1U) == 0U && poll < POLLS_MAX) {
        poll++;
    }
    if (poll == POLLS_MAX) {
        return false;
    }
    IW_STM32_CAN->BTR = ((timing.tseg2 - 1UL) << 20) | ((timing.tseg1 - 1UL) << 16) | (timing.prescaler - 1UL);
    IW_STM32_CAN->FMR |= 1U; // Bank 0: every frame into FIFO 0.
    IW_STM32_CAN->FA1R = 0;
    IW_STM32_CAN->FM1R = 0;
    IW_STM32_CAN->FS1R = 1U;
    IW_STM32_CAN->FFA1R = 0;
    IW_STM32_CAN->filter[0][0] = 0;
    IW_STM32_CAN->filter[0][1] = 0;
    IW_STM32_CAN->FA1R = 1U;
    IW_STM32_CAN->FMR &= ~1U;
    IW_STM32_CAN->MCR = 1U << 2; // TXFP: left before right. INRQ cleared.
    return true;
}

static uint32_t word_of(const uint8_t *bytes) {
    return bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static void bytes_of(uint32_t word, uint8_t *out_bytes) {
    for (uint32_t i = 0; i < 4U; i++) {
        out_bytes[i] = (uint8_t)(word >> (8U * i));
    }
}

int iw_bxcan_send(void *context, const iw_can_frame_t *frame) {
    iw_bxcan_t *const self = context;
    if (((IW_STM32_CAN->MSR | IW_STM32_CAN->MCR) & 1U) != 0U) {
        return -1;
    }
    for (uint32_t i = 0; i < IW_BXCAN_MAILBOXES; i++) {
        iw_stm32_can_mailbox_t *const mailbox = &IW_STM32_CAN->tx[i];
        if (!self->awaiting[i] && (IW_STM32_CAN->TSR & (1UL << (26U + i))) != 0U) {
            self->sent[i] = *frame;
            self->awaiting[i] = true;
            mailbox->TDTR = frame->dlc;
            mailbox->TDLR = word_of(&frame->data[0]);
            mailbox->TDHR = word_of(&frame->data[4]);
            mailbox->TIR = ((frame->id & IW_CAN_ID_MASK) << 21) | 1U;
            return 1;
        }
    }
    return 0;
}

static bool take_echo(iw_bxcan_t *self, iw_can_frame_t *out_frame) {
    for (uint32_t i = 0; i < IW_BXCAN_MAILBOXES; i++) {
        const uint32_t status = IW_STM32_CAN->TSR;
        if (self->awaiting[i] && (status & completed(i)) != 0U) {
            self->awaiting[i] = false;
            IW_STM32_CAN->TSR = completed(i);
            if ((status & (completed(i) << 1)) != 0U) {
                *out_frame = self->sent[i];
                out_frame->kind = IW_CAN_ECHO;
                return true;
            }
        }
    }
    return false;
}

int iw_bxcan_receive(void *context, iw_can_frame_t *out_frame) {
    if (take_echo(context, out_frame)) {
        return 1;
    }
    if ((IW_STM32_CAN->RF0R & 3U) == 0U) {
        return 0;
    }
    const iw_stm32_can_fifo_t *const fifo = &IW_STM32_CAN->rx[0];
    const uint32_t id = fifo->RIR;
    const uint32_t dlc = fifo->RDTR & 0xFU;
    out_frame->id = ((id & 4U) != 0U) ? ((id >> 3) | IW_CAN_EXTENDED) : (id >> 21);
    out_frame->id |= ((id & 2U) != 0U) ? IW_CAN_REMOTE : 0U;
    out_frame->dlc = (uint8_t)((dlc > IW_CAN_DATA_MAX) ? IW_CAN_DATA_MAX : dlc);
    out_frame->kind = IW_CAN_RECEIVED;
    bytes_of(fifo->RDLR, &out_frame->data[0]);
    bytes_of(fifo->RDHR, &out_frame->data[4]);
    IW_STM32_CAN->RF0R = 1U << 5;
    return 1;
}

iw_bus_state_t iw_bxcan_bus_state(void *context) {
    iw_bxcan_t *const self = context;
    const uint32_t errors = IW_STM32_CAN->ESR;
    if ((IW_STM32_CAN->MSR & 1U) != 0U) {
        IW_STM32_CAN->MCR &= ~1U; // Left as soon as the bus has been recessive for 11 bits.
        return self->is_recovering ? IW_BUS_OFF : IW_BUS_DOWN;
    }
    if ((errors & 4U) != 0U) {
        if (!self->is_recovering) {
            self->is_recovering = true;
            (void)iw_bxcan_purge(self);
            IW_STM32_CAN->MCR |= 1U;
        }
        return IW_BUS_OFF;
    }
    self->is_recovering = false;
    return ((errors & 2U) != 0U) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
}

int iw_bxcan_purge(void *context) {
    iw_bxcan_t *const self = context;
    const uint32_t all_empty = 7UL << 26;
    IW_STM32_CAN->TSR = (1U << 7) | (1U << 15) | (1U << 23);
    uint32_t poll = 0;
    while ((IW_STM32_CAN->TSR & all_empty) != all_empty && poll < POLLS_MAX) {
        poll++;
    }
    for (uint32_t i = 0; i < IW_BXCAN_MAILBOXES; i++) {
        const bool is_on_bus = (IW_STM32_CAN->TSR & (completed(i) << 1)) != 0U;
        self->awaiting[i] = self->awaiting[i] && (is_on_bus || poll == POLLS_MAX);
    }
    return (poll < POLLS_MAX) ? 1 : 0;
}
