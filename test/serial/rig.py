# SPDX-License-Identifier: MIT
"""A rig with a board instead of the gateway: wheels, board, a cable with all faults of a cable, and the relay."""

import os
import pty
import select
import socket
import threading
import time
import tty
import zlib

from bus import now_us
from client import Client
from harness import Process, Rig, wait_connect
from judge_log import Event

PROGRAMS = {"iwheel-serial": "app/bridge/serial", "serial_board": "test/serial"}


def framed(text):
    """A line with its CRC and its newline."""
    return text + b"*%08x\n" % zlib.crc32(text)


class Cable(threading.Thread):
    """Connects the relay's port (a pseudo terminal, `path` links to it) and the board (a socket). `up` and `down` may change the bytes:
    each receives bytes and returns bytes. `held`: the cable transports nothing in either direction."""

    def __init__(self, path, board):
        super().__init__(daemon=True)
        self.path, self.board = path, board
        self.up = self.down = None
        self.held, self.over = False, False
        self.cut_after = None  # Bytes that still reach the board before the plug is pulled.
        self.from_relay, self.from_board = bytearray(), bytearray()  # All bytes from the relay and from the board.
        self.lock = threading.RLock()
        self.master = self.slave = None
        self.plug()
        self.start()

    def plug(self):
        with self.lock:
            self.master, self.slave = pty.openpty()
            tty.setraw(self.slave)
            os.set_blocking(self.master, False)
            os.symlink(os.ttyname(self.slave), self.path + ".new")
            os.replace(self.path + ".new", self.path)

    def pull(self):
        with self.lock:
            if self.master is not None:
                os.unlink(self.path)
                os.close(self.master)
                os.close(self.slave)
                self.master = self.slave = None

    def send_to_relay(self, data):
        """Sends bytes to the relay as if from the board."""
        with self.lock:
            self.write(data)

    def write(self, data):
        """Writes as fast as the relay reads; bytes that it does not read within a while are lost, as on any cable."""
        end = time.monotonic() + 0.2
        while data and self.master is not None and time.monotonic() < end:
            try:
                data = data[os.write(self.master, data) :]
            except BlockingIOError:
                time.sleep(0.001)

    def ask(self, data):
        """Sends bytes to the board as if from the relay."""
        with self.lock:  # A line of the relay comes before or after these bytes.
            self.board.sendall(data)

    def run(self):
        while not self.over:
            with self.lock:
                sources = [self.board] + ([self.master] if self.master is not None else [])
            if self.held:
                time.sleep(0.002)
                continue
            for source in select.select(sources, [], [], 0.005)[0]:
                with self.lock:
                    self.carry(source)

    def carry(self, source):
        if source is self.board:
            data = self.board.recv(65536)
            self.from_board += data
            self.write(self.down(data) if self.down else data)
            self.over = self.over or not data
            return
        if source != self.master:
            return
        try:
            data = os.read(self.master, 65536)
        except OSError:
            return
        if self.cut_after is not None:
            data, self.cut_after = data[: self.cut_after], max(0, self.cut_after - len(data))
        self.from_relay += data
        try:
            self.board.sendall(self.up(data) if self.up else data)
        except OSError:
            self.over = True
        if self.cut_after == 0:
            self.cut_after = None
            self.pull()

    def end(self):
        self.over = True
        self.join(1)
        self.pull()
        self.board.close()


class SerialRig(Rig):
    """`start_gateway` starts board, cable and relay; clients connect to the relay's sockets."""

    cable = board = None
    # These limits fit any machine, however busy: the tests judge the serial line.
    PATIENT = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}}

    def __init__(self, build, config=None, **options):
        super().__init__(build, {**self.PATIENT, **(config or {})}, **options)

    def program(self, name):
        return os.path.join(self.build, PROGRAMS[name], name) if name in PROGRAMS else super().program(name)

    def start_board(self):
        ours, theirs = socket.socketpair()
        command = [self.program("serial_board"), self.path("gateway.conf"), self.gateway_bus(), self.estop_line()]
        self.board = Process(command, self.path("board.out"), setup=lambda: os.dup2(theirs.fileno(), 0), pass_fds=[theirs.fileno()])
        theirs.close()
        self.processes.append(self.board)
        self.cable = Cable(self.path("port"), ours)

    def plug_device(self):
        """Connects the cable to a device that is no board. Returns the device's end."""
        ours, theirs = socket.socketpair()
        self.cable = Cable(self.path("port"), ours)
        return theirs

    def relay_command(self, *extra):
        return [
            self.program("iwheel-serial"),
            "-c",
            self.path("serial.conf"),
            "--port",
            self.path("port"),
            "--socket",
            self.path("gateway.sock"),
            "--watch-socket",
            self.path("watch.sock"),
            *extra,
        ]

    def start_relay(self, *extra):
        with open(self.path("serial.conf"), "w", encoding="utf-8") as file:
            file.write("[northbound]\ngroup = none\nwatch_group = none\nmode = 0600\nwatch_mode = 0600\n")
        self.said_before = len(self.gateway.text()) if self.gateway else 0
        self.gateway = self.launch(self.relay_command(*extra), "relay.out")
        wait_connect(self.path("gateway.sock"), self.gateway).close()
        return self.gateway

    def await_relay(self, text, seconds=4.0):
        """Waits until this relay, not an earlier one, has printed this. Returns False after that time."""
        end = time.monotonic() + seconds
        while text not in self.gateway.text()[self.said_before :]:
            if time.monotonic() > end:
                return False
            time.sleep(0.01)
        return True

    def start_gateway(self, *extra, **options):
        self.note("start")
        self.start_board()
        self.start_relay(*extra)
        self.await_relay("board on ")
        client = self.client(name="starter")
        self.wait_at_rest(client, active=True)
        client.close()

    def watcher(self):
        client = Client(self.path("watch.sock"), self.timeline, "watcher")
        self.clients.append(client)
        return client

    def moving(self, since_us):
        """Nonzero setpoints on the bus since then."""
        return [t_us for t_us, _, speed in self.bus.setpoints(since_us) if speed]

    def times(self, count):
        """The number of repetitions."""
        return count

    def note_after(self, wait_us, kind, **fields):
        """Adds an event to the timeline at a later time."""
        self.timeline.append(Event(now_us() + wait_us, kind, **fields))

    def close(self, keep=False):
        if self.cable:
            self.cable.end()
        super().close(keep)


def mutated(line, chance):
    """The line as after a bad wire: bytes changed, cut, doubled, or joined with itself."""
    kind = chance.randrange(5)
    data = bytearray(line)
    at = chance.randrange(len(data))
    if kind == 0:
        data[at] ^= 1 << chance.randrange(8)
    elif kind == 1:
        del data[at : at + 1 + chance.randrange(8)]
        data += b"\n"
    elif kind == 2:
        data = data[:at] + data + b"\n"
    elif kind == 3:
        data[at:at] = bytes(chance.randrange(256) for _ in range(1 + chance.randrange(6)))
    return bytes(data)  # Kind 4: unchanged, but too late.
