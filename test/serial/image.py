#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A board for the relay's tests: the real image `gateway` on the emulated CPU, with two wheels, in real time.

usage: image.py BOARD IMAGE LIBRARY LINK_FD      (the serial line is descriptor 0, the rig is at the other end of LINK_FD)

Input, one word per line: press, release (the e-stop's contact), reset (the pin), hang (the main loop runs in place). Output, V being the
board's own microseconds: `T WALL V` a slice begins, `F V ID HEX` a frame was on the bus, `E V KIND WITHIN` for the judge's timeline, `X TEXT`
the image did something that the chip forbids.

On a busy machine the board's time passes more slowly, and nothing is late in that time, so the tests judge in the board's time.
"""

import contextlib
import os
import socket
import sys
import time
from pathlib import Path

TARGET = Path(__file__).resolve().parent.parent / "target"
sys.path.insert(0, str(TARGET))
sys.dont_write_bytecode = True

from emulator.boards import BOARDS
from emulator.can import Controller, load_model
from emulator.chip import PINRSTF
from emulator.machine import Machine

BAUD = 1_000_000
SLICE_NS = 2_000_000
BEHIND_MAX_NS = 20_000_000  # A longer delay is not made up for.
WAITING_MAX = 256  # Bytes from the host that the adapter buffers; further bytes wait in the socket.
SENDING_NS = 60_000_000  # Three periods.
RESTART_US = 300_000  # As in the system tests: zeros are due this soon after a start that follows motion.


class Board:
    """The machine and its connections."""

    def __init__(self, machine, line, link):
        self.machine, self.line, self.link = machine, line, link
        self.words, self.unread, self.news, self.resets, self.reported = b"", b"", [], 0, 0
        self.sent_ns, self.was_sending = None, False

    def now_us(self):
        return self.machine.now_ns // 1000

    def happened(self, kind, within_us=0):
        self.news.append(f"E {self.now_us()} {kind} {within_us}")

    def obey(self, word):
        machine = self.machine
        self.was_sending = self.sent_ns is not None and machine.now_ns - self.sent_ns < SENDING_NS
        if word in ("press", "release"):
            machine.board.drive("estop", None if word == "press" else 0)
            self.happened(word)
        elif word == "reset":
            self.happened("end")
            machine.reset("pin", PINRSTF)
        elif word == "hang":
            machine.divert()
            self.happened("end")

    def receive(self):
        """Reads input from the host and from the rig. Returns False if the rig has gone."""
        uart = self.machine.uart
        try:
            if len(uart.typed) < WAITING_MAX:
                uart.send(self.line.recv(WAITING_MAX))
        except BlockingIOError:
            pass
        try:
            more = self.link.recv(4096)
        except BlockingIOError:
            return True
        *words, self.words = (self.words + more).split(b"\n")
        for word in words:
            self.obey(word.decode())
        return bool(more)

    def report(self):
        """Passes on the output of the chip, and reports events to the rig."""
        machine = self.machine
        self.unread = (self.unread + bytes(machine.uart.sent))[-65536:]
        machine.uart.sent.clear()
        with contextlib.suppress(BlockingIOError, ConnectionError):
            self.unread = self.unread[self.line.send(self.unread) :] if self.unread else b""
        for _ in machine.resets[self.resets :]:
            self.happened("start")
            if self.was_sending:
                self.happened("restart_hold", RESTART_US)
        self.resets = len(machine.resets)
        self.news += [f"F {frame.time_ns // 1000} {frame.id} {frame.data.hex()}" for frame in machine.bus.log]
        self.sent_ns = next((frame.time_ns for frame in reversed(machine.bus.log) if frame.sender == "chip"), self.sent_ns)
        machine.bus.log.clear()
        machine.bus.attempts = 0
        self.news += [f"X {text}" for text in machine.violations[self.reported :]]
        self.reported = len(machine.violations)
        self.link.setblocking(True)
        self.link.sendall("".join(f"{line}\n" for line in self.news).encode())
        self.link.setblocking(False)
        self.news = []

    def run(self):
        due_ns = time.monotonic_ns()
        while self.receive():
            now_ns = time.monotonic_ns()
            self.news.insert(0, f"T {now_ns // 1000} {self.now_us()}")
            self.machine.run(SLICE_NS)
            self.report()
            due_ns = max(due_ns + SLICE_NS, now_ns - BEHIND_MAX_NS)
            time.sleep(max(0, due_ns - time.monotonic_ns()) / 1e9)


def main(board, image, library, link_fd):
    Machine.library = Controller.library = load_model(Path(library))
    machine = Machine(BOARDS[board](), Path(image).read_bytes())
    machine.uart.baud = BAUD
    line, link = socket.socket(fileno=0), socket.socket(fileno=int(link_fd))
    line.setblocking(False)
    link.setblocking(False)
    with contextlib.suppress(ConnectionError):  # The rig may have ended.
        Board(machine, line, link).run()
    os._exit(0)  # There is nothing to store, and the emulator ends slowly.


if __name__ == "__main__":
    main(*sys.argv[1:])
