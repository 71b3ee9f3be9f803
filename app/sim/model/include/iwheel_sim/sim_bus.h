// SPDX-License-Identifier: MIT
/// A CAN bus at 1 Mbit/s with adapters that behave like real ones.
///
/// Each port is a node with a queue: the frame in its controller, then those behind it. When the bus is free the ports'
/// first frames arbitrate, the lowest id wins, and the bus is busy for the frame's bits (with stuff bits at their
/// average). A frame that ended has been on the bus: that is when everybody hears it and the sender gets its echo.
///
/// A frame that nobody acknowledges stays in its controller and is retried for ever; those behind it wait. That is how
/// old setpoints come out when power returns. Simplifications: the retries take no bus time, and only ports that
/// `sim_bus_open` was told need an acknowledgement wait for it: wheels acknowledge each other and the gateway's
/// controller acknowledges them.
///
/// Pure: no I/O, no clock, no heap. Times must not go back.
#ifndef IWHEEL_SIM_BUS_H
#define IWHEEL_SIM_BUS_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#define SIM_BUS_PORTS 24U
/// The longest queue of a port.
#define SIM_BUS_QUEUE_MAX 64U
/// No port.
#define SIM_BUS_NONE UINT8_MAX

typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t submitted_us;
} sim_queued_t;

typedef struct {
    sim_queued_t queue[SIM_BUS_QUEUE_MAX];
    uint32_t sent;      ///< Frames that were on the bus.
    uint32_t overflows; ///< Frames that found the queue full and were lost.
    uint8_t first;
    uint8_t count;
    uint8_t depth; ///< Frames the port holds, controller included; 0: the port is not open.
    bool needs_ack;
} sim_port_t;

typedef struct {
    sim_port_t port[SIM_BUS_PORTS];
    iw_time_us_t free_us; ///< The next frame begins no sooner.
    iw_time_us_t done_us; ///< When the frame on the bus ends.
    uint32_t waiting;     ///< Bit n: port n has something queued.
    uint64_t busy_us;     ///< Time taken by frames so far, for the load.
    uint8_t sending;      ///< Port whose frame is on the bus, or SIM_BUS_NONE.
    bool acknowledged;    ///< Somebody is there to acknowledge.
    bool stalled;         ///< Fault: the bus takes no frame.
} sim_bus_t;

/// A frame that has been on the bus.
typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t end_us;
    uint8_t port; ///< Who sent it.
} sim_delivery_t;

/// No port open, nobody there to acknowledge.
void sim_bus_init(sim_bus_t *self, iw_time_us_t now_us);

/// Opens a port for a queue of `depth` frames, 1..SIM_BUS_QUEUE_MAX.
void sim_bus_open(sim_bus_t *self, uint8_t port, uint8_t depth, bool needs_ack);

/// Forgets what is queued; a frame being sent is aborted.
void sim_bus_clear(sim_bus_t *self, iw_time_us_t now_us, uint8_t port);

/// Queues a frame. False: the queue is full, the frame is lost and counted.
bool sim_bus_submit(sim_bus_t *self, iw_time_us_t now_us, uint8_t port, const iw_can_frame_t *frame);

/// Whether somebody acknowledges, and whether the bus takes frames, from now on.
void sim_bus_acknowledge(sim_bus_t *self, iw_time_us_t now_us, bool acknowledged);
void sim_bus_stall(sim_bus_t *self, iw_time_us_t now_us, bool stalled);

/// True with the oldest frame that has ended by `now_us`. Call until false.
bool sim_bus_step(sim_bus_t *self, iw_time_us_t now_us, sim_delivery_t *out_delivery);

/// When `step` has something to do next; IW_NEVER if nothing is queued that the bus would take.
iw_time_us_t sim_bus_next_us(const sim_bus_t *self);

/// Bits of the frame on the bus, intermission included: at 1 Mbit/s also microseconds.
uint32_t sim_bus_frame_bits(const iw_can_frame_t *frame);

#endif
