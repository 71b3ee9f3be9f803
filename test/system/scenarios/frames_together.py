# SPDX-License-Identifier: MIT
"""Frames without a watcher are read together; with a watcher, each frame wakes the gateway."""

import time

from harness import now_us
from scenario import scenario

WATCHED_S = 1.5
TOGETHER = 0.6  # wakes for a frame, at most: three frames of the wheels fall into 6 ms
DRIVING = 0.9  # the same while driving: polls every 3 ms, pairs, their echoes, commands
STEPS_hz = 70  # one each period of 20 ms, and some for the recording
APART = 1.5  # times as many as that for a client that watches them, at least


def wakes(gateway):
    with open(f"/proc/{gateway.child.pid}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("voluntary_ctxt_switches"))


def wakes_per_frame(rig):
    since_us, before = now_us(), wakes(rig.gateway)
    time.sleep(WATCHED_S)
    slept, frames = wakes(rig.gateway) - before, sum(f.t_us >= since_us for f in list(rig.bus.frames))
    return slept / max(frames, 1), frames


@scenario("frames are read together, while driving too; with a client that watches them, each wakes the gateway", 10)
def frames_taken_together(t):
    rig, client = t.running()
    client.close()
    time.sleep(0.3)
    alone, frames = wakes_per_frame(rig)
    t.check(frames > 300 * WATCHED_S, f"{frames} frames of telemetry in {WATCHED_S} s")
    t.check(alone <= TOGETHER, f"{alone:.2f} wakes for a frame without a watcher")
    client = rig.client()
    received = client.request("status")["counters"]["received"]
    t.check(received > frames, f"{received} frames received, {frames} were on the bus")
    unwatched, _ = wakes_per_frame(rig)
    t.check(unwatched <= TOGETHER, f"{unwatched:.2f} wakes for a frame with a client that does not watch them")
    t.arm(client)
    since_us, before = now_us(), wakes(rig.gateway)
    t.drive_for(client, 200, 200, WATCHED_S)
    driving = (wakes(rig.gateway) - before) / max(sum(f.t_us >= since_us for f in list(rig.bus.frames)), 1)
    t.check(driving <= DRIVING, f"{driving:.2f} wakes for a frame while driving")
    client.request("watch", topics=["frame"])
    watched, _ = wakes_per_frame(rig)
    t.check(watched >= APART * alone, f"{watched:.2f} wakes for a frame with a client that watches them, {alone:.2f} without", timing=True)
    t.figure(f"{alone:.2f} wakes for a frame, {driving:.2f} while driving, {watched:.2f} watched")
    t.stop_until_silent(rig, client)
    t.judge(rig)


@scenario("without a client and without frames the gateway sleeps", 4)
def frames_none(t):
    rig, client = t.running()
    client.close()
    rig.sim.ask("mute both")
    time.sleep(0.5)
    before, begin = wakes(rig.gateway), time.monotonic()
    time.sleep(1.0)
    rate_hz = (wakes(rig.gateway) - before) / (time.monotonic() - begin)
    t.check(rate_hz <= STEPS_hz, f"{rate_hz:.0f} wakes a second in which nothing happened")
    t.figure(f"{rate_hz:.0f} wakes a second")
