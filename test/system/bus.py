# SPDX-License-Identifier: MIT
"""A passive listener on the local bus: records every frame with the kernel's time stamp, and can send frames as a node of its own."""

import bisect
import contextlib
import socket
import struct
import threading
import time

from judge_log import Frame, signed

FRAME = struct.Struct("=IBBB x8s")  # struct can_frame: id, length, pad, res0 (1: echo of our own frame, 2: error frame of a client), data
SO_TIMESTAMPNS = 35
ORDERED_US = 1_000_000  # Frames are in the order of their stamps, except for small steps between the clocks.
EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000


def now_us():
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000


def realtime_ahead_ns():
    """CLOCK_REALTIME minus CLOCK_MONOTONIC, by the least interrupted of several readings."""
    readings = []
    for _ in range(10):
        before, real, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        readings.append((after - before, real - before))
        if after - before < 20_000:
            break
    return min(readings)[1]


class Bus:
    """The kernel sets the stamp when the hub sends the frame, so this process may be slow without harm."""

    carries_fd = False

    def __init__(self, path, frames=None):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.socket.connect(path)
        self.frames = frames if frames is not None else []
        self.errors = []
        self.closed = False
        self.thread = threading.Thread(target=self._record, daemon=True)
        self.thread.start()

    def _record(self):
        ahead_us = 0
        for number in range(1 << 62):
            try:
                data, ancillary, _, _ = self.socket.recvmsg(FRAME.size, 64)
            except OSError:
                break
            if not data:
                break
            if number % 4096 == 0:
                ahead_us = realtime_ahead_ns() // 1000
            stamp = struct.unpack("qq", ancillary[0][2]) if ancillary else None
            t_us = stamp[0] * 1_000_000 + stamp[1] // 1000 - ahead_us if stamp else now_us()
            can_id, length, _, echo, payload = FRAME.unpack(data)
            frame = Frame(t_us, can_id, payload[:length], echo == 1)
            (self.errors if can_id & ERROR else self.frames).append(frame)
        self.closed = True

    def send(self, can_id, data=b"", length=None):
        self.socket.send(FRAME.pack(can_id, len(data) if length is None else length, 0, 0, data.ljust(8, b"\0")))

    def first_since(self, since_us):
        """Index before which no frame is that new."""
        return bisect.bisect_left(self.frames, since_us - ORDERED_US, key=lambda frame: frame.t_us)

    def setpoints(self, since_us=0):
        """The gateway's setpoints as (t_us, id, mm/s)."""
        frames = self.frames
        return [
            (f.t_us, f.id, signed(f.data, 1))
            for f in frames[self.first_since(since_us) :]
            if f.id in (266, 298) and not f.own and f.t_us >= since_us and len(f.data) >= 3
        ]

    def speed_rpm(self, side):
        """The wheel's last speed frame."""
        wanted = 256 + 32 * side
        return next((signed(f.data, 0) for f in reversed(self.frames) if f.id == wanted and not f.own), None)

    def close(self):
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)
        self.thread.join(2)
        self.socket.close()
