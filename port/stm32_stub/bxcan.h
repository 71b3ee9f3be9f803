// SPDX-License-Identifier: MIT
/// bxCAN as the HAL's bus: send, receive, bus_state, purge. See iwheel/hal.h for their contracts; the context is the
/// `brd_bxcan_t`.
///
///     STARTING --INAK--> JOINING --11 recessive bits--> RUNNING --bus-off--> RECOVERING --INAK--> REJOINING
///                                                          ^-------- 128 x 11 recessive bits ---------+
///
/// Each call of `bus_state` takes the step that the hardware is ready for and never waits: a bus held dominant, a
/// missing transceiver or a controller that does not answer leave it where it is (`bus_state` then says IW_BUS_DOWN or
/// IW_BUS_OFF), and it goes on when the cause is gone. Automatic recovery from bus-off is left off, so that no loss of
/// the bus goes unreported.
///
/// **Echo.** The completion of a mailbox is the echo: the controller reports it only after another node has
/// acknowledged the frame. A frame that is handed over while one with the same id waits takes its place: the old
/// mailbox is aborted and its end awaited first, since equal ids leave by mailbox number and the old one could come
/// last. The replaced frame never reaches the bus; when its successor does, one echo comes for each, the older one's
/// first and each with its own bytes: the core gets a TX confirmation for every frame it handed over, and none without
/// an acknowledgement. More than two frames that wait for one echo are not kept: `send` then says later.
///
/// **Filters** pass exactly the eleven ids of the iWheel in every format of classic CAN (remote and 29-bit frames with
/// such a number are counted by the core). Setpoints among them are always somebody else's: bxCAN does not receive what
/// it sends.
///
/// **Losses.** A frame that finds the controller's FIFO or the ring full is counted, and `receive` gives one report of
/// it before the next frames: a frame with the id IW_CAN_ERROR, which the core counts as unknown. A lost echo ends in
/// IW_CAUSE_SEND_STALLED by itself.
///
/// Instances share nothing. The handlers of one device must have equal priority; everything else is called from the
/// main loop.
#ifndef BRD_BXCAN_H
#define BRD_BXCAN_H

#include "bxcan_registers.h"
#include "frame_ring.h"
#include "iwheel/hal.h"

/// Filter banks in use, from `first_bank` on.
#define BRD_BXCAN_BANKS 6U

typedef struct {
    brd_bxcan_registers_t *registers; ///< Clocked, pins set.
    brd_bxcan_registers_t *filters;   ///< The device that holds the filter banks: of CAN1 and CAN2 always CAN1.
    uint32_t first_bank;              ///< 0; for CAN2 what FMR.CAN2SB says, 14 after reset.
    uint32_t bit_timing;              ///< BTR without mode bits: BRD_BIT_BTR of bit_rate.h.
    uint32_t poll_limit;              ///< Reads of a register that take longer than the longest frame, 160 us.
    bool silent;                      ///< Listen without acknowledging. `send` then always fails.
    brd_register_t *reset_register;   ///< RCC's that resets the device, used when an abort does not end ...
    uint32_t reset_bits; ///< ... and which bits. Where CAN2 is used too, both devices': CAN1 holds its filters.
} brd_bxcan_config_t;

typedef enum {
    BRD_BXCAN_STARTING = 0, ///< Initialisation mode was asked for.
    BRD_BXCAN_JOINING,      ///< Configured, waiting for 11 recessive bits.
    BRD_BXCAN_RUNNING,
    BRD_BXCAN_RECOVERING, ///< Bus-off, initialisation mode was asked for.
    BRD_BXCAN_REJOINING,  ///< Bus-off, waiting for 128 times 11 recessive bits.
} brd_bxcan_phase_t;

/// Echoes that one mailbox can owe. The core never has more than two frames of one id on their way.
#define BRD_BXCAN_ECHOES 2U

/// What a mailbox's completion must bring: the echoes of the frames that were replaced, then that of the frame in it.
typedef struct {
    iw_can_frame_t frame[BRD_BXCAN_ECHOES];
    uint8_t owed; ///< 0: it is free.
} brd_bxcan_outgoing_t;

typedef struct {
    brd_bxcan_config_t config;
    brd_frame_ring_t ring;
    /// Shared with `brd_bxcan_on_transmit`, whose interrupt is masked while others write it.
    brd_bxcan_outgoing_t outgoing[BRD_BXCAN_MAILBOXES];
    brd_bxcan_phase_t phase;
    volatile uint32_t overruns; ///< Times that a frame came while the controller's FIFO was full.
    volatile uint32_t lost;     ///< Frames and echoes that found the ring full.
    uint32_t losses_told;       ///< Of both, those that `brd_bxcan_receive` has reported.
    uint32_t bus_offs;          ///< Since the start.
    uint32_t resets;            ///< Of the controller by us, since the start.
    uint8_t epoch;              ///< Counts purges: echoes from before one are not delivered.
} brd_bxcan_t;

/// Takes the device out of sleep and asks for initialisation mode. Configuration follows in `bus_state`. Does not wait.
/// Two devices that share filter banks must both be initialised before either is RUNNING: filters cannot change while
/// frames come in.
void brd_bxcan_init(brd_bxcan_t *self, const brd_bxcan_config_t *config);

/// > 0: so many are in mailboxes, and requested right after each other once all of them are. 0: for the first one no
/// mailbox is free, or two frames of its id are waiting. < 0: not RUNNING, silent, or one is not a data frame with an
/// 11-bit id. May wait for the end of a frame on the bus (160 us) for each frame that it replaces.
int brd_bxcan_send(void *context, const iw_can_frame_t *frames, uint32_t count);
int brd_bxcan_receive(void *context, iw_can_frame_t *out_frame);
iw_bus_state_t brd_bxcan_bus_state(void *context);
/// Aborts all mailboxes and waits for their end, at most `poll_limit` reads. Echoes that were not delivered yet never
/// come, not that of a frame that got through meanwhile either. An abort that does not end resets the controller: > 0
/// too, since nothing is left in it, and `bus_state` tells a loss of the bus. 0 only while off the bus: it is joined
/// again only when all has been taken back.
int brd_bxcan_purge(void *context);

/// The device's interrupts: transmit, FIFO 0, and status change and error. The last only wakes the CPU.
void brd_bxcan_on_transmit(brd_bxcan_t *self);
void brd_bxcan_on_receive(brd_bxcan_t *self);
void brd_bxcan_on_error(brd_bxcan_t *self);

#endif
