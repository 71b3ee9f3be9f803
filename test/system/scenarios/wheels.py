# SPDX-License-Identifier: MIT
"""Row 22 and the wheel's part of row 23: wheels that fall silent or do not do what they are told."""

import time

from client import Streamer
from harness import now_us
from scenario import scenario

from .bus_faults import wait_reset


def fault_while_driving(t, command, cause, within_ms, speed=400, **expected):
    """Drives, injects the fault, checks cause and reaction time; returns rig, client and why."""
    rig, client = t.running()
    t.arm(client)
    stream = Streamer(client, speed, speed)
    time.sleep(0.9)
    kind = expected.get("kind", "cut")
    fault_us = now_us()
    rig.fault(command, kind, within_ms)
    time.sleep(within_ms / 1000 + 0.25)
    stream.stop()
    ms = t.first_after(rig, fault_us, lambda value: abs(value) < speed, "the reaction", within_ms)
    t.figure(f"reaction after {ms or 0:.0f} ms")
    why = t.stopped_by(client, cause, expected.get("state", "latched"))
    side = expected.get("side")
    t.check(side is None or why["side"] == side, f"side {side} expected, why says {why['side']}")
    return rig, client, why


@scenario("left wheel silent", 6)
def row22_left_silent(t):
    rig, client, _ = fault_while_driving(t, "mute left", "wheel_lost", 80, side="left")
    t.check(not client.request("reset")["ok"], "no reset while it is silent")
    rig.sim.ask("unmute left")
    wait_reset(t, client)
    t.judge(rig)


@scenario("both wheels silent", 6)
def row22_both_silent(t):
    rig, client, _ = fault_while_driving(t, "mute both", "wheel_lost", 80)  # which side is named is a matter of microseconds
    status = client.request("status")
    t.check(not status["left"]["heard"] and not status["right"]["heard"], "neither is heard")
    rig.sim.ask("unmute both")
    wait_reset(t, client)
    t.judge(rig)


@scenario("feedback with the wrong sign", 6)
def row22_sign_swapped(t):
    rig, client, _ = fault_while_driving(t, "sign right swapped", "feedback_sign", 420, side="right")
    rig.sim.ask("sign right normal")
    wait_reset(t, client)
    t.judge(rig)


@scenario("a wheel faster than told", 6)
def row22_overspeed(t):
    rig, client, _ = fault_while_driving(t, "runaway left on", "overspeed", 3000, side="left")
    t.check(not client.request("reset")["ok"], "no reset while it turns")
    rig.sim.ask("runaway left off")
    wait_reset(t, client, 8)
    t.judge(rig)


@scenario("a blocked wheel: ramp, not latched", 7)
def row22_blocked(t):
    rig, client, _ = fault_while_driving(
        t, "block right", "wheel_blocked", 1600, kind="ramp", state="stopping", side="right"
    )
    rig.sim.ask("unblock right")
    t.check(rig.wait_status(client, lambda s: s["state"] == "listening", 4), "listening again without reset")
    t.judge(rig)


@scenario("a wheel reboots while driving", 8)
def trap07_reboot_while_driving(t):
    rig, client = t.running()
    t.arm(client)
    stream = Streamer(client, 300, 300)
    time.sleep(0.9)
    rig.fault("reboot right", within_ms=80)
    time.sleep(0.4)
    stream.stop()
    status = client.request("status")
    t.check(
        status["state"] == "latched" and status["cause"] in ("wheel_lost", "wheel_rebooted"),
        f"{status['state']}, {status['cause']}",
    )
    t.check(rig.wait_status(client, lambda s: s["right"]["at_rest"], 6), "it comes back")
    wait_reset(t, client)
    t.judge(rig)


@scenario("odometry jumps further than a wheel can turn: rebooted", 5)
def trap12_odometry_jump(t):
    rig, client, why = fault_while_driving(t, "ticks right 100000", "wheel_rebooted", 120, side="right")
    t.check(client.request("status")["right"]["reboots"] == 1, "counted as a reboot")
    distance_mm = client.request("status")["right"]["distance_mm"]
    t.check(abs(distance_mm) < 3000, f"and not as a distance: {distance_mm} mm, {why['sentence']}")
    wait_reset(t, client)
    t.judge(rig)


@scenario("force in the wrong unit: invalid with a reason, never rescaled", 8)
def row23_wrong_unit(t):
    rig = t.rig()
    rig.sim.ask("unit left dN")
    rig.start_gateway()
    client = rig.client()
    status = rig.wait_status(client, lambda s: s["left"]["force_validity"] == "unit_contradicted", 6)
    t.check(status, f"flagged: {client.request('status')['left']['force_validity']}")
    left = (status or client.request("status"))["left"]
    t.check(
        left["force_net_mN"] is None and left["unit_evidence"] == "dN",
        f"no value from it: {left['force_net_mN']}, {left['unit_evidence']}",
    )
    t.arm(client)
    t.drive_for(client, 100, 100, 0.5)
    t.judge(rig)
