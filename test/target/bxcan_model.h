// SPDX-License-Identifier: MIT
/// A model of bxCAN at the level of its registers, written from the reference manual (RM0008 chapter 24, RM0090 chapter 32), not from
/// any driver: modes and their handshakes, transmit mailboxes, receive FIFOs, filters, error counters, bus-off, interrupts.
///
/// On one side a program reads and writes registers by offset. On the other side the test plays the bus: it offers frames and
/// recessive time, and receives the frames of the mailboxes. The model records a violation for each access that the manual
/// forbids, and for each read of a meaningless value. Every verdict demands that there is no violation.
///
/// Not modelled: time stamps (TTCM), wake-up by bus (AWUM), loop-back, FIFO 1's interrupts, TSR.LOW.
#ifndef BXCAN_MODEL_H
#define BXCAN_MODEL_H

#include <stdbool.h>
#include <stdint.h>

#define MODEL_MAILBOXES 3
#define MODEL_FIFOS     2
#define MODEL_DEPTH     3
#define MODEL_BANKS     28
#define MODEL_NONE      (-1)

/// A classic frame on the bus.
typedef struct {
    uint32_t id; ///< 11 or 29 bits.
    uint8_t extended;
    uint8_t remote;
    uint8_t dlc;
    uint8_t data[8];
} model_frame_t;

/// How a transmission ended.
typedef enum { MODEL_SENT = 0, MODEL_LOST_ARBITRATION, MODEL_NO_ACKNOWLEDGEMENT, MODEL_BIT_ERROR } model_end_t;

typedef struct {
    uint32_t tir, tdtr, tdlr, tdhr;
    uint32_t order;   ///< Requests are numbered, for TXFP.
    bool pending;     ///< Requested, not yet completed.
    bool on_bus;      ///< Being transmitted.
    bool aborting;    ///< ABRQ was written while pending.
    uint32_t delayed; ///< Reads of TSR until an abort takes effect.
} model_mailbox_t;

typedef struct {
    uint32_t rir, rdtr, rdlr, rdhr;
} model_received_t;

typedef struct {
    model_received_t entry[MODEL_DEPTH];
    uint32_t count;
    uint32_t release_reads; ///< Reads of RFxR until the release under way takes effect; 0: none is.
    bool full, overrun;
} model_fifo_t;

typedef struct {
    uint32_t mcr, msr, tsr, ier, btr;
    uint32_t lec, tec, rec;
    uint32_t fmr, fm1r, fs1r, ffa1r, fa1r, bank[MODEL_BANKS][2];
    model_mailbox_t mailbox[MODEL_MAILBOXES];
    model_fifo_t fifo[MODEL_FIFOS];
    uint32_t requests;
    uint32_t held_bits;      ///< Dominant bits without a recessive one among them.
    uint32_t recessive_bits; ///< Unbroken run while joining.
    uint32_t recovered;      ///< Runs of 11 since bus-off recovery began.
    uint32_t banks;          ///< 14 or 28.
    bool joining;            ///< Initialisation left, 11 recessive bits not seen yet.
    bool bus_off;
    bool recovering;       ///< Bus-off, and software has entered and left initialisation.
    bool deaf;             ///< Test: the controller does not answer requests for a mode.
    uint32_t abort_reads;  ///< Test: TSR must be read this often until an abort takes effect.
    uint32_t release_slow; ///< Test: RFxR must be read this often until a release takes effect.
    uint32_t overruns;     ///< Frames that found their FIFO full.
    uint32_t violations;
    char violation[160]; ///< The first.
} bxcan_model_t;

/// For users that cannot see the structure.
bxcan_model_t *bxcan_model_create(uint32_t banks);
void bxcan_model_destroy(bxcan_model_t *self);

/// As after a reset. `banks`: 14 with one controller, 28 with two.
void bxcan_model_reset(bxcan_model_t *self, uint32_t banks);

uint32_t bxcan_model_read(bxcan_model_t *self, uint32_t offset);
void bxcan_model_write(bxcan_model_t *self, uint32_t offset, uint32_t value);

/// True if it takes part in the bus: neither initialising, sleeping, joining nor bus-off.
bool bxcan_model_is_on(const bxcan_model_t *self);

/// The bus was recessive for that many bits; a dominant bit breaks the run.
void bxcan_model_recessive(bxcan_model_t *self, uint32_t bits);
void bxcan_model_dominant(bxcan_model_t *self);

/// The bus is held dominant for that many bits; before, it was normal unless the test reported recessive bits. `transmitting`: it
/// began within a frame of this node.
void bxcan_model_hold(bxcan_model_t *self, uint32_t bits, bool transmitting);

/// The mailbox that it would send next, with its frame; MODEL_NONE: none, or it may not.
int bxcan_model_offer(const bxcan_model_t *self, model_frame_t *out_frame);

/// The frame of that mailbox begins, and ends.
void bxcan_model_begin(bxcan_model_t *self, int mailbox);
void bxcan_model_end(bxcan_model_t *self, int mailbox, model_end_t end);

/// Another node's frame came whole. True if it was acknowledged.
bool bxcan_model_receive(bxcan_model_t *self, const model_frame_t *frame);

/// Another node's frame was destroyed.
void bxcan_model_receive_error(bxcan_model_t *self);

/// Interrupt lines, as levels; `lines` has all three: bit 0 transmit, 1 FIFO 0, 2 status change and error.
bool bxcan_model_irq_transmit(const bxcan_model_t *self);
bool bxcan_model_irq_fifo0(const bxcan_model_t *self);
bool bxcan_model_irq_error(const bxcan_model_t *self);
uint32_t bxcan_model_lines(const bxcan_model_t *self);

/// Test: TSR must be read this often until an abort takes effect.
void bxcan_model_slow_aborts(bxcan_model_t *self, uint32_t reads);

/// Frames that found their FIFO full since the reset.
uint32_t bxcan_model_overruns(const bxcan_model_t *self);

/// The first violation, or an empty text.
const char *bxcan_model_violation(const bxcan_model_t *self);

#endif
