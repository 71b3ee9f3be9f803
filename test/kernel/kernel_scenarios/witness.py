# SPDX-License-Identifier: MIT
"""The verdicts of real time can fail: a late gateway is found, and the machine is not blamed for it."""

import signal
import time

from catalogue import kernel_test
from client import Streamer
from kernel_rig import ESTOP_US, PRESS_LATE_US, TICK_US, machine_late
from scenario import Skip

LATE_S = 0.03
TRIES = 3


def late_press(t, delay):
    """A press in motion while `delay(rig)` keeps something from working for LATE_S. Returns (edge, latency, the machine was late)."""
    rig, client = t.running()
    t.arm(client)
    stream = Streamer(client, 300, 300)
    time.sleep(0.5)
    undo = delay(rig)
    edge_us = rig.press()
    undo()
    time.sleep(0.3)
    stream.stop()
    judge = rig.judge(estop_limit_us=1 << 62)
    latency_us = max((t.after_edge(rig, judge, *pair)[1] for pair in judge.estop_latencies), default=0)
    return edge_us, latency_us, machine_late(edge_us - TICK_US, edge_us + LATE_S * 1e6, PRESS_LATE_US)


def stop_gateway(rig):
    rig.gateway.signal(signal.SIGSTOP)

    def later():
        time.sleep(LATE_S)
        rig.gateway.signal(signal.SIGCONT)

    return later


@kernel_test("a gateway that stands still for 30 ms at a press is found out, and the machine is not blamed", "plumbing-realtime", 0)
def plumbing_late_gateway(t):
    for _ in range(TRIES):
        _, latency_us, disturbed = late_press(t, stop_gateway)
        if not disturbed:
            t.check(latency_us > ESTOP_US, f"{latency_us / 1000:.2f} ms measured although the gateway stood still for 30 ms")
            t.figure(f"{latency_us / 1000:.0f} ms measured")
            return
    raise Skip(f"the machine was late beside each of {TRIES} presses; needs a quieter one")
