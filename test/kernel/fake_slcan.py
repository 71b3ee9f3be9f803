# SPDX-License-Identifier: MIT
"""A CAN adapter with the protocol slcan, on a pseudo terminal: for the kernel a real `can` device with states and faults.

    gateway -- canN (slcan) -- pty -- this thread -- the simulator's bus (unix:PATH)

The adapter reads a frame from the pty only while it has space for it, as an adapter with flow control does. It stores the frame
until the simulated bus accepts it. Without a hub the adapter is alone on its bus, but everything works.
"""

import array
import contextlib
import fcntl
import os
import select
import socket
import threading
import tty

from bus import EXTENDED, FRAME, REMOTE
from netdev import command, exists, fetch, up

TIOCSETD, SIOCGIFNAME, N_SLCAN = 0x5423, 0x8910, 17
DEPTH = 3  # frames the adapter holds: one in its controller, two behind it
STATES = {"active": b"sa000000\r", "warning": b"sw100096\r", "passive": b"sp128128\r", "bus_off": b"sb256256\r"}
READ_BYTES = 64  # small, so that frames that were not read yet stay in the kernel


def to_line(can_id, length, data):
    """A frame as the adapter writes it."""
    letter = "r" if can_id & REMOTE else "t"
    number = f"{can_id & 0x1FFFFFFF:08X}" if can_id & EXTENDED else f"{can_id & 0x7FF:03X}"
    letter = letter.upper() if can_id & EXTENDED else letter
    return f"{letter}{number}{length}{'' if can_id & REMOTE else data[:length].hex().upper()}\r".encode()


def from_line(line):
    """The frame that the kernel wrote, as (id, length, data); None if it is no frame."""
    if line[:1] not in b"tTrR" or not line:
        return None
    extended = line[:1] in b"TR"
    digits = 8 if extended else 3
    can_id = int(line[1 : 1 + digits], 16) | (EXTENDED if extended else 0) | (REMOTE if line[:1] in b"rR" else 0)
    return can_id, int(line[1 + digits : 2 + digits]), bytes.fromhex(line[2 + digits :].decode())


class FakeSlcan(threading.Thread):
    """Plugged in immediately, with the link up at 1 Mbit/s. `taken` lists the frames that the adapter read from the kernel."""

    def __init__(self, hub_path=None, queue_length=4):
        super().__init__(daemon=True)
        self.hub_path, self.queue_length = hub_path, queue_length
        self.master = self.slave = self.hub = None
        self.wake_read, self.wake_write = os.pipe()
        os.set_blocking(self.wake_read, False)
        self.lock = threading.RLock()
        self.pending, self.waiting, self.received = b"", 0, []
        self.stalled = self.quit = self.open = False
        self.commands = []
        self.plug()
        self.start()
        self.link_up()

    # Actions of a person ----------------------------------------------------------------------------------------------

    def plug(self):
        with self.lock:
            self.master, self.slave = os.openpty()
            os.set_blocking(self.master, False)
            tty.setraw(self.slave)
            fcntl.ioctl(self.slave, TIOCSETD, array.array("i", [N_SLCAN]))
            name = fcntl.ioctl(self.slave, SIOCGIFNAME, bytes(40))
            self.interface = name.split(b"\0")[0].decode()
            fetch(self.interface)
        self._wake()

    def link_up(self):
        command("ip", "link", "set", self.interface, "type", "can", "bitrate", "1000000")
        command("ip", "link", "set", self.interface, "txqueuelen", str(self.queue_length))
        up(self.interface)

    def unplug(self):
        """The cable is unplugged: the terminal hangs up, and the kernel removes the interface."""
        with self.lock:
            os.close(self.master)
            os.close(self.slave)
            self.master = None
            self._close_channel()
            self.pending = b""
        self._wake()

    def stall(self, on):
        """The adapter reads nothing from the kernel; it still sends the frames of the bus to the kernel."""
        self.stalled = on
        self._wake()

    def report(self, state):
        """Reports the state of its controller, one of STATES."""
        self.write(STATES[state])

    def errors(self, count, kinds=b"s"):
        for _ in range(count):
            self.write(b"e" + str(len(kinds)).encode() + kinds + b"\r")

    def end(self):
        self.quit = True
        self._wake()
        self.join(3)
        with self.lock:
            if self.master is not None:
                self.unplug()
            os.close(self.wake_read)
            os.close(self.wake_write)

    def is_there(self):
        return exists(self.interface)

    # The thread -------------------------------------------------------------------------------------------------------

    def write(self, line):
        with self.lock:
            if self.master is not None:
                with contextlib.suppress(BlockingIOError):  # the kernel does not read: a real adapter loses the frame too
                    os.write(self.master, line)

    def _wake(self):
        os.write(self.wake_write, b"x")

    def run(self):
        while not self.quit:
            with self.lock:
                self._take_lines()
                reads = [self.wake_read] + ([self.hub] if self.hub else [])
                if self.master is not None and not self.stalled and self.waiting < DEPTH:
                    reads.append(self.master)
            ready = select.select(reads, [], [], 1.0)[0]
            with self.lock:
                if self.wake_read in ready:
                    os.read(self.wake_read, 4096)
                if self.hub in ready:
                    self._from_hub()
                if self.master in ready:
                    self._from_kernel()

    def _from_kernel(self):
        with contextlib.suppress(OSError):  # no process has the other end open
            self.pending += os.read(self.master, READ_BYTES)

    def _take_lines(self):
        while b"\r" in self.pending and self.waiting < DEPTH and not self.stalled:
            line, self.pending = self.pending.split(b"\r", 1)
            self._take(line)

    def _take(self, line):
        frame = from_line(line)
        if frame is None:
            self.commands.append(line)
            if line[:1] in (b"O", b"L"):
                self._open_channel()
            elif line[:1] == b"C":
                self._close_channel()
            self.write(b"\r")
            return
        self.received.append(frame)
        if self.hub:
            self.hub.send(FRAME.pack(frame[0], frame[1], 0, 0, frame[2].ljust(8, b"\0")))
            self.waiting += 1
        self.write(b"z\r")

    def _open_channel(self):
        self._close_channel()
        self.open = True
        if self.hub_path:
            self.hub = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self.hub.connect(self.hub_path)

    def _close_channel(self):
        """The controller is reset: frames that it has not sent are lost."""
        self.open = False
        self.waiting = 0
        if self.hub:
            self.hub.close()
            self.hub = None

    def _from_hub(self):
        data = self.hub.recv(FRAME.size)
        if not data:
            self._close_channel()
            return
        can_id, length, _, echo, payload = FRAME.unpack(data)
        if echo:
            self.waiting = max(0, self.waiting - 1)
        elif not can_id & 0x20000000:
            self.write(to_line(can_id, length, payload))
