# SPDX-License-Identifier: MIT
"""A passive listener on a CAN interface, with the interface of the local bus's recorder (test/system/bus.py)."""

import socket
import struct
import threading

from bus import ERROR, EXTENDED, FRAME, SO_TIMESTAMPNS, Bus, realtime_ahead_ns
from judge_log import Frame

CAN_RAW_ERR_FILTER = 2  # Python does not know it
MSG_CONFIRM = 0x800  # the frame is our own
FD_FRAME = struct.Struct("=IBB2x64s")
SO_RCVBUFFORCE = 33  # nor this
FETCH_S = 0.2
CLOCKS_EVERY = 25  # fetches


def open_raw(interface, *ids):
    """A raw CAN socket that receives all frames, or only those ids."""
    sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    if ids:
        filters = b"".join(struct.pack("=II", can_id, 0x7FF | EXTENDED) for can_id in ids)
        sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)
    sock.bind((interface,))
    return sock


class CanBus(Bus):
    """Records with the kernel's time stamps, which use the wall clock: a test that steps this clock calls `before_step` first.

    Frames are fetched at intervals, or when a test reads `frames`: to wake up for each of them would cost more than
    gateway and wheels together. `exact`: virtual time, in which the two clocks do not drift.
    """

    carries_fd = True

    def __init__(self, interface, frames=None, exact=False, ids=()):
        # The constructor of the local bus's recorder is not called, because it connects to that bus.
        self.interface, self.exact = interface, exact
        self.socket = open_raw(interface, *ids)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1)
        self.socket.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, 0x1FFFFFFF)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 4 << 20)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.recorded = frames if frames is not None else []
        self.recorded_errors = []
        self.closed = False
        self.ahead_ns = realtime_ahead_ns()
        self.lock = threading.Lock()
        self.wake = threading.Event()
        self.thread = threading.Thread(target=self._fetch, daemon=True)
        self.thread.start()

    @property
    def frames(self):
        self._drain()
        return self.recorded

    @property
    def errors(self):
        self._drain()
        return self.recorded_errors

    def first_since(self, since_us):
        """The first frame: an hour can separate the stamps of two frames, if the wall clock was stepped between them."""
        return 0

    def before_step(self):
        """Call it before the wall clock is stepped: frames received until now have the old time. Afterwards call `after_step`."""
        self._drain()

    def after_step(self):
        self.ahead_ns = realtime_ahead_ns()

    def _take(self):
        """Reads one frame; False if there is none, or the interface is down or removed."""
        try:
            data, ancillary, message_flags, _ = self.socket.recvmsg(FRAME.size, 64, socket.MSG_DONTWAIT)
        except OSError:
            return False
        seconds, nanoseconds = struct.unpack("qq", ancillary[0][2])
        t_us = -(-(seconds * 1_000_000_000 + nanoseconds - self.ahead_ns) // 1000)  # rounded up: never before its cause
        can_id, length, _, _, payload = FRAME.unpack(data)
        frame = Frame(t_us, can_id, payload[:length], bool(message_flags & MSG_CONFIRM))
        (self.recorded_errors if can_id & ERROR else self.recorded).append(frame)
        return True

    def _drain(self):
        if not self.closed:
            with self.lock:
                while self._take() or self._take():
                    pass  # Twice, because one error, that the interface went down, may precede the frames.

    def _fetch(self):
        number = 0
        while not self.wake.wait(FETCH_S):
            number += 1
            if number % CLOCKS_EVERY == 0 and not self.exact:
                self.ahead_ns = realtime_ahead_ns()
            self._drain()

    def send_fd(self, can_id, data):
        """A CAN FD frame, from a socket that permits them."""
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sock:
            sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
            sock.bind((self.interface,))
            sock.send(FD_FRAME.pack(can_id, len(data), 0, data.ljust(64, b"\0")))

    def close(self):
        if not self.closed:
            self._drain()
            self.closed = True
            self.wake.set()
            self.thread.join(5)
            self.socket.close()
