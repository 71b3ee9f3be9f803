# SPDX-License-Identifier: MIT
"""A passive listener on a CAN interface, with the interface of the local bus's recorder (test/system/bus.py)."""

import socket
import struct
import threading

from bus import ERROR, EXTENDED, FRAME, SO_TIMESTAMPNS, Bus, now_us, realtime_ahead_us
from judge_log import Frame

CAN_RAW_ERR_FILTER = 2  # Python does not know it
MSG_CONFIRM = 0x800  # the frame is our own
FD_FRAME = struct.Struct("=IBB2x64s")
RECHECK_S = 0.2


def open_raw(interface, *ids):
    """A raw CAN socket that hears everything, or only those ids."""
    sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    if ids:
        filters = b"".join(struct.pack("=II", can_id, 0x7FF | EXTENDED) for can_id in ids)
        sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)
    sock.bind((interface,))
    return sock


class CanBus(Bus):
    """`exact`: the clock stands still while this thread works (virtual time), so the time of reading is the frame's.

    Otherwise the kernel's stamp counts, and stepping the wall clock spoils it.
    """

    def __init__(self, interface, frames=None, exact=False, ids=()):
        # The local bus's recorder is not asked to connect: everything that differs is here.
        self.interface, self.exact = interface, exact
        self.socket = open_raw(interface, *ids)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1)
        self.socket.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, 0x1FFFFFFF)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, int(RECHECK_S * 1e6)))
        self.frames = frames if frames is not None else []
        self.errors = []
        self.closed = False
        self.thread = threading.Thread(target=self._record, daemon=True)
        self.thread.start()

    def _record(self):
        ahead_us = realtime_ahead_us() if not self.exact else 0
        number = 0
        while not self.closed:
            try:
                data, ancillary, message_flags, _ = self.socket.recvmsg(FRAME.size, 64)
            except OSError:  # nothing for a while, or the interface went down, or it is gone
                continue
            if self.exact:
                t_us = now_us()
            else:
                number += 1
                if number % 4096 == 0:
                    ahead_us = realtime_ahead_us()
                seconds, nanoseconds = struct.unpack("qq", ancillary[0][2])
                t_us = seconds * 1_000_000 + nanoseconds // 1000 - ahead_us
            can_id, length, _, _, payload = FRAME.unpack(data)
            frame = Frame(t_us, can_id, payload[:length], bool(message_flags & MSG_CONFIRM))
            (self.errors if can_id & ERROR else self.frames).append(frame)

    def send_fd(self, can_id, data):
        """A CAN FD frame, from a socket that may."""
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sock:
            sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
            sock.bind((self.interface,))
            sock.send(FD_FRAME.pack(can_id, len(data), 0, data.ljust(64, b"\0")))

    def close(self):
        self.closed = True
        self.thread.join(5)
        self.socket.close()
