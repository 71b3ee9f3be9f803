// SPDX-License-Identifier: MIT
/// CAN bus at 1 Mbit/s with adapters that behave like real ones.
///
/// Each port is a node with a queue: the frame in its controller, then the frames behind it. When the bus is free, the
/// first frames of the ports arbitrate. The lowest id wins, and the bus is busy for the bits of that frame (with an
/// average number of stuff bits). When the frame ends, every node receives it and the sender gets its echo.
///
/// A frame without acknowledgement stays in its controller and is repeated without end; the frames behind it wait. This
/// is how old setpoints reach the bus when power returns. Simplifications: repetitions need no bus time, and only ports
/// that `sim_bus_open` opened with `needs_ack` wait for an acknowledgement. Wheels acknowledge each other, and the
/// gateway's controller acknowledges the wheels.
///
/// Pure: no I/O, no clock, no heap. Times must not go back.
#ifndef IWHEEL_SIM_BUS_H
#define IWHEEL_SIM_BUS_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#define SIM_BUS_PORTS 24U
/// Maximum length of the queue of a port.
#define SIM_BUS_QUEUE_MAX 64U
/// Number that means: no port.
#define SIM_BUS_NONE UINT8_MAX

typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t submitted_us;
} sim_queued_t;

typedef struct {
    sim_queued_t queue[SIM_BUS_QUEUE_MAX];
    uint32_t sent;      ///< Frames that were on the bus.
    uint32_t overflows; ///< Frames that were lost because the queue was full.
    uint8_t first;
    uint8_t count;
    uint8_t depth; ///< Maximum number of frames in the port, controller included; 0: the port is not open.
    bool needs_ack;
} sim_port_t;

typedef struct {
    sim_port_t port[SIM_BUS_PORTS];
    iw_time_us_t free_us; ///< Earliest start of the next frame.
    iw_time_us_t done_us; ///< End of the frame on the bus.
    uint32_t waiting;     ///< Bit n: port n has a queued frame.
    uint64_t busy_us;     ///< Time that frames have used so far, for the load.
    uint8_t sending;      ///< Port whose frame is on the bus, or SIM_BUS_NONE.
    bool acknowledged;    ///< A node acknowledges.
    bool stalled;         ///< Fault: the bus transfers no frame.
} sim_bus_t;

/// A frame that was on the bus.
typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t end_us;
    uint8_t port; ///< Port of the sender.
} sim_delivery_t;

/// Initialises a bus without open ports and without a node that acknowledges.
void sim_bus_init(sim_bus_t *self, iw_time_us_t now_us);

/// Opens a port with a queue of `depth` frames, 1..SIM_BUS_QUEUE_MAX.
void sim_bus_open(sim_bus_t *self, uint8_t port, uint8_t depth, bool needs_ack);

/// Empties the queue of the port. A frame that is being sent is aborted.
void sim_bus_clear(sim_bus_t *self, iw_time_us_t now_us, uint8_t port);

/// Queues a frame. Returns false if the queue is full; then the frame is lost and counted.
bool sim_bus_submit(sim_bus_t *self, iw_time_us_t now_us, uint8_t port, const iw_can_frame_t *frame);

/// Set from `now_us` on whether a node acknowledges frames, and whether the bus is stalled.
void sim_bus_acknowledge(sim_bus_t *self, iw_time_us_t now_us, bool acknowledged);
void sim_bus_stall(sim_bus_t *self, iw_time_us_t now_us, bool stalled);

/// Returns true and writes the oldest frame that ended by `now_us` to `*out_delivery`; returns false if there is none.
/// Call it until it returns false.
bool sim_bus_step(sim_bus_t *self, iw_time_us_t now_us, sim_delivery_t *out_delivery);

/// Returns the time of the next action of `sim_bus_step`; IW_NEVER if no queued frame can be sent.
iw_time_us_t sim_bus_next_us(const sim_bus_t *self);

/// Returns the number of bits of the frame on the bus, intermission included. At 1 Mbit/s this is the time in
/// microseconds.
uint32_t sim_bus_frame_bits(const iw_can_frame_t *frame);

#endif
