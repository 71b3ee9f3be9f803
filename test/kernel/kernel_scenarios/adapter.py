# SPDX-License-Identifier: MIT
"""Rows 15 to 18 on a real `can` device: a fake slcan adapter with states, stalls, and a plug.

The bus log is recorded at the wheels' end. The echo of this kind of interface proves nothing. A stalled adapter is detected only by
missing telemetry or by a full queue; queue, driver and adapter limit the number of old frames that come out afterwards.
"""

import time

import netdev
from catalogue import add, kernel_test
from fake_slcan import DEPTH
from harness import now_us
from judge_log import LEFT, RIGHT
from kernel_rig import SlcanRig
from scenario import REGISTRY
from scenarios import bus_states
from scenarios.bus_states import judge_repaired

from .interface import lose_interface

TTY_FRAMES = 40  # what a stalled pty, the driver and the queue hold at most: measured, with a margin


@kernel_test("nominal drive through an adapter", "adapter", 0, SlcanRig, pace=1)
def slcan_nominal(t):
    rig, client, stream = t.driving(speed=400)
    status = client.request("status")
    t.check(abs(status["left"]["speed_mm_s"] - 400) < 40, f"left {status['left']['speed_mm_s']} mm/s")
    t.check(status["bus"]["echo"] == "unproven", f"echo {status['bus']['echo']}")
    t.check(stream.stop() is None, "the stream was not refused")
    t.stop_until_silent(rig, client)
    t.judge(rig)


def restart(rig):
    netdev.down(rig.adapter.interface)
    netdev.up(rig.adapter.interface)


def report(state):
    return lambda rig: rig.adapter.report(state)


def burst(rig, number):
    rig.adapter.errors(5, b"sc")
    rig.adapter.report("passive" if number % 2 else "warning")


ADAPTER_STATES = (
    (bus_states.row16_bus_off, lambda t: bus_states.bus_off(t, report("bus_off"), restart)),
    (bus_states.row16_bus_off_listening, lambda t: bus_states.bus_off_listening(t, report("bus_off"), restart)),
    (bus_states.row16_error_passive, lambda t: bus_states.error_passive(t, report("passive"), report("active"))),
    (bus_states.row16_error_flood, lambda t: bus_states.error_flood(t, burst, report("active"))),
)
for there, here in ADAPTER_STATES:  # the adapter does what the simulator does on the local bus
    add(there.__name__, REGISTRY[there.__name__][0], here, groups="adapter", row=16, rig=SlcanRig)


def stalled(t, seconds, setup=None):
    """The adapter accepts nothing for that long; returns the rig, and the frames that came out afterwards as [(t_us, id, mm/s)]."""
    rig, client, stream = t.driving({"drive": {"accel_mm_s2": 2000}}, setup=setup, speed=800, seconds=0.8)
    rig.note("cut", within_us=150_000)
    rig.adapter.stall(True)
    rig.note("dead")
    stream.stop(after=seconds)
    if seconds > 0.5:
        t.check(client.request("status")["state"] == "latched", "latched while it stalls")
    rig.adapter.stall(False)
    back_us = rig.note("alive")
    return rig, client, back_us


def bounded_residue(t, rig, back_us):
    """Without a proof by the echo, old frames are possible: few, within a short time, and followed by zeros."""
    time.sleep(0.5)
    late = rig.bus.setpoints(back_us)
    moving = [at for at, _, speed in late if speed]
    t.measure("stale_frames", len(moving))
    t.check(len(moving) <= TTY_FRAMES, f"{len(moving)} old frames came out, {TTY_FRAMES} allowed")
    t.check(not moving or moving[-1] - back_us < 100_000, "old frames end within 100 ms")
    for side in (LEFT, RIGHT):
        values = [speed for _, can_id, speed in late if can_id == side]
        t.check(not values or values[-1] == 0, f"the last frame of {side} is a zero: {values[-5:]}")
    t.figure(f"{len(moving)} old frames of {len(late)} after the stall")


def judge_after_residue(t, rig, client, back_us):
    """The old frames were judged already; the rest by the rules."""
    t.reset(client, 12)
    t.arm_and_drive(client, 200, 200, 0.5)
    t.stop_for(client, 0.4)
    rig.bus.frames[:] = [f for f in rig.bus.frames if not (f.id in (LEFT, RIGHT) and back_us <= f.t_us < back_us + 500_000)]
    t.judge(rig)


def long_stall(t, setup):
    rig, client, back_us = stalled(t, 2.0, setup)
    bounded_residue(t, rig, back_us)
    judge_after_residue(t, rig, client, back_us)


@kernel_test("an adapter that stalls for 2 s: a bounded number of old frames, then zeros", "adapter", 17, SlcanRig)
def row17_stall(t):
    long_stall(t, None)


@kernel_test("an adapter that stalls for 2 s, the gateway may not restart the link", "adapter", 17, SlcanRig)
def row17_stall_no_rights(t):
    long_stall(t, netdev.without_net_admin)


@kernel_test("an adapter that stalls for 40 ms: old setpoints do not accumulate", "adapter", 17, SlcanRig)
def row17_stall_short(t):
    rig, client, back_us = stalled(t, 0.04)
    time.sleep(0.3)
    late = [at for at, _, _ in rig.bus.setpoints(back_us) if at < back_us + 5_000]
    t.check(len(late) <= 2 * DEPTH + 6, f"{len(late)} setpoints in the first 5 ms")
    t.figure(f"{len(late)} setpoints in the first 5 ms, {client.request('status')['state']}")


def power_cut(t, seconds, setup):
    rig, client, stream = t.driving({"drive": {"accel_mm_s2": 2000}}, setup=setup, speed=800, seconds=1.0)
    rig.fault("power off", within_ms=120)
    rig.note("dead")
    stream.stop(after=0.3)
    t.check(client.request("status")["state"] == "latched", "latched")
    t.check(not client.request("reset")["ok"], "reset is refused until the wheels are online")
    time.sleep(seconds)
    back_us = now_us()
    rig.sim.ask("power on")
    rig.note("alive")
    online = rig.wait_at_rest(client, 10)
    t.check(online, "the wheels are online again")
    time.sleep(0.5)
    late = rig.bus.setpoints(back_us)
    moving = [(at, side) for at, side, speed in late if speed]
    t.measure("stale_frames", len(moving))
    t.figure(f"{len(moving)} old of {len(late)} frames after the power came back")
    return rig, client, back_us, late, moving


@kernel_test("wheel power off for 10 s at full command, echo unproven: a bounded number of old frames, then zeros", "adapter", 18, SlcanRig)
def row18_power_cut_adapter(t):
    rig, client, back_us, late, moving = power_cut(t, 10, None)
    t.check(not late or all(speed == 0 for _, _, speed in late[-2:]), f"ends in zeros: {late[-3:]}")
    spread_us = moving[-1][0] - late[0][0] if moving else 0
    t.check(spread_us < 20_000, f"old frames end within {spread_us / 1000:.1f} ms of the first, 20 ms allowed")
    judge_after_residue(t, rig, client, back_us)


@kernel_test("adapter unplugged in motion and plugged in again: stop, found by name, no backlog", "adapter", 15, SlcanRig)
def row15_unplugged(t):
    rig, client, stream = t.driving()
    # The gateway may notice the unsent frame and the missing telemetry before the kernel reports that the adapter is gone.
    lose_interface(t, rig, client, stream, rig.adapter.unplug, ("bus_down", "send_stalled", "wheel_lost"))
    t.check(not rig.adapter.is_there(), "the interface is gone")
    time.sleep(1.0)

    def plug_in():
        rig.adapter.plug()
        rig.adapter.link_up()

    judge_repaired(t, rig, client, plug_in)
