// SPDX-License-Identifier: MIT
/// A model of STM32G4's FDCAN at the level of its registers and message RAM, written from RM0440 chapter 44 and the user's manual of
/// Bosch's M_CAN, not from any driver: initialisation and its protected registers, transmit queue with requests and cancellation, FIFO 0,
/// filters, error counters, bus-off, protocol exception, interrupts. It is used like bxcan_model.h, with the same functions.
///
/// Offsets from FDCAN_MODEL_RAM on are those of the message RAM.
///
/// Not modelled: FD frames as such, time stamps, timeouts, transmit events, FIFO 1, automatic retransmission off, line 1.
#ifndef FDCAN_MODEL_H
#define FDCAN_MODEL_H

#include "bxcan_model.h"

#define FDCAN_MODEL_RAM       0x400U
#define FDCAN_MODEL_RAM_WORDS 212U
#define FDCAN_MODEL_BUFFERS   3

typedef struct {
    uint32_t cccr, nbtp, ir, ie, ils, ile, rxgfc, xidam, txbc, txbto, txbcf, txbtie, txbcie, ckdiv;
    uint32_t ram[FDCAN_MODEL_RAM_WORDS];
    uint32_t lec, tec, rec;
    uint32_t pending;                      ///< A bit per buffer: TXBRP and TXBAR.
    uint32_t unnoticed;                    ///< Pending requests that the controller has not noticed: TXBAR.
    uint32_t cancelled;                    ///< Pending requests whose cancellation is requested.
    uint32_t on_bus;                       ///< Pending request that is being transmitted.
    uint32_t delayed[FDCAN_MODEL_BUFFERS]; ///< Reads of TXBRP until a cancellation takes effect.
    uint32_t order[FDCAN_MODEL_BUFFERS];   ///< Requests are numbered, for the mode without a queue.
    uint32_t requests, put;
    uint32_t get, level; ///< Get index and fill level of FIFO 0.
    bool lost;           ///< A frame found FIFO 0 full.
    uint32_t held_bits, recessive_bits, recovered;
    bool joining, bus_off, passive, exception;
    bool deaf;            ///< Test: the controller does not answer requests of initialisation.
    uint32_t abort_reads; ///< Test: TXBRP must be read this often until a cancellation takes effect.
    uint32_t overruns;
    uint32_t violations;
    char violation[160];
} fdcan_model_t;

fdcan_model_t *fdcan_model_create(uint32_t banks);
void fdcan_model_destroy(fdcan_model_t *self);
/// As after a reset, which does not change the message RAM. `banks` has no meaning here.
void fdcan_model_reset(fdcan_model_t *self, uint32_t banks);
uint32_t fdcan_model_read(fdcan_model_t *self, uint32_t offset);
void fdcan_model_write(fdcan_model_t *self, uint32_t offset, uint32_t value);
bool fdcan_model_is_on(const fdcan_model_t *self);
void fdcan_model_recessive(fdcan_model_t *self, uint32_t bits);
void fdcan_model_dominant(fdcan_model_t *self);
void fdcan_model_hold(fdcan_model_t *self, uint32_t bits, bool transmitting);
int fdcan_model_offer(const fdcan_model_t *self, model_frame_t *out_frame);
void fdcan_model_begin(fdcan_model_t *self, int buffer);
void fdcan_model_end(fdcan_model_t *self, int buffer, model_end_t end);
bool fdcan_model_receive(fdcan_model_t *self, const model_frame_t *frame);
void fdcan_model_receive_error(fdcan_model_t *self);
/// Another node sends an FD frame. Returns true if the controller destroys it.
bool fdcan_model_receive_fd(fdcan_model_t *self);
/// Bit 0: interrupt line 0.
uint32_t fdcan_model_lines(const fdcan_model_t *self);
void fdcan_model_slow_aborts(fdcan_model_t *self, uint32_t reads);
uint32_t fdcan_model_overruns(const fdcan_model_t *self);
const char *fdcan_model_violation(const fdcan_model_t *self);

#endif
