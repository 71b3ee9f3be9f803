// SPDX-License-Identifier: MIT
/// Registers of bxCAN, the bus controller of STM32F0, F1, F2, F3, F4, F7 and L4.
///
/// Names, offsets and bits are those of the reference manuals: chapter 24 of RM0008 (STM32F1), 32 of RM0090
/// (STM32F405/407), 30 of RM0390 (STM32F446). The sections within the chapter are the same; comments in this port cite
/// them as "bxCAN 7.4" for 24.7.4. Every gap is a `reserved` member, and assertions check the offsets, so that a
/// missing one does not compile.
#ifndef BRD_BXCAN_REGISTERS_H
#define BRD_BXCAN_REGISTERS_H

#include "register_access.h"

#include <assert.h>
#include <stddef.h>

/// Transmit mailbox: bxCAN 9.3.
typedef struct {
    brd_register_t TIR, TDTR, TDLR, TDHR;
} brd_bxcan_mailbox_t;

/// Output of a receive FIFO: bxCAN 9.3.
typedef struct {
    brd_register_t RIR, RDTR, RDLR, RDHR;
} brd_bxcan_fifo_t;

typedef struct {
    brd_register_t MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR; ///< Control and status: bxCAN 9.2.
    uint32_t reserved1[88];
    brd_bxcan_mailbox_t tx[3];
    brd_bxcan_fifo_t rx[2];
    uint32_t reserved2[12];
    brd_register_t FMR, FM1R; ///< Filters: bxCAN 9.4. Only the first of two controllers has them, for both.
    uint32_t reserved3;
    brd_register_t FS1R;
    uint32_t reserved4;
    brd_register_t FFA1R;
    uint32_t reserved5;
    brd_register_t FA1R;
    uint32_t reserved6[8];
    brd_register_t filter[28][2]; ///< Only 14 of them exist if there is one controller.
} brd_bxcan_registers_t;

static_assert(offsetof(brd_bxcan_registers_t, tx) == 0x180, "TI0R is at 0x180");
static_assert(offsetof(brd_bxcan_registers_t, rx) == 0x1B0, "RI0R is at 0x1B0");
static_assert(offsetof(brd_bxcan_registers_t, FMR) == 0x200, "FMR is at 0x200");
static_assert(offsetof(brd_bxcan_registers_t, FS1R) == 0x20C, "FS1R is at 0x20C");
static_assert(offsetof(brd_bxcan_registers_t, FFA1R) == 0x214, "FFA1R is at 0x214");
static_assert(offsetof(brd_bxcan_registers_t, FA1R) == 0x21C, "FA1R is at 0x21C");
static_assert(offsetof(brd_bxcan_registers_t, filter) == 0x240, "F0R1 is at 0x240");

#define BRD_BXCAN_MAILBOXES 3U

#define BRD_MCR_INRQ 0x00000001U ///< Requests initialisation mode; MSR.INAK confirms it.
#define BRD_MCR_DBF  0x00010000U ///< Stops the controller with the CPU in a debugger. Set after reset, and left set.

#define BRD_MSR_INAK 0x00000001U ///< In initialisation mode, or still waiting for 11 recessive bits after it.
#define BRD_MSR_SLAK 0x00000002U ///< In sleep mode, which is the mode after reset.
#define BRD_MSR_ERRI 0x00000004U ///< An enabled error condition has occurred. Writing 1 clears it.

#define BRD_TSR_RQCP(mailbox)                                                                                          \
    (UINT32_C(0x01) << (8U * (mailbox))) ///< Request completed: sent or aborted. Writing 1 clears it.
#define BRD_TSR_TXOK(mailbox)                                                                                          \
    (UINT32_C(0x02) << (8U * (mailbox))) ///< The frame was sent and acknowledged. Cleared with RQCP.
#define BRD_TSR_ABRQ(mailbox)                                                                                          \
    (UINT32_C(0x80) << (8U * (mailbox))) ///< Writing 1 requests an abort. Set until the mailbox is empty.
#define BRD_TSR_TME(mailbox) (UINT32_C(0x04000000) << (mailbox)) ///< Mailbox empty.

#define BRD_RF0R_FMP0  0x00000003U ///< Number of waiting frames, 0..3.
#define BRD_RF0R_FOVR0 0x00000010U ///< A frame arrived while three were waiting. Writing 1 clears it.
#define BRD_RF0R_RFOM0 0x00000020U ///< Writing 1 releases the oldest frame. Set until this is done.

#define BRD_IER_TMEIE  0x00000001U ///< Interrupt when RQCP is set.
#define BRD_IER_FMPIE0 0x00000002U ///< Interrupt while FIFO 0 is not empty.
#define BRD_IER_EPVIE  0x00000200U ///< Error passive sets MSR.ERRI.
#define BRD_IER_BOFIE  0x00000400U ///< Bus-off sets MSR.ERRI.
#define BRD_IER_ERRIE  0x00008000U ///< MSR.ERRI raises an interrupt.

#define BRD_ESR_EPVF 0x00000002U ///< Error passive.
#define BRD_ESR_BOFF 0x00000004U ///< Bus-off.

#define BRD_BTR_SILM 0x80000000U ///< Silent mode: no frames, acknowledgements or error flags are sent.

#define BRD_TIR_TXRQ      0x00000001U ///< Writing 1 requests the transmission.
#define BRD_IR_RTR        0x00000002U ///< Remote frame.
#define BRD_IR_IDE        0x00000004U ///< 29-bit id.
#define BRD_IR_STID_SHIFT 21U
#define BRD_IR_EXID_SHIFT 3U
#define BRD_DTR_DLC       0x0000000FU

#define BRD_FMR_FINIT 0x00000001U ///< Filter initialisation: neither controller receives frames.

#endif
