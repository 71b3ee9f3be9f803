# SPDX-License-Identifier: MIT
"""Row 22 and the wheel's part of row 23: wheels that go offline or do not follow their commands."""

import time

from harness import now_us
from scenario import scenario


def fault_while_driving(t, command, cause, within_ms, speed=400, **expected):
    """Drives, injects the fault, checks cause and reaction time; returns rig, client and why."""
    rig, client, stream = t.driving(speed=speed, seconds=0.9, every=0.05)
    kind = expected.get("kind", "cut")
    fault_us = now_us()
    rig.fault(command, kind, within_ms)
    stream.stop(after=within_ms / 1000 + 0.25)
    ms = t.first_after(rig, fault_us, lambda value: abs(value) < speed, "the reaction", within_ms)
    t.figure(f"reaction after {ms or 0:.0f} ms")
    why = t.stopped_by(client, cause, expected.get("state", "latched"))
    side = expected.get("side")
    t.check(side is None or why["side"] == side, f"side {side} expected, why has {why['side']}")
    return rig, client, why


def judge_healed(t, rig, client, command, seconds=6.0):
    """Ends the fault, and resets."""
    rig.sim.ask(command)
    t.reset(client, seconds)
    t.judge(rig)


@scenario("left wheel offline", 6)
def row22_left_silent(t):
    rig, client, _ = fault_while_driving(t, "mute left", "wheel_lost", 80, kind="ramp", side="left")
    t.check(not client.request("reset")["ok"], "no reset while it is offline")
    judge_healed(t, rig, client, "unmute left")


@scenario("both wheels offline", 6)
def row22_both_silent(t):
    rig, client, _ = fault_while_driving(t, "mute both", "wheel_lost", 80)  # microseconds decide which side is named
    status = client.request("status")
    t.check(not status["left"]["heard"] and not status["right"]["heard"], "both are offline")
    judge_healed(t, rig, client, "unmute both")


@scenario("both wheels' feedback with the wrong sign", 6)
def row22_sign_swapped(t):
    rig, client, _ = fault_while_driving(t, "sign both swapped", "feedback_sign", 420)
    judge_healed(t, rig, client, "sign both normal")


@scenario("both wheels faster than commanded", 6)
def row22_overspeed(t):
    rig, client, _ = fault_while_driving(t, "runaway both on", "overspeed", 3000)
    t.check(not client.request("reset")["ok"], "no reset while they turn")
    judge_healed(t, rig, client, "runaway both off", 8)


@scenario("both wheels blocked: ramp, not latched", 7)
def row22_blocked(t):
    rig, client, _ = fault_while_driving(t, "block both", "wheel_blocked", 1600, kind="ramp", state="stopping")
    rig.sim.ask("unblock both")
    t.silence(rig, client, text="listening again without reset")
    t.judge(rig)


def alone(t, fault, undo, within_ms, kind):
    """The right wheel alone does not follow its command: the pair stops, and does not latch."""
    rig, client, why = fault_while_driving(t, fault, "pair_diverges", within_ms, kind=kind, state="stopping", side="right")
    rig.sim.ask(undo)
    largest = client.request("status")["pair"]
    t.check(largest["largest_mm"] >= largest["limit_mm"], f"the deviation is reported: {largest}, {why['sentence']}")
    t.figure(f"{why['detail']} mm from its path")
    t.silence(rig, client, text="listening again without reset")
    t.judge(rig)


@scenario("one wheel blocked: zero immediately, not latched", 7)
def row31_blocked(t):
    alone(t, "block right", "unblock right", 300, "cut")


@scenario("one wheel reversed: zero immediately, not latched", 7)
def row31_reversed(t):
    alone(t, "sign right swapped", "sign right normal", 300, "cut")


@scenario("one wheel slow: zero immediately, not latched", 7)
def row31_slow(t):
    alone(t, "droop right 70", "droop right 0", 500, "cut")


@scenario("one wheel faster than commanded: ramp, not latched", 7)
def row31_fast(t):
    alone(t, "runaway right on 250", "runaway right off", 800, "ramp")


@scenario("the third divergence within a minute latches", 14)
def row31_third_latches(t):
    rig, client = t.running()
    for attempt in range(3):
        stream = t.start_driving(client, 300, 300, 0.7)
        rig.fault("block left", within_ms=300)
        stream.stop(after=0.5)
        state = client.request("status")["state"]
        t.check(state == ("latched" if attempt == 2 else "stopping"), f"stop {attempt + 1}: {state}")
        rig.sim.ask("unblock left")
        if attempt < 2:
            t.silence(rig, client, text="listening without reset")
    t.reset(client)
    t.judge(rig)


@scenario("a wheel reboots while driving", 8)
def trap07_reboot_while_driving(t):
    rig, client, stream = t.driving(seconds=0.9, every=0.05)
    rig.fault("reboot right", "ramp", within_ms=80)  # At first it sends nothing: one wheel offline.
    stream.stop(after=0.4)
    status = client.request("status")
    t.check(status["state"] == "latched" and status["cause"] in ("wheel_lost", "wheel_rebooted"), f"{status['state']}, {status['cause']}")
    t.check(rig.wait_status(client, lambda s: s["right"]["at_rest"], 6), "it comes back")
    t.reset(client)
    t.judge(rig)


@scenario("odometry jumps further than a wheel can turn: rebooted", 5)
def trap12_odometry_jump(t):
    rig, client, why = fault_while_driving(t, "ticks right 100000", "wheel_rebooted", 120, side="right")
    t.check(client.request("status")["right"]["reboots"] == 1, "counted as a reboot")
    distance_mm = client.request("status")["right"]["distance_mm"]
    t.check(abs(distance_mm) < 3000, f"and not as a distance: {distance_mm} mm, {why['sentence']}")
    t.reset(client)
    t.judge(rig)


@scenario("force in the wrong unit: invalid with a reason, never rescaled", 8)
def row23_wrong_unit(t):
    rig, client = t.running(sim=("unit left dN",))
    status = rig.wait_status(client, lambda s: s["left"]["force_validity"] == "unit_contradicted", 6)
    t.check(status, f"flagged: {client.request('status')['left']['force_validity']}")
    left = (status or client.request("status"))["left"]
    t.check(left["force_net_mN"] is None and left["unit_evidence"] == "dN", f"no value from it: {left['force_net_mN']}, {left['unit_evidence']}")
    t.arm_and_drive(client, 100, 100, 0.5)
    t.judge(rig)


def force_of(client, side):
    return client.request("status")[side]


@scenario("force at its extremes: saturated, no value; valid again afterwards", 8)
def row23_extremes(t):
    rig, client = t.running()
    ready = rig.wait_status(client, lambda s: all(s[side]["force_validity"] == "valid" for side in ("left", "right")), 6)
    t.check(ready, "valid at first")
    for raw in (-32768, 32767):
        rig.sim.ask(f"raw both {raw}")
        time.sleep(0.3)
        for side in ("left", "right"):
            force = force_of(client, side)
            t.check(
                force["force_validity"] == "saturated" and force["saturated"]["force"] and force["force_net_mN"] is None,
                f"{side} {raw}: {force['force_validity']}, net {force['force_net_mN']} mN",
            )
            t.check(force["force_raw"] == raw, f"{side}: the raw count is shown, {force['force_raw']}")
    rig.sim.ask("raw both auto")
    time.sleep(0.3)
    t.check(all(force_of(client, side)["force_validity"] == "valid" for side in ("left", "right")), "valid again")
    t.arm_and_drive(client, 100, 100, 0.5)
    t.judge(rig)


@scenario("gateway started when the wheels no longer send their offset: own estimate, and reported as such", 9)
def row23_late_start(t):
    rig, client = t.running(sim_args=("--uptime", "100"))
    status = rig.wait_status(client, lambda s: s["left"]["offset_provenance"] != "none", 6)
    t.check(status, f"it does not wait for ever: {force_of(client, 'left')['offset_provenance']}")
    for side in ("left", "right"):
        force = force_of(client, side)
        t.check(force["offset_provenance"] == "estimated", f"{side}: offset {force['offset_provenance']}")
        t.check(abs(force["force_net_mN"]) < 3000, f"{side} without load: {force['force_net_mN']} mN")
    t.arm_and_drive(client, 100, 100, 0.5)  # speed control never waits for an offset
    t.judge(rig)


def loaded_start(t, ticks):
    """The left wheel restarts with 100 N on its shaft, and measures a wrong offset. Net force, or None."""
    rig, client = t.running()
    ready = rig.wait_status(client, lambda s: s["left"]["offset_provenance"] == "wheel", 6)
    t.check(ready and abs(ready["left"]["force_net_mN"]) < 3000, "a good offset at first")
    rig.sim.ask(f"ticks left {ticks}")
    time.sleep(0.2)
    rig.sim.ask("load left 100")
    time.sleep(0.3)
    rig.sim.ask("reboot left")
    time.sleep(4.5)
    force = force_of(client, "left")
    t.figure(f"{force['offset_provenance']}, window {force['offset_window']}, {force['force_validity']}")
    net = force["force_net_mN"]
    t.check(net is None or 90_000 <= net <= 110_000, f"100 N on the shaft show as {net} mN")
    t.judge(rig, moves=False)
    return force


@scenario("a wheel restarts under load, seen by its odometry: its new offset is not used", 9)
def row23_loaded_start(t):
    force = loaded_start(t, 1000)
    t.check(force["offset_window"] in ("loaded", "noisy", "drift"), f"the window is contaminated: {force['offset_window']}")
    t.check(force["offset_provenance"] != "wheel", f"the wheel's new offset is not used: {force['offset_provenance']}")


@scenario("a wheel restarts under load too fast to be detected: its new offset contradicts, no value", 9)
def row23_loaded_start_unseen(t):
    force = loaded_start(t, 0)
    t.check(force["force_validity"] != "valid", f"flagged: {force['force_validity']}, net {force['force_net_mN']} mN")
