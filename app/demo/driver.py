# SPDX-License-Identifier: MIT
"""A small client that drives, like a joystick program: arms, then repeats the last "LEFT RIGHT" line of its input 20 times a second.

Usage: driver.py SOCKET      ends when it is refused, printing the reason
Prints one line per answered command: the events of test/system/judge_log.py.
"""

import os
import select
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "test", "system"))
from client import Client


def main(path):
    timeline, target, typed = [], None, b""
    client = Client(path, timeline, name="joystick")
    reply = client.arm()
    due = time.monotonic()
    while reply["ok"]:
        for event in timeline:
            print(*event, flush=True)
        timeline.clear()
        due += 0.05
        while select.select([0], [], [], max(0, due - time.monotonic()))[0]:
            data = os.read(0, 100)
            if not data:
                return 0
            typed += data
            if b"\n" in typed:
                target, typed = tuple(map(int, typed.split(b"\n")[-2].split())), typed.split(b"\n")[-1]
        if target is not None:
            reply = client.drive(*target)
    print(f"refused: {reply['error']}: {reply['message']}", flush=True)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
