# SPDX-License-Identifier: MIT
"""Sleeps 1 ms over and over, and writes down when it was woken more than 8 ms late: then the machine, not the gateway, was slow.

Usage: sleeper.py FILE    appends lines "t_us late_us"
"""

import sys
import time

LATE_US = 8_000

with open(sys.argv[1], "a", encoding="ascii", buffering=1) as file:
    before = time.monotonic_ns()
    while True:
        time.sleep(0.001)
        after = time.monotonic_ns()
        late_us = (after - before) // 1000 - 1000
        if late_us > LATE_US:
            file.write(f"{after // 1000} {late_us}\n")
        before = after
