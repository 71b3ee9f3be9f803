# SPDX-License-Identifier: MIT
"""Rows 19 to 21 on SocketCAN: foreign setpoints of other processes, forged error frames, odd frames, a full bus."""

import struct
import threading
import time

from bus import ERROR, EXTENDED, REMOTE
from catalogue import kernel_test
from harness import now_us
from judge_log import LEFT, RIGHT
from scenarios.bus_faults import wait_reset
from scenarios.process import driving


SETPOINT = struct.pack(">Bhh", 1, 300, 2000)
ZERO = struct.pack(">Bhh", 1, 0, 2000)


class Sender(threading.Thread):
    """Frames (id, data) of another process than the gateway, every `every` seconds, until stopped.

    They go out by the recorder's socket, so that it knows them from the gateway's.
    """

    def __init__(self, bus, frames, every):
        super().__init__(daemon=True)
        self.bus, self.list, self.every = bus, frames, every
        self.quit, self.count, self.full = threading.Event(), 0, 0
        self.start()

    def run(self):
        due = time.monotonic()
        while not self.quit.is_set():
            for can_id, data in self.list:
                try:
                    self.bus.send(can_id, data)
                    self.count += 1
                except OSError:
                    self.full += 1
            due += self.every
            self.quit.wait(max(0, due - time.monotonic()))

    def stop(self):
        self.quit.set()
        self.join(3)


def foreign(t, can_id, data):
    rig, client, stream = driving(t)
    rig.note("cut", within_us=30_000)
    foreign_us = now_us()
    rig.bus.send(can_id, data)
    time.sleep(0.2)
    stream.stop()
    ms = t.first_after(rig, foreign_us, lambda speed: speed == 0, "zero after the foreign frame", 30)
    t.figure(f"zero after {ms or 0:.1f} ms")
    why = t.stopped_by(client, "second_master")
    t.check(why["detail"] == can_id, f"why names the id: {why['detail']}")
    wait_reset(t, client)
    t.judge(rig)


@kernel_test("one foreign setpoint of another local process in motion: stop, latched", "bus realtime-full", 19)
def row19_other_process(t):
    foreign(t, RIGHT, SETPOINT)


@kernel_test("a foreign zero counts as well", "bus", 19)
def row19_foreign_zero(t):
    foreign(t, LEFT, ZERO)


@kernel_test("a foreign master while listening: nothing is sent, arm refused", "bus", 19)
def row19_while_listening(t):
    rig, client = t.running()
    sender = Sender(rig.bus, [(LEFT, ZERO), (RIGHT, ZERO)], 0.02)
    time.sleep(0.3)
    for _ in range(20):
        t.expect(client.arm(), "second_master")
        time.sleep(0.02)
    t.check(client.request("status")["state"] == "listening", "not latched")
    sender.stop()
    t.rule(not rig.bus.setpoints(), "nothing is sent")
    time.sleep(1.2)
    t.arm(client)
    t.drive_for(client, 200, 200, 0.5)
    t.judge(rig)


@kernel_test("forged error frames of a local process: detected, never motion", "bus", 19)
def row19_forged_errors(t):
    rig, client = t.running()
    sender = Sender(rig.bus, [(ERROR | 0x40, bytes(8)), (ERROR | 0x04, b"\0\x30\0\0\0\0\0\0")], 0.01)
    time.sleep(0.5)
    t.rule(not rig.bus.setpoints(), "nothing is sent while listening")
    sender.stop()
    rig.bus.send(ERROR | 0x100, bytes(8))
    time.sleep(1.3)
    status = client.request("status")
    t.check(status["state"] == "listening", f"listening: {status['state']}, {status['cause']}")
    t.arm(client)
    t.drive_for(client, 200, 200, 0.5)
    t.figure(f"bus {client.request('status')['bus']['state']}")
    t.judge(rig)


@kernel_test("remote, extended, FD and short frames on known ids: counted, no sign of life", "bus", 20)
def row20_odd_frames(t):
    rig, client, stream = driving(t)
    before = client.request("status")["counters"]
    rig.fault("mute left", "ramp", within_ms=80)
    muted_us, end = now_us(), time.monotonic() + 0.3
    speed = struct.pack(">hh", 15, 0)
    while time.monotonic() < end:
        rig.bus.send(256 | REMOTE, b"", 4)
        rig.bus.send(256 | EXTENDED, speed)
        rig.bus.send(256, speed[:3])
        rig.bus.send_fd(256, speed + bytes(8))
        time.sleep(0.004)
    stream.stop()
    ms = t.first_after(rig, muted_us, lambda value: value < 300, "a ramp although odd frames came", 80)
    t.figure(f"ramp after {ms or 0:.0f} ms")
    t.stopped_by(client, "wheel_lost")
    after = client.request("status")["counters"]
    odd = after["bad_format"] - before["bad_format"]
    t.check(odd >= 150, f"remote, extended and FD frames counted: {odd} of about 225")
    short = after["bad_length"] - before["bad_length"]
    t.check(short >= 50, f"short frames counted: {short} of about 75")
    rig.sim.ask("unmute left")
    wait_reset(t, client)
    t.judge(rig)


@kernel_test("odd frames on the setpoints' ids: no second master, nothing moves", "bus", 20)
def row20_odd_setpoints(t):
    rig, client, stream = driving(t)
    rig.bus.send(LEFT | EXTENDED, SETPOINT)
    rig.bus.send(RIGHT | REMOTE, b"", 5)
    time.sleep(0.2)
    t.check(client.request("status")["state"] == "armed", "an extended frame is not ours, and no setpoint")
    stream.stop()
    client.request("stop")
    time.sleep(0.3)
    t.judge(rig)


def babble(t, ids, every, seconds=3.0):
    rig, client, stream = driving(t)
    sender = Sender(rig.bus, [(can_id, bytes(8)) for can_id in ids], every)
    cpu, begin = rig.gateway.cpu_seconds(), time.monotonic()
    time.sleep(seconds)
    percent = 100 * (rig.gateway.cpu_seconds() - cpu) / (time.monotonic() - begin)
    sender.stop()
    refusal = stream.stop()
    t.check(refusal is None, f"the owner was refused: {refusal}")
    t.check(client.request("status")["state"] == "armed", "it drives on")
    t.figure(f"{sender.count / seconds:.0f} foreign frames/s, {percent:.0f} % CPU")
    client.request("stop")
    time.sleep(0.6)
    t.judge(rig)


@kernel_test("8000 frames/s of unknown ids: invariant 4 holds", "bus", 21, pace=1)
def row21_full_bus(t):
    babble(t, (0x600, 0x601, 0x602, 0x603, 0x604, 0x605, 0x606, 0x607), 0.001)


@kernel_test("2000 frames/s of low ids: invariant 4 holds where frames are not held up", "bus", 21, pace=1)
def row21_low_ids(t):
    babble(t, (1, 2), 0.001)


@kernel_test("a flood of unknown ids by the clock on the wall", "realtime", 21)
def row21_real_time(t):
    babble(t, (0x600, 0x601, 0x602, 0x603), 0.002)
