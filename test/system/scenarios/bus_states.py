# SPDX-License-Identifier: MIT
"""Rows 16, 17 and 21 on the local bus: states of the controller, frames that wait, a full bus.

What is done to the bus is an argument where the same scenario also runs on a `can` device of a real kernel (test/kernel).
"""

import json
import time

from bus import ERROR
from harness import now_us
from judge_log import LEFT, RIGHT, Event
from scenario import scenario

from .clients import driving_process


def drive_again(t, rig, client, seconds=8):
    """Both wheels are online, reset is accepted, nothing moves without a command, and it drives."""
    online_again = rig.wait_at_rest(client, seconds, active=True)
    if not t.check(online_again, f"online again: {client.request('status')['bus']}"):
        return
    t.reset(client)
    t.arm_and_drive(client, 200, 200, 0.5)
    t.stop_for(client, 0.3)


def only_zeros(t, rig, since_us):
    """Nothing but zeros from then until the next arm."""
    armed = [event.t_us for event in rig.timeline if event.kind == "arm" and event.ok and event.t_us > since_us]
    until_us = min(armed, default=now_us())
    late = [(at - since_us, speed) for at, _, speed in rig.bus.setpoints(since_us) if at < until_us]
    moving = [frame for frame in late if frame[1]]
    t.measure("stale_frames", len(moving))
    t.rule(not moving, f"old frames after the bus came back: {moving[:6]}")
    t.figure(f"{len(late)} zero frames after the fault ended")


def judge_repaired(t, rig, client, repair):
    """After `repair` the bus works again: it drives, and nothing old is sent before."""
    repair()
    back_us = rig.note("alive")
    drive_again(t, rig, client)
    only_zeros(t, rig, back_us)
    t.judge(rig)


def bus_off(t, off, on):
    """`off` and `on` disconnect the controller from the bus and connect it again."""
    rig, client, stream = t.driving()
    observer = rig.client("observer")
    observer.request("watch", topics=["bus", "stop"])
    begin_us = now_us()
    rig.cut_by(lambda: off(rig), 30)
    stream.stop(after=0.3)
    why = t.stopped_by(client, "bus_down")
    t.check(why["detail"] == 1, f"detail 1 is bus-off, it is {why['detail']}")
    t.measure("stop_ms", (why["at_us"] - begin_us) / 1000)
    t.check(client.request("status")["bus"]["state"] == "bus_off", f"bus {client.request('status')['bus']}")
    t.check(not client.request("reset")["ok"], "no reset while bus-off")
    t.check(any(e["event"] == "bus" and e["state"] == "bus_off" for e in observer.collect(0.1)), "the event comes")
    t.check("bus-off" in rig.gateway.text().lower(), f"the log reports bus-off: {rig.gateway.text()[-300:]}")
    judge_repaired(t, rig, client, lambda: on(rig))


def bus_off_listening(t, off, on):
    rig, client = t.running()
    off(rig)
    time.sleep(0.2)
    t.expect(client.arm(), "bus_down")
    t.check(client.request("status")["state"] == "listening", "not latched")
    on(rig)
    time.sleep(1.2)
    t.rule(not rig.bus.setpoints(), "nothing was sent")
    t.drive_and_judge(rig, client)


def error_passive(t, passive, active):
    rig, client, stream = t.driving()
    passive(rig)
    time.sleep(0.3)
    t.check(client.request("status")["bus"]["state"] == "passive", f"bus {client.request('status')['bus']}")
    t.check(client.request("status")["state"] == "armed", "it drives on")
    active(rig)
    time.sleep(0.3)
    t.check(client.request("status")["bus"]["state"] == "active", f"bus {client.request('status')['bus']}")
    t.check(stream.stop() is None, "the stream was not refused")
    t.stop_for(client, 0.4)
    t.judge(rig)


def error_flood(t, errors, active):
    """`errors(rig, n)` makes the n-th part of the flood."""
    rig, client, stream = t.driving()
    for number in range(50):  # Spends the lines that the log may print in one burst: how many are left depends on those of the start.
        errors(rig, number)
        time.sleep(0.005)
    lines = len(rig.gateway.text().splitlines())
    cpu, begin = rig.gateway.cpu_seconds(), time.monotonic()
    for number in range(400):
        errors(rig, number)
        time.sleep(0.005)
    percent = 100 * (rig.gateway.cpu_seconds() - cpu) / (time.monotonic() - begin)
    active(rig)
    time.sleep(0.2)
    more = len(rig.gateway.text().splitlines()) - lines
    t.check(more <= 40, f"{more} lines of log for 400 bursts of error frames in 2 s")
    t.check(client.request("status")["state"] == "armed", f"it drives on: {client.request('why').get('sentence')}")
    t.check(stream.stop() is None, "the stream was not refused")
    t.figure(f"{more} lines of log, {percent:.0f} % CPU")
    t.stop_for(client, 0.4)
    t.judge(rig)


def control(words):
    return lambda rig: rig.sim.ask(words)


@scenario("bus-off in motion: stop, latched, reported; restarted: reset, drives again", 8)
def row16_bus_off(t):
    bus_off(t, control("busoff on"), control("busoff off"))


@scenario("bus-off while listening: an event, arm refused, nothing sent", 5)
def row16_bus_off_listening(t):
    bus_off_listening(t, control("busoff on"), control("busoff off"))


def forged_end(t, forge):
    """While the controller is off the bus, another node sends error frames that report the opposite."""
    rig, client, stream = t.driving()
    rig.cut_by(lambda: rig.sim.ask("busoff on"), 30)
    time.sleep(0.1)
    forge(rig)
    stream.stop(after=0.5)
    t.check(client.request("status")["bus"]["state"] == "bus_off", f"the forged frames have no effect: {client.request('status')['bus']}")
    judge_repaired(t, rig, client, lambda: rig.sim.ask("busoff off"))


@scenario("bus-off, and forged error frames that report its end: ignored, and no send remains stalled", 10)
def row16_bus_off_forged_end(t):
    def forge(rig):
        for can_id, data in ((0x100, bytes(8)), (0x04, bytes([0, 0x40, 0, 0, 0, 0, 0, 0])), (0x04, bytes([0, 0x30, 0, 0, 0, 0, 0, 0]))):
            rig.bus.send(ERROR | can_id, data)

    forged_end(t, forge)


@scenario("bus-off, and a forged error frame that reports another one: no send remains stalled", 10)
def row16_bus_off_forged_twice(t):
    forged_end(t, lambda rig: rig.bus.send(ERROR | 0x40, bytes(8)))


@scenario("error passive in motion: shown, it drives on; active again: shown", 5)
def row16_error_passive(t):
    error_passive(t, control("passive on"), control("passive off"))


@scenario("a flood of error frames: it drives on, the log is rate-limited", 6)
def row16_error_flood(t):
    error_flood(t, lambda rig, number: rig.sim.ask(f"passive {'off' if number % 2 else 'on'}"), control("passive off"))


# Row 17: no node acknowledges, or the bus accepts nothing ----------------------------------------------------------------


def held_up(t, words, seconds, causes):
    """The bus holds our frames for that long; what was held comes out as one old frame per wheel at most, its zero behind it."""
    rig, client, stream = t.driving({"drive": {"accel_mm_s2": 2000}}, speed=600, seconds=0.8)
    rig.fault(f"{words} on" if words == "stall" else f"{words} off", within_ms=70)
    rig.note("dead")
    stream.stop(after=seconds)
    why = client.request("why")
    t.check(why["cause"] in causes, f"cause {why['cause']}, one of {causes} expected")
    t.check(client.request("status")["state"] == "latched", "latched")
    back_us = now_us()
    rig.sim.ask(f"{words} off" if words == "stall" else f"{words} on")
    rig.timeline.append(Event(back_us, "alive", back_us))  # What was held comes out before the simulator answers.
    time.sleep(0.3)
    for side in (LEFT, RIGHT):
        speeds = [speed for _, can_id, speed in rig.bus.setpoints(back_us) if can_id == side]
        moving = [speed for speed in speeds if speed]
        t.measure("stale_frames", len(moving))
        t.check(len(moving) <= 1 and not any(speeds[1:]), f"{side}: one old frame at most, then zeros: {speeds[:6]}")
    t.figure(f"stopped by {why['cause']}")
    drive_again(t, rig, client)
    t.judge(rig)


@scenario("no echo for 300 ms in motion: stop, latched; no stale frame is sent afterwards", 7)
def row17_no_acknowledge(t):
    held_up(t, "ack", 0.3, ("send_stalled",))


@scenario("the bus accepts no frame for 2 s in motion: stop, latched; no stale frame is sent afterwards", 8)
def row17_stall(t):
    held_up(t, "stall", 2.0, ("send_stalled", "wheel_lost"))


# Row 21 ------------------------------------------------------------------------------------------------------------------


def forget(t, rig, can_id):
    """The babbling node's frames are not the gateway's, and not judged. A gap in a log that lacks setpoints which the wheels have received proves
    nothing: the recorder was too slow for the flood.
    """
    rig.bus.frames[:] = [frame for frame in rig.bus.frames if frame.id != can_id]
    status = json.loads(rig.sim.ask("status"))
    time.sleep(0.05)
    if len(rig.bus.setpoints()) < sum(status[side]["setpoints"] for side in ("left", "right")):
        t.stalls.append((now_us(), now_us() - rig.timeline[0].t_us))


@scenario("a babbling node with an id above 545 on a full bus: invariant 4 holds", 7, native="a flood")
def row21_babble_high(t):
    rig, client = t.running()
    driver = driving_process(t, rig)  # In a separate process, because this one must record 9000 frames a second.
    rig.sim.ask("babble 600 100 on")
    time.sleep(3.0)
    load = client.request("status")["bus"]["load_permille"]
    rig.sim.ask("babble 600 100 off")
    t.check(client.request("status")["state"] == "armed", f"it drives on: {client.request('why').get('sentence')}")
    t.figure(f"{len([1 for frame in rig.bus.frames if frame.id == 0x600]) / 3:.0f} foreign frames/s, load {load} permille")
    time.sleep(0.1)
    t.stop_for(client, 0.6)
    rig.take_events(driver)
    forget(t, rig, 0x600)
    t.judge(rig)


@scenario("a babbling node with the lowest id on a full bus: send_stalled, latched; from zero afterwards", 7, native="a flood")
def row21_babble_low(t):
    rig, client, stream = t.driving()
    rig.fault("babble 001 100 on", within_ms=70)
    rig.note("dead")
    stream.stop(after=0.5)
    why = client.request("why")
    t.check(why["cause"] in ("send_stalled", "wheel_lost"), f"cause {why['cause']}")
    t.check(client.request("status")["state"] == "latched", "latched")
    rig.sim.ask("babble 001 100 off")
    rig.note("alive")
    t.figure(f"stopped by {why['cause']}")
    drive_again(t, rig, client)
    forget(t, rig, 0x001)
    t.judge(rig)
