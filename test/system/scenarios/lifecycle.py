# SPDX-License-Identifier: MIT
"""Rows 25, 28, 30 and listen-only: how the gateway starts and ends."""

import itertools
import os
import signal
import struct
import threading
import time

from harness import now_us
from judge_log import LEFT, RIGHT, Event
from scenario import scenario


def crash(t, number):
    rig, _, stream = t.driving(speed=400, seconds=0.8, every=0.05)
    rig.kill_gateway(number)
    killed_us = now_us()
    stream.stop()
    answered_ms = rig.start_gateway(wheels=False, restart_hold=True)
    limit_ms = rig.restart_us / 1000
    t.check(
        answered_ms <= limit_ms, f"answers {answered_ms:.0f} ms after the restart, {limit_ms:.0f} ms allowed", True, need_us=(answered_ms - limit_ms) * 1000
    )
    observer = rig.client("observer")
    time.sleep(0.3)
    again = rig.bus.setpoints(killed_us + 20_000)
    t.check(again and again[0][0] - killed_us < rig.restart_us + 300_000, "zeros soon after the restart")
    t.rule(not any(speed for _, _, speed in again), f"nothing but zeros after the restart: {again[:3]}")
    t.figure(f"answers after {answered_ms:.0f} ms, zeros {(again[0][0] - killed_us) / 1000 if again else 0:.0f} ms after the kill")
    t.check(observer.request("status")["cause"] == "restart", "the cause is the restart")
    t.expect(observer.drive(300, 300), "not_armed")
    t.silence(rig, observer, text="listening after the hold")
    t.arm_and_drive(observer, 200, 200, 0.4)
    t.stop_until_silent(rig, observer)
    observer.close()
    silent_us = now_us()
    rig.kill_gateway(number)
    rig.start_gateway()
    time.sleep(0.3)
    t.rule(not rig.bus.setpoints(silent_us), "killed while listening, nothing is sent at the next start")
    t.judge(rig)


@scenario("kill -9 while driving, restarted: zeros first", 12)
def row25_killed(t):
    crash(t, signal.SIGKILL)


@scenario("after_stop = hold: zeros until release, through a reset and a kill -9", 14)
def hold_until_release(t):
    rig, client = t.running({"drive": {"after_stop": "hold"}})
    t.arm_and_drive(client, 300, 300, 0.8)
    t.expect(client.request("estop"))
    time.sleep(4)
    t.check(client.request("status")["holding"], "a latch is held")
    t.reset(client)
    time.sleep(1)
    status = client.request("status")
    t.check(status["holding"] and status["state"] == "stopping", f"a reset ends the latch, not the hold: {status['state']}")
    rig.kill_gateway(signal.SIGKILL)
    client.close()
    client = rig.connect_to_new(wheels=False, restart_hold=True, name="again")
    time.sleep(3)
    t.check(client.request("status")["holding"], "the next start resumes it")
    sent = [at for at, _, _ in rig.bus.setpoints(now_us() - 1_000_000)]
    t.check(len(sent) > 90 and max(b - a for a, b in itertools.pairwise(sent)) < 100_000, f"{len(sent)} zeros in a second, without a gap")
    t.expect(client.request("release"))
    time.sleep(0.2)
    begin_us = now_us()
    time.sleep(1)
    t.check(not rig.bus.setpoints(begin_us), "nothing is sent after release")
    t.check(client.request("status")["state"] == "listening", "and it listens")


@scenario("abort while driving, restarted: zeros first", 12)
def row25_aborted(t):
    crash(t, signal.SIGABRT)


@scenario("restart after a crash, but another master drives: nothing is sent", 5)
def row25_restart_beside_other_master(t):
    rig, client = t.running()
    t.arm_and_drive(client, 300, 300, 0.6)
    rig.kill_gateway(signal.SIGKILL)
    client.close()
    time.sleep(0.1)
    begin_us = now_us()
    pause = Foreign(rig)
    rig.timeline.append(Event(begin_us, "restart_hold"))
    rig.start_gateway(wheels=False)
    time.sleep(1.0)
    pause.stop()
    sent = rig.bus.setpoints(begin_us)
    span_ms = (sent[-1][0] - sent[0][0]) / 1000 if sent else 0
    t.check(span_ms < 200, f"it stops sending when it receives another master's frames; it sent for {span_ms:.0f} ms")
    t.rule(not any(speed for _, _, speed in sent), "and nothing but zeros")
    t.figure(f"{len(sent)} zero frames in {span_ms:.0f} ms")


class Foreign:
    """Another master that sends zeros every 10 ms."""

    def __init__(self, rig):
        self.quit = threading.Event()
        self.rig = rig
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self):
        frame = struct.pack(">Bhh", 1, 0, 2000)
        while not self.quit.wait(0.01):
            self.rig.bus.send(LEFT, frame)
            self.rig.bus.send(RIGHT, frame)

    def stop(self):
        self.quit.set()
        self.thread.join(1)


def ended_by(t, number):
    rig, _, stream = t.driving(speed=400, seconds=0.9, every=0.05)
    t_us = now_us()
    rig.timeline.append(Event(t_us, "stop", t_us))
    rig.gateway.signal(number)
    time.sleep(0.3)
    rig.gateway.signal(number)
    code = rig.gateway.wait(6)
    ended_us = rig.note("exit")
    stream.stop()
    t.check(code == 0, f"exit code {code}")
    zeros = [at for at, _, speed in rig.bus.setpoints(t_us) if speed == 0]
    t.check(zeros and zeros[-1] - zeros[0] >= 1_450_000, "zeros are held for zero_hold_ms, a second signal changes nothing")
    t.figure(f"exit after {(ended_us - t_us) / 1e6:.2f} s")
    t.check(not os.path.exists(rig.path("gateway.sock")), "the socket is removed")
    quiet_us = now_us()
    rig.start_gateway()
    time.sleep(0.3)
    t.rule(not rig.bus.setpoints(quiet_us), "the next start sends nothing")
    t.judge(rig)


@scenario("SIGTERM: ramp, zeros held, exit 0", 8)
def row25_sigterm(t):
    ended_by(t, signal.SIGTERM)


@scenario("SIGINT: ramp, zeros held, exit 0", 8)
def row25_sigint(t):
    ended_by(t, signal.SIGINT)


@scenario("--listen-only never sends", 4)
def listen_only(t):
    rig = t.rig()
    client = rig.connect_to_new("--listen-only")
    t.expect(client.arm(), "listen_only")
    t.check(not client.drive(200, 200)["ok"], "drive is refused")
    client.request("estop", reason="test")
    t.stop_for(client, 0.2)
    rig.press()
    time.sleep(0.5)
    t.check(client.request("status")["listen_only"] is True, "status reports it")
    t.rule(not rig.bus.setpoints(), "nothing is sent")
    rig.gateway.signal(signal.SIGTERM)
    t.check(rig.gateway.wait(3) == 0, "ends immediately")
    t.judge(rig, moves=False)


def second_gateway(t, rig, *extra):
    """Starts another gateway on the same bus; returns its exit code and output."""
    command = rig.gateway_command(*extra)
    other = rig.launch(command, "second.out")
    return other.wait(3), other.text()


@scenario("a second gateway on the same bus refuses and sends nothing", 5)
def row30_two_gateways(t):
    rig, client, stream = t.driving(speed=250, seconds=0.4, every=0.05)
    os.mkdir(rig.path("elsewhere"))
    for extra in ((), ("--socket", rig.path("other.sock")), ("--socket", rig.path("elsewhere/gateway.sock"))):
        code, text = second_gateway(t, rig, *extra)
        t.check(code == 69, f"exit code {code} with {extra}: {text[-200:]}")
        t.check("gateway" in text and len(text) > 40, f"it prints the reason: {text[-200:]}")
        t.check(str(rig.gateway.child.pid) in text, f"it names the process: {text[-200:]}")
    t.check(os.path.exists(rig.path("gateway.sock")), "the first one's socket is still there")
    t.check(stream.stop() is None, f"the first one drives on: {stream.refusal}")
    t.expect(client.request("stop"))
    time.sleep(0.5)
    t.judge(rig)


@scenario("the socket's path exists: replaces its own leftover, refuses anything else", 4)
def row28_socket_path(t):
    rig = t.rig()
    path = rig.path("gateway.sock")
    for make, what in (
        (lambda: open(path, "w", encoding="ascii").close(), "a file"),
        (lambda: os.symlink("/dev/null", path), "a symlink"),
        (lambda: os.mkdir(path), "a directory"),
    ):
        make()
        gateway = rig.launch(rig.gateway_command(), "refused.out")
        code = gateway.wait(3)
        t.check(code not in (0, None), f"{what} in place of the socket: exit code {code}")
        t.check(path in gateway.text(), f"{what}: the message names the path: {gateway.text()[-200:]}")
        t.check(os.path.lexists(path), f"{what} is left alone")
        os.rmdir(path) if os.path.isdir(path) else os.unlink(path)
    rig.start_gateway()
    rig.kill_gateway(signal.SIGKILL)
    t.check(os.path.exists(path), "a killed gateway leaves its socket")
    rig.start_gateway()
    t.expect(rig.client().request("hello"))
    t.judge(rig, moves=False)
