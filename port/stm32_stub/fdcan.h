// SPDX-License-Identifier: MIT
/// Bus of the HAL on FDCAN: send, receive, bus_state, purge. See iwheel/hal.h for their contracts; the context is the
/// `brd_fdcan_t`. The behaviour is that of bxcan.h: the same tests judge both drivers. can.h shows the differences.
///
///     STARTING --CCE--> JOINING --11 recessive bits--> RUNNING --bus-off--> RECOVERING --CCE--> REJOINING
///                                                         ^------- 129 x 11 recessive bits --------+
///
/// Each call of `bus_state` does the next step if the hardware is ready for it, and never waits. CCE resets the state
/// of all transmit buffers (M_CAN 3.1.1), and the driver joins no bus without it. So no frame from before a loss of the
/// bus can reach the bus after it.
///
/// **Echo.** TXBTO of a buffer is the echo: the controller sets it only after another node has acknowledged the frame.
/// A frame replaces a waiting frame with the same id: `send` cancels that buffer alone (TXBCR) and waits for the end of
/// the cancellation, which is the end of the frame if it is on the bus. Replaced frames and their echoes are handled as
/// in bxcan.h: at most two frames can wait for one echo.
///
/// **Pair.** One write of TXBAR requests both buffers. Either both frames are requested or none.
///
/// **FD.** The controller is in classic mode (CCCR.FDOE is 0) and `send` refuses an FD frame. An FD frame of another
/// node causes a protocol exception: the controller waits for the end of that frame and does not destroy it (CCCR.PXHD
/// is 0). The driver counts the exceptions and reports them like losses, because the frame cannot be received.
///
/// **Losses.** The driver counts each frame that finds the controller's FIFO or the ring full. The FIFO retains the
/// older frames. Before the next frames `receive` returns one report: a frame with the id IW_CAN_ERROR.
///
/// Instances share no state, but a reset of one controller resets all of them: the chip has one bit for all. The main
/// loop calls all functions except the handler.
#ifndef BRD_FDCAN_H
#define BRD_FDCAN_H

#include "fdcan_registers.h"
#include "frame_ring.h"
#include "iwheel/hal.h"

typedef struct {
    brd_fdcan_registers_t *registers; ///< Registers of the device; its clock runs and its pins are set.
    brd_fdcan_ram_t *ram;             ///< Message RAM of the device.
    uint32_t bit_timing;              ///< NBTP: BRD_BIT_BTR of bit_rate.h.
    uint32_t poll_limit;              ///< Number of register reads that takes longer than the longest frame, 160 us.
    bool silent;                      ///< The controller does not acknowledge, and `send` always fails.
    brd_register_t *reset_register;   ///< Register of the RCC that resets the device, used if an abort does not end.
    uint32_t reset_bits;              ///< Bits to set in it.
} brd_fdcan_config_t;

typedef enum {
    BRD_FDCAN_STARTING = 0, ///< Initialisation is requested.
    BRD_FDCAN_JOINING,      ///< Configured; waits for 11 recessive bits.
    BRD_FDCAN_RUNNING,
    BRD_FDCAN_RECOVERING, ///< Bus-off; initialisation is requested.
    BRD_FDCAN_REJOINING,  ///< Bus-off; waits for 129 times 11 recessive bits.
} brd_fdcan_phase_t;

/// Number of echoes that one buffer can owe. The core never has more than two frames with one id on their way.
#define BRD_FDCAN_ECHOES 2U

/// Echoes due at the completion of a buffer: those of the replaced frames, then that of the frame in the buffer.
typedef struct {
    iw_can_frame_t frame[BRD_FDCAN_ECHOES];
    uint8_t owed;      ///< Number of echoes; 0: the buffer is free.
    bool is_requested; ///< The transmission was requested; before that the buffer's flags are those of an older frame.
} brd_fdcan_outgoing_t;

typedef struct {
    brd_fdcan_config_t config;
    brd_frame_ring_t ring;
    /// Shared with the handler. Its interrupt is masked while other functions write this member.
    brd_fdcan_outgoing_t outgoing[BRD_FDCAN_BUFFERS];
    brd_fdcan_phase_t phase;
    volatile uint32_t overruns; ///< Number of times that a frame arrived while the controller's FIFO was full.
    volatile uint32_t lost;     ///< Frames and echoes that were lost because the ring was full.
    uint32_t exceptions;        ///< Protocol exceptions: FD frames of other nodes.
    uint32_t losses_reported;   ///< Losses and exceptions that `brd_fdcan_receive` has reported.
    uint32_t bus_offs;          ///< Bus-offs since the start.
    uint32_t resets;            ///< Resets of the controller by this driver since the start.
    uint8_t epoch;              ///< Counts purges: echoes from before a purge are not delivered.
} brd_fdcan_t;

/// Requests initialisation. It does not wait; `bus_state` does the configuration.
void brd_fdcan_init(brd_fdcan_t *self, const brd_fdcan_config_t *config);

/// Returns > 0: so many frames are in buffers, and one write has requested them. Returns 0: no buffer is free for the
/// first frame, or two frames with its id are waiting. Returns < 0: the bus is off, the phase is not RUNNING, silent
/// mode is on, or one frame is not a classic data frame with an 11-bit id. For each frame that it replaces, it may wait
/// for the end of a frame on the bus (160 us).
int brd_fdcan_send(void *context, const iw_can_frame_t *frames, uint32_t count);
int brd_fdcan_receive(void *context, iw_can_frame_t *out_frame);
iw_bus_state_t brd_fdcan_bus_state(void *context);
/// Cancels all buffers and waits for the end of the cancellations, at most for `poll_limit` reads. Results as in
/// brd_bxcan_purge.
int brd_fdcan_purge(void *context);

/// Handler of interrupt line 0: completed transmissions, FIFO 0, and changes of the error state. The last ones only
/// wake the CPU.
void brd_fdcan_on_interrupt(brd_fdcan_t *self);

#endif
