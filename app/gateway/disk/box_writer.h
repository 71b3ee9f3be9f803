// SPDX-License-Identifier: MIT
/// The process that writes the black box to disk: waits for orders, writes each as a recording of three files
///
///     stop-000017-wheel_lost.log     the frames, in candump's log form
///     stop-000017-wheel_lost.jsonl   the stop, and everything else that went into the core, one JSON object per line
///     stop-000017-wheel_lost.conf    the configuration in force
///
/// and tells the result. Slow, full and missing disks are its own affair.
#ifndef GATEWAY_BOX_WRITER_H
#define GATEWAY_BOX_WRITER_H

#include "recording.h"

#include "blackbox_ring.h"

/// Runs until the gateway is gone; then, if setpoints were being sent, writes a last recording. `fd` is the socket to the
/// gateway.
void gw_box_writer_run(int fd, const blackbox_ring_t *ring, const gw_box_wish_t *wish);

#endif
