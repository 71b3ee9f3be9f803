// SPDX-License-Identifier: MIT
/// Registers and message RAM of FDCAN, the bus controller of STM32G4: Bosch's M_CAN with a message RAM of fixed layout.
///
/// Names, offsets and bits are those of RM0440, chapter 44 (registers 44.4, message RAM 44.3). The behaviour of the
/// modes, buffers and counters is that of the M_CAN user's manual, which comments cite as "M_CAN 3.1" for its chapter 3
/// (functional description). Every gap is a `reserved` member, and assertions check the offsets.
#ifndef BRD_FDCAN_REGISTERS_H
#define BRD_FDCAN_REGISTERS_H

#include "register_access.h"

#include <assert.h>
#include <stddef.h>

typedef struct {
    brd_register_t CREL, ENDN;
    uint32_t reserved1;
    brd_register_t DBTP, TEST, RWD, CCCR, NBTP, TSCC, TSCV, TOCC, TOCV;
    uint32_t reserved2[4];
    brd_register_t ECR, PSR, TDCR;
    uint32_t reserved3;
    brd_register_t IR, IE, ILS, ILE;
    uint32_t reserved4[8];
    brd_register_t RXGFC, XIDAM, HPMS;
    uint32_t reserved5;
    brd_register_t RXF0S, RXF0A, RXF1S, RXF1A;
    uint32_t reserved6[8];
    brd_register_t TXBC, TXFQS, TXBRP, TXBAR, TXBCR, TXBTO, TXBCF, TXBTIE, TXBCIE, TXEFS, TXEFA;
    uint32_t reserved7[5];
    brd_register_t CKDIV; ///< Of the clock of all controllers; 0 after reset: not divided.
} brd_fdcan_registers_t;

static_assert(offsetof(brd_fdcan_registers_t, CCCR) == 0x18, "CCCR is at 0x18");
static_assert(offsetof(brd_fdcan_registers_t, NBTP) == 0x1C, "NBTP is at 0x1C");
static_assert(offsetof(brd_fdcan_registers_t, ECR) == 0x40, "ECR is at 0x40");
static_assert(offsetof(brd_fdcan_registers_t, IR) == 0x50, "IR is at 0x50");
static_assert(offsetof(brd_fdcan_registers_t, RXGFC) == 0x80, "RXGFC is at 0x80");
static_assert(offsetof(brd_fdcan_registers_t, RXF0S) == 0x90, "RXF0S is at 0x90");
static_assert(offsetof(brd_fdcan_registers_t, TXBC) == 0xC0, "TXBC is at 0xC0");
static_assert(offsetof(brd_fdcan_registers_t, CKDIV) == 0x100, "CKDIV is at 0x100");

#define BRD_FDCAN_BUFFERS 3U
#define BRD_FDCAN_DEPTH   3U ///< Of a receive FIFO.

/// Element of a receive FIFO or a transmit buffer (44.3): header, length, and space for the 64 bytes of an FD frame.
typedef struct {
    brd_register_t id, control, data[16];
} brd_fdcan_element_t;

/// Message RAM of one controller: 212 words, of which the layout cannot be changed (44.3). It contains anything after
/// power-on, and a reset of the controller does not change it.
typedef struct {
    brd_register_t standard_filter[28];
    brd_register_t extended_filter[8][2];
    brd_fdcan_element_t receive[2][BRD_FDCAN_DEPTH];
    brd_register_t event[3][2];
    brd_fdcan_element_t transmit[BRD_FDCAN_BUFFERS];
} brd_fdcan_ram_t;

static_assert(offsetof(brd_fdcan_ram_t, extended_filter) == 0x70, "after 28 filters of one word");
static_assert(offsetof(brd_fdcan_ram_t, receive) == 0xB0, "after 8 filters of two words");
static_assert(offsetof(brd_fdcan_ram_t, event) == 0x260, "after two FIFOs of three elements");
static_assert(offsetof(brd_fdcan_ram_t, transmit) == 0x278, "after the FIFO of events");
static_assert(sizeof(brd_fdcan_ram_t) == 0x350, "the next controller's RAM follows");

#define BRD_CCCR_INIT 0x00000001U ///< Initialisation. The controller sets it too, when it becomes bus-off.
#define BRD_CCCR_CCE  0x00000002U ///< Configuration enabled; only with INIT. Resets the state of FIFOs and buffers.
#define BRD_CCCR_MON  0x00000020U ///< Bus monitoring: no frames, acknowledgements or error flags are sent.

#define BRD_ECR_TEC 0x000000FFU ///< Transmit error counter.
#define BRD_ECR_REC 0x00007F00U ///< Receive error counter.

#define BRD_PSR_ACT 0x00000018U ///< 0: synchronising, that is before 11 recessive bits.
#define BRD_PSR_EP  0x00000020U ///< Error passive.
#define BRD_PSR_BO  0x00000080U ///< Bus-off.
#define BRD_PSR_PXE 0x00004000U ///< Protocol exception: an FD frame began. A read clears it.

#define BRD_IR_RF0N 0x00000001U ///< A frame was stored in FIFO 0. Writing 1 clears a flag of this register.
#define BRD_IR_RF0L 0x00000004U ///< A frame found FIFO 0 full.
#define BRD_IR_TC   0x00000080U ///< A transmission of a buffer of TXBTIE has completed.
#define BRD_IR_TCF  0x00000100U ///< A cancellation of a buffer of TXBCIE has finished.
#define BRD_IR_EP   0x00020000U ///< PSR.EP has changed.
#define BRD_IR_BO   0x00080000U ///< PSR.BO has changed.
#define BRD_ILE_0   0x00000001U ///< Enables interrupt line 0, which has all interrupts unless ILS selects another line.

#define BRD_RXGFC_REJECT 0x0000003CU ///< ANFE and ANFS: frames that no filter selects are rejected.
#define BRD_RXGFC_LSS    16U         ///< Position of the number of filters for 11-bit ids.
#define BRD_RXGFC_LSE    24U         ///< Position of the number of filters for 29-bit ids.

#define BRD_RXF0S_LEVEL     0x0000000FU ///< Number of waiting frames, 0..3.
#define BRD_RXF0S_GET_SHIFT 8U          ///< Position of the index of the oldest frame; two bits.

#define BRD_TXBC_QUEUE      0x01000000U ///< The lowest id is sent first.
#define BRD_TXFQS_PUT_SHIFT 16U         ///< Position of the index of a free buffer; two bits.

#define BRD_ELEMENT_XTD       0x40000000U ///< 29-bit id.
#define BRD_ELEMENT_RTR       0x20000000U ///< Remote frame.
#define BRD_ELEMENT_ID        0x1FFFFFFFU
#define BRD_ELEMENT_STD_SHIFT 18U
#define BRD_ELEMENT_FDF       0x00200000U ///< Of the second word: FD frame.
#define BRD_ELEMENT_DLC_SHIFT 16U

#endif
