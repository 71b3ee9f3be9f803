# SPDX-License-Identifier: MIT
"""Sleeps 1 ms over and over, on every processor, and writes down when it was woken late: then the machine was slow.

Usage: sleeper.py FILE    appends lines "t_us late_us"
"""

import os
import sys
import time

from harness import as_a_service, die_with_parent

LATE_US = 5_000
PROCESSORS_MAX = 4


def sleep_on(file):
    before = time.monotonic_ns()
    while True:
        time.sleep(0.001)
        after = time.monotonic_ns()
        late_us = (after - before) // 1000 - 1000
        if late_us > LATE_US:
            file.write(f"{after // 1000} {late_us}\n")
        before = after


def main(path):
    as_a_service()
    processors = sorted(os.sched_getaffinity(0))[:PROCESSORS_MAX]
    with open(path, "a", encoding="ascii", buffering=1) as file:
        for processor in processors[1:]:
            if os.fork() == 0:
                die_with_parent()
                os.sched_setaffinity(0, {processor})
                sleep_on(file)
        os.sched_setaffinity(0, {processors[0]})
        sleep_on(file)


if __name__ == "__main__":
    main(sys.argv[1])
