# SPDX-License-Identifier: MIT
"""A client in a process of its own, to be killed or frozen: arms, then drives every 20 ms; one line per answered command.

Usage: drive_client.py SOCKET LEFT RIGHT [noarm]
"""

import sys
import time

from client import Client

timeline = []
client = Client(sys.argv[1], timeline, name="process")
if sys.argv[4:] != ["noarm"]:
    client.arm()
due = time.monotonic()
while True:
    client.drive(int(sys.argv[2]), int(sys.argv[3]))
    print("\n".join(" ".join(map(str, event)) for event in timeline), flush=True)
    timeline.clear()
    due += 0.02
    time.sleep(max(0, due - time.monotonic()))
