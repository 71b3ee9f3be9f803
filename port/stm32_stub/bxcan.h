// SPDX-License-Identifier: MIT
/// Bus of the HAL on bxCAN: send, receive, bus_state, purge. See iwheel/hal.h for their contracts; the context is the
/// `brd_bxcan_t`.
///
///     STARTING --INAK--> JOINING --11 recessive bits--> RUNNING --bus-off--> RECOVERING --INAK--> REJOINING
///                                                          ^-------- 128 x 11 recessive bits ---------+
///
/// Each call of `bus_state` does the next step if the hardware is ready for it, and never waits. While the bus is held
/// dominant, the transceiver is missing or the controller does not answer, the phase stays the same and `bus_state`
/// returns IW_BUS_DOWN or IW_BUS_OFF. The driver continues when the cause is gone. The controller's automatic recovery
/// from bus-off is disabled, so that each loss of the bus is reported.
///
/// **Echo.** The completion of a mailbox is the echo: the controller reports it only after another node has
/// acknowledged the frame. A frame replaces a waiting frame with the same id: `send` aborts the old mailbox and waits
/// for the end of the abort first, because the controller sends equal ids in the order of the mailboxes, and the old
/// frame could leave last. The replaced frame never reaches the bus. When its successor does, `receive` returns one
/// echo for each of them, that of the older frame first, each with its own bytes. So the core gets a TX confirmation
/// for every frame that it passed, and none without an acknowledgement. At most two frames can wait for one echo;
/// `send` returns 0 for the next one.
///
/// **Filters** pass exactly the eleven ids of the iWheel in every format of classic CAN (the core counts remote and
/// 29-bit frames with such a number). A received setpoint is always that of another node, because bxCAN does not
/// receive its own frames.
///
/// **Losses.** The driver counts each frame that finds the controller's FIFO or the ring full. Before the next frames
/// `receive` returns one report of it: a frame with the id IW_CAN_ERROR, which the core counts as unknown. A lost echo
/// leads to IW_CAUSE_SEND_STALLED in the core.
///
/// Instances share no state. The handlers of one device must have equal priority. The main loop calls all other
/// functions.
#ifndef BRD_BXCAN_H
#define BRD_BXCAN_H

#include "bxcan_registers.h"
#include "frame_ring.h"
#include "iwheel/hal.h"

/// Number of filter banks in use, starting with `first_bank`.
#define BRD_BXCAN_BANKS 6U

typedef struct {
    brd_bxcan_registers_t *registers; ///< Registers of the device; its clock runs and its pins are set.
    brd_bxcan_registers_t *filters;   ///< Device that contains the filter banks: CAN1, also for CAN2.
    uint32_t first_bank;              ///< 0; for CAN2 the value of FMR.CAN2SB, which is 14 after reset.
    uint32_t bit_timing;              ///< BTR without mode bits: BRD_BIT_BTR of bit_rate.h.
    uint32_t poll_limit;              ///< Number of register reads that takes longer than the longest frame, 160 us.
    bool silent;                      ///< The controller does not acknowledge, and `send` always fails.
    brd_register_t *reset_register;   ///< Register of the RCC that resets the device, used if an abort does not end.
    uint32_t reset_bits;              ///< Bits to set in it; those of both if CAN2 is in use: CAN1 has its filters.
} brd_bxcan_config_t;

typedef enum {
    BRD_BXCAN_STARTING = 0, ///< Initialisation mode is requested.
    BRD_BXCAN_JOINING,      ///< Configured; waits for 11 recessive bits.
    BRD_BXCAN_RUNNING,
    BRD_BXCAN_RECOVERING, ///< Bus-off; initialisation mode is requested.
    BRD_BXCAN_REJOINING,  ///< Bus-off; waits for 128 times 11 recessive bits.
} brd_bxcan_phase_t;

/// Number of echoes that one mailbox can owe. The core never has more than two frames with one id on their way.
#define BRD_BXCAN_ECHOES 2U

/// Echoes due at the completion of a mailbox: those of the replaced frames, then that of the frame in the mailbox.
typedef struct {
    iw_can_frame_t frame[BRD_BXCAN_ECHOES];
    uint8_t owed; ///< Number of echoes; 0: the mailbox is free.
} brd_bxcan_outgoing_t;

typedef struct {
    brd_bxcan_config_t config;
    brd_frame_ring_t ring;
    /// Shared with `brd_bxcan_on_transmit`. Its interrupt is masked while other functions write this member.
    brd_bxcan_outgoing_t outgoing[BRD_BXCAN_MAILBOXES];
    brd_bxcan_phase_t phase;
    volatile uint32_t overruns; ///< Number of times that a frame arrived while the controller's FIFO was full.
    volatile uint32_t lost;     ///< Frames and echoes that were lost because the ring was full.
    uint32_t losses_reported;   ///< Losses of both kinds that `brd_bxcan_receive` has reported.
    uint32_t bus_offs;          ///< Bus-offs since the start.
    uint32_t resets;            ///< Resets of the controller by this driver since the start.
    uint8_t epoch;              ///< Counts purges: echoes from before a purge are not delivered.
} brd_bxcan_t;

/// Wakes the device from sleep and requests initialisation mode. It does not wait; `bus_state` does the configuration.
/// Two devices that share filter banks must both be initialised before either is RUNNING, because filters cannot change
/// while frames arrive.
void brd_bxcan_init(brd_bxcan_t *self, const brd_bxcan_config_t *config);

/// Returns > 0: so many frames are in mailboxes. Their transmissions are requested directly after each other when all
/// mailboxes are filled. Returns 0: no mailbox is free for the first frame, or two frames with its id are waiting.
/// Returns < 0: the bus is off, the phase is not RUNNING, silent mode is on, or one frame is not a data frame with an
/// 11-bit id. For each frame that it replaces, it may wait for the end of a frame on the bus (160 us).
int brd_bxcan_send(void *context, const iw_can_frame_t *frames, uint32_t count);
int brd_bxcan_receive(void *context, iw_can_frame_t *out_frame);
iw_bus_state_t brd_bxcan_bus_state(void *context);
/// Aborts all mailboxes and waits for the end of the aborts, at most for `poll_limit` reads. Returns > 0 if nothing is
/// left in the controller. `receive` then returns no echo of an earlier frame, not even of one that was sent during the
/// call. If an abort does not end, the driver resets the controller: it returns > 0 too, and `bus_state` reports a loss
/// of the bus. Returns 0 only while off the bus. The controller then joins the bus only after all frames are aborted.
int brd_bxcan_purge(void *context);

/// Handlers of the device's interrupts: transmit, FIFO 0, and status change and error. The last one only clears its
/// flag, because its interrupt only has to wake the CPU.
void brd_bxcan_on_transmit(brd_bxcan_t *self);
void brd_bxcan_on_receive(brd_bxcan_t *self);
void brd_bxcan_on_error(brd_bxcan_t *self);

#endif
