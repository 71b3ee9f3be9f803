// SPDX-License-Identifier: MIT
/// Definitions that both halves of the model share: the bits of chapter 9, and the receive side.
#ifndef BXCAN_MODEL_PRIVATE_H
#define BXCAN_MODEL_PRIVATE_H

#include "bxcan_model.h"

#define MCR_INRQ  0x0001U
#define MCR_SLEEP 0x0002U
#define MCR_TXFP  0x0004U
#define MCR_RFLM  0x0008U
#define MCR_NART  0x0010U
#define MCR_ABOM  0x0040U
#define MCR_RESET 0x8000U
#define MSR_INAK  0x0001U
#define MSR_SLAK  0x0002U
#define MSR_ERRI  0x0004U
#define RFR_FULL  0x0008U
#define RFR_FOVR  0x0010U
#define RFR_RFOM  0x0020U
#define IER_EWGIE 0x0100U
#define IER_EPVIE 0x0200U
#define IER_BOFIE 0x0400U
#define IER_ERRIE 0x8000U
#define ESR_EPVF  0x0002U
#define ESR_BOFF  0x0004U
#define IR_RTR    0x0002U
#define IR_IDE    0x0004U
#define BTR_SILM  0x80000000U
#define TSR_RQCP  0x01U
#define TSR_TXOK  0x02U
#define TSR_ALST  0x04U
#define TSR_TERR  0x08U
#define TSR_ABRQ  0x80U
#define TSR_TME   0x04000000U

void model_violate(bxcan_model_t *self, const char *what, uint32_t offset);
void model_bytes_of(uint32_t low, uint32_t high, uint8_t *out_bytes);
/// The oldest frame leaves the FIFO.
void model_fifo_release(model_fifo_t *fifo);
/// After a change of the counters: bus-off, and the error interrupt's flag.
void model_note_errors(bxcan_model_t *self);
uint32_t model_filter_read(bxcan_model_t *self, uint32_t offset);
void model_filter_write(bxcan_model_t *self, uint32_t offset, uint32_t value);

#endif
