# SPDX-License-Identifier: MIT
"""Rows 15 (local bus), 18, 19, 20: power lost, other masters, frames that are not valid."""

import signal
import struct
import time

from bus import EXTENDED, REMOTE, ERROR
from harness import now_us
from judge_log import LEFT, RIGHT, Event
from scenario import scenario

FOREIGN_ZERO = struct.pack(">Bhh", 1, 0, 2000)
SETPOINT = struct.pack(">Bhh", 1, 300, 2000)


def power_cut(t, seconds, speed):
    rig, client, stream = t.driving({"drive": {"accel_mm_s2": 2000}}, speed=speed, seconds=1.0, every=0.05)
    rig.fault("power off", within_ms=70)
    rig.note("dead")
    stream.stop(after=0.3)
    why = t.stopped_by(client, "wheel_lost") if client.request("why")["cause"] != "send_stalled" else t.stopped_by(client, "send_stalled")
    refusal = client.request("reset")
    t.check(not refusal["ok"], "reset is refused until the wheels are online")
    time.sleep(seconds - 0.4)
    back_us = now_us()
    rig.sim.ask("power on")
    rig.timeline.append(Event(back_us, "alive", now_us()))
    t.check(rig.wait_at_rest(client, 10), "the wheels are online again")
    time.sleep(0.5)
    late = [(at, side, value) for at, side, value in rig.bus.setpoints(back_us)]
    moving = [entry for entry in late if entry[2]]
    t.check(
        len([e for e in moving if e[1] == LEFT]) <= 1 and len([e for e in moving if e[1] == RIGHT]) <= 1,
        f"at most one old frame per wheel came out: {[(at - back_us, side, value) for at, side, value in moving]}",
    )
    t.check(max(abs(rig.bus.speed_rpm(side)) for side in (0, 1)) <= 2, "the wheels are at standstill")
    t.reset(client)
    t.figure(f"{why['cause']}, {len(moving)} old and {len(late) - len(moving)} zero frames afterwards")
    t.arm_and_drive(client, 200, 200, 0.5)
    t.stop_for(client, 0.4)
    judge = t.judge(rig)
    t.figure(f"residual {judge.residual}")


@scenario("wheel power cut for 10 s at full command, then back", 18)
def row18_power_cut_10_s(t):
    power_cut(t, 10.0, 800)


@scenario("wheel power cut for 0.6 s at full command, then back", 8)
def row18_power_cut_short(t):
    power_cut(t, 0.6, 800)


def foreign(t, can_id, data):
    """A setpoint of another process in motion."""
    rig, client, stream = t.driving()
    rig.note("cut", within_us=30_000)
    foreign_us = now_us()
    rig.bus.send(can_id, data)
    stream.stop(after=0.2)
    ms = t.first_after(rig, foreign_us, lambda speed: speed == 0, "zero after the foreign frame", 30)
    t.figure(f"zero after {ms or 0:.1f} ms")
    why = t.stopped_by(client, "second_master")
    t.check(
        why["detail"] == can_id and str(can_id) in why["sentence"] and f"0x{can_id:03X}" in why["sentence"],
        f"why names the id: {why['detail']}, {why['sentence']}",
    )
    reasons = t.reset(client)
    t.check("cause_present" in reasons or "second_master" in reasons or "stale_command" in reasons, f"reset waits: {set(reasons)}")
    t.judge(rig)


@scenario("a second master while driving: stop, latched", 6)
def row19_second_master_driving(t):
    foreign(t, RIGHT, SETPOINT)


@scenario("a foreign zero while driving counts as well: stop, latched", 6)
def row19_foreign_zero(t):
    foreign(t, LEFT, FOREIGN_ZERO)


@scenario("a second master while stopping: latched", 5)
def row19_second_master_stopping(t):
    rig, client = t.running()
    t.arm_and_drive(client, 300, 300, 0.7)
    t.stop_for(client, 0.6)
    rig.note("cut", within_us=30_000)
    rig.bus.send(LEFT, FOREIGN_ZERO)
    time.sleep(0.1)
    t.stopped_by(client, "second_master")
    t.judge(rig)


@scenario("a second master while listening: nothing is sent, arm refused", 6)
def row19_second_master_listening(t):
    rig, client = t.running()
    client.request("watch", topics=["stop"])
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        rig.bus.send(LEFT, FOREIGN_ZERO)
        rig.bus.send(RIGHT, FOREIGN_ZERO)
        time.sleep(0.02)
        if end - time.monotonic() < 0.9:  # The gateway has received the first frames by then.
            t.expect(client.arm(), "second_master")
    t.check(client.request("status")["state"] == "listening", "it is an event, not a latch")
    t.check(any(e["event"] == "fault" and e["cause"] == "second_master" for e in client.collect(0.1)), "and the event comes")
    t.rule(not rig.bus.setpoints(), "nothing is sent")
    time.sleep(1.1)
    t.drive_and_judge(rig, client)


@scenario("forged error frames of a local process: nothing is sent while listening, never motion, no latch", 5)
def row19_forged_error_frames(t):
    rig, client = t.running()
    for _ in range(50):
        rig.bus.send(ERROR | 0x40, bytes(8))
        rig.bus.send(ERROR | 0x04, bytes([0, 0x30, 0, 0, 0, 0, 0, 0]))
        time.sleep(0.01)
    t.rule(not rig.bus.setpoints(), "nothing is sent while listening")
    rig.bus.send(ERROR | 0x100, bytes(8))
    time.sleep(1.3)
    status = client.request("status")
    t.check(status["state"] == "listening", f"listening: {status['state']}, {status['cause']}")
    t.arm_and_drive(client, 200, 200, 0.5)
    t.figure(f"bus {client.request('status')['bus']['state']}")
    t.judge(rig)


def feed(rig, seconds, can_id, data):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        rig.bus.send(can_id, data)
        time.sleep(0.004)


@scenario("remote, extended, FD and short frames on known ids: counted, but the wheel counts as offline", 7)
def row20_odd_frames(t):
    rig, client = t.running()
    before = client.request("status")["counters"]
    stream = t.start_driving(client, 300, 300, 0.6)
    speed = struct.pack(">hh", 15, 0)
    rig.fault("mute left", "ramp", within_ms=80)
    muted_us, end, odd, short = now_us(), time.monotonic() + 0.3, 0, 0
    while time.monotonic() < end:
        rig.bus.send(256 | REMOTE, b"", 4)
        rig.bus.send(256 | EXTENDED, speed)
        rig.bus.send(256, speed[:3])
        if rig.bus.carries_fd:
            rig.bus.send_fd(256, speed + bytes(8))
        odd, short = odd + 2 + rig.bus.carries_fd, short + 1
        time.sleep(0.004)
    stream.stop()
    ms = t.first_after(rig, muted_us, lambda value: value < 300, "a ramp although odd frames came", 80)
    t.figure(f"ramp after {ms or 0:.0f} ms")
    t.stopped_by(client, "wheel_lost")
    for name, sent in (("bad_format", odd), ("bad_length", short)):
        counted = rig.wait_status(client, lambda s, name=name, sent=sent: s["counters"][name] - before[name] >= sent, 1)
        t.check(counted, f"each is counted as {name}: {client.request('status')['counters'][name] - before[name]} of {sent}")
    feed(rig, 0.3, 256, bytes(8))
    t.check(client.request("status")["left"]["heard"], "a longer frame is accepted")
    rig.sim.ask("unmute left")
    t.reset(client)
    t.judge(rig)


@scenario("odd frames on the setpoints' ids: no second master, nothing moves", 5)
def row20_odd_setpoints(t):
    rig, client, stream = t.driving()
    rig.bus.send(LEFT | EXTENDED, SETPOINT)
    rig.bus.send(RIGHT | REMOTE, b"", 5)
    time.sleep(0.2)
    t.check(client.request("status")["state"] == "armed", "an extended frame is not ours, and no setpoint")
    stream.stop()
    t.stop_for(client, 0.3)
    t.judge(rig)


@scenario("the bus disappears and returns: stop, found again, nothing moves", 9)
def row15_bus_gone(t):
    rig, client, stream = t.driving(every=0.05)
    first_bus = rig.bus
    rig.note("cut", within_us=60_000)
    rig.sim.process.signal(signal.SIGKILL)
    rig.note("dead")
    rig.sim.process.wait(2)
    stream.stop(after=0.3)
    status = client.request("status")
    t.check(status["state"] == "latched" and status["cause"] in ("bus_down", "estop_line"), f"{status['state']}, {status['cause']}")
    first_bus.close()
    rig.restart_sim(first_bus.frames)
    back_us = rig.note("alive")
    t.check(rig.wait_at_rest(client, 6, active=True), "found again")
    t.reset(client)
    time.sleep(0.3)
    late = rig.bus.setpoints(back_us)
    t.rule(not any(speed for _, _, speed in late), f"nothing but zeros after the return: {late[:4]}")
    t.figure(f"{len(late)} zero frames after the return")
    t.judge(rig)
