# SPDX-License-Identifier: MIT
"""Peers of the timed benchmark with python-can.

usage: python_can_peer.py period INTERFACE PERIOD_US | line INTERFACE SOCKET | receive INTERFACE
"""

import socket
import sys
import threading
import time

import can
from can.broadcastmanager import ThreadBasedCyclicSendTask

LEFT, RIGHT = 0x10A, 0x12A


def setpoint(can_id, mm_s):
    return can.Message(arbitration_id=can_id, is_extended_id=False, data=[1, *mm_s.to_bytes(2, "big", signed=True), 7, 208])


def period(bus, period_us):
    """The library's own thread, which it uses where the kernel does not repeat frames."""
    lock = threading.Lock()
    for can_id in (LEFT, RIGHT):
        ThreadBasedCyclicSendTask(bus, lock, setpoint(can_id, 100), int(period_us) / 1e6).start()
    time.sleep(3600)


def line(bus, path):
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen(1)
    with listener.accept()[0].makefile("r") as lines:
        for words in lines:
            left, right = map(int, words.split())
            bus.send(setpoint(LEFT, left))
            bus.send(setpoint(RIGHT, right))


def receive(bus):
    print("ready", flush=True)
    for _ in bus:
        pass


bus = can.Bus(interface="socketcan", channel=sys.argv[2])
{"period": period, "line": line, "receive": receive}[sys.argv[1]](bus, *sys.argv[3:])
