# SPDX-License-Identifier: MIT
"""Rows 1 to 4, 6, 7: clients that are killed, freeze, stop reading, compete, reconnect."""

import signal
import socket
import time

from client import Closed
from harness import now_us
from judge_log import Event
from scenario import scenario


def driving_process(t, rig, speed=300, seconds=0.9):
    process = rig.spawn("drive_client.py", rig.path("gateway.sock"), speed, speed)
    deadline = time.monotonic() + 5
    while not rig.bus.setpoints() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(seconds)
    t.check(process.child.poll() is None, f"the client process ended: {process.text()[-300:]}")
    return process


@scenario("client killed: ramp within 60 ms", 5)
def row01_client_killed(t):
    rig, client = t.running()
    process = driving_process(t, rig)
    killed_us = rig.note("gone")
    process.signal(signal.SIGKILL)
    ms = t.first_after(rig, killed_us, lambda speed: speed < 300, "the ramp begins", 60) if not time.sleep(0.3) else None
    t.figure(f"ramp after {ms or 0:.0f} ms")
    t.stopped_by(client, "client_gone", "stopping")
    t.silence(rig, client)
    rig.take_events(process)
    t.judge(rig)


@scenario("client frozen, socket open: the lease alone stops it", 5)
def row02_client_frozen(t):
    rig, client = t.running()
    process = driving_process(t, rig)
    frozen_us = now_us()
    process.signal(signal.SIGSTOP)
    time.sleep(0.8)
    ms = t.first_after(rig, frozen_us, lambda speed: speed == 0, "zero", 200 + 20 + 200 + 40)
    t.figure(f"zero after {ms or 0:.0f} ms")
    t.stopped_by(client, "lease_lost", "stopping")
    stopped = len([1 for _, _, speed in rig.bus.setpoints() if speed])
    process.signal(signal.SIGCONT)
    time.sleep(0.4)
    t.check(len([1 for _, _, speed in rig.bus.setpoints() if speed]) == stopped, "thawed, its commands are refused")
    rig.take_events(process)
    t.judge(rig)


@scenario("client sends and never reads: the loop does not wait, the client is dropped", 15)
def row03_client_never_reads(t):
    rig, observer = t.running()
    client = rig.client("deaf")
    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.request("watch", topics=["state", "frame"], rate_hz=100)
    t.arm(client)
    worst_ms, dropped, begin = 0.0, False, time.monotonic()
    while time.monotonic() - begin < 12 and not dropped:
        t_us = now_us()
        try:
            client.send_raw(b'{"cmd":"drive","left_mm_s":250,"right_mm_s":250}\n' + b'{"cmd":"status"}\n' * 12)
            rig.timeline.append(Event(t_us, "drive", now_us(), True, 250, 250))
        except (TimeoutError, BrokenPipeError, ConnectionResetError):
            dropped = True
        asked_us = now_us()
        observer.request("hello")
        worst_ms = max(worst_ms, (now_us() - asked_us) / 1000)
        time.sleep(0.05)
    if t.check(dropped, "a client that does not read its replies is dropped in the end"):
        # The client detects it only with its next command, so the exact time is not known here.
        rig.timeline.append(Event(observer.request("why")["at_us"], "gone"))
    t.check(worst_ms < 50, f"another client waited {worst_ms:.1f} ms for its answer", True)
    t.figure(f"others answered within {worst_ms:.1f} ms, dropped after {time.monotonic() - begin:.1f} s")
    t.silence(rig, observer, 5, "stopped, then nothing is sent")
    t.judge(rig)


@scenario("two clients: one owner, the lease moves only at standstill", 7)
def row04_two_clients(t):
    rig, first = t.running()
    first.name = "first"
    second = rig.client("second")
    first.request("watch", topics=["lease", "stop"])
    stream = t.start_driving(first, 300, 300, 0.8)
    t.expect(second.drive(0, 0), "not_holder")
    refusal = second.arm()
    t.expect(refusal, "busy")
    t.check("first" in refusal.get("message", ""), f"busy names the owner: {refusal.get('message')}")
    refusal = second.arm(takeover=True)
    t.check(not refusal["ok"] and refusal["error"] in ("not_at_rest", "stale_command"), f"the lease does not move in motion: {refusal}")
    before = len([1 for _, _, speed in rig.bus.setpoints() if speed == 0])
    time.sleep(0.3)
    t.check(len([1 for _, _, speed in rig.bus.setpoints() if speed == 0]) == before, "the owner is undisturbed")
    stream.target = (0, 0)
    t.check(rig.wait_status(second, lambda s: s["left"]["at_rest"] and s["right"]["at_rest"] and s["left"]["applied_mm_s"] == 0, 4), "at standstill")
    time.sleep(0.6)
    t.arm(second, takeover=True)
    refusal = stream.stop(after=0.15)
    t.check(refusal and refusal["error"] == "not_holder", f"the former holder is refused: {refusal}")
    t.check(any(e["event"] == "lease" and e.get("change") in ("lost", "moved") for e in first.collect(0.2)), "the former holder gets an event")
    t.drive_for(second, 150, 150, 0.6)
    t.expect(first.request("stop"))
    time.sleep(0.5)
    t.judge(rig)


@scenario("takeover of an idle lease", 5)
def takeover_at_rest(t):
    rig, first = t.running()
    second = rig.client("second")
    t.arm(first)
    t.expect(first.drive(0, 0))
    t.arm(second, takeover=True)
    t.check(second.request("status")["lease"]["name"] == "second", "the lease has moved")
    first.close()
    time.sleep(0.1)
    t.check(second.request("status")["state"] == "armed", "the former holder may leave without a stop")
    t.drive_for(second, 200, 200, 0.6)
    second.close(holder=True)
    time.sleep(0.6)
    t.judge(rig)


@scenario("reconnect after a loss: zero until a fresh command", 8)
def row06_reconnect_moves_nothing(t):
    rig, observer = t.running()
    client = rig.client("driver")
    t.arm_and_drive(client, 300, 300, 0.8)
    client.close(holder=True)
    again = rig.client("driver")
    again.request("status")
    again.request("watch", topics=["state"], rate_hz=50)
    again.collect(0.4)
    t.expect(again.drive(300, 300), "not_armed")
    t.silence(rig, observer)
    t.arm(again)
    time.sleep(0.5)
    again.close(holder=True)
    time.sleep(0.3)
    t.judge(rig)


@scenario("a nonzero command already there: refused at start and at reset", 8)
def row07_stale_command(t):
    rig = t.rig()
    rig.start_gateway()
    pusher, client = rig.client("pusher"), rig.client("client")
    end = time.monotonic() + 0.8
    refusal = None
    while time.monotonic() < end:
        t.expect(pusher.drive(300, 300), "not_armed")
        refusal = client.arm()
        t.expect(refusal, "stale_command")
        time.sleep(0.02)
    t.check("client" in refusal["message"] or "pusher" in refusal["message"], f"stale_command names the client: {refusal['message']}")
    rig.press()
    rig.release()
    time.sleep(0.1)
    end = time.monotonic() + 1.6
    while time.monotonic() < end:
        t.expect(pusher.drive(300, 300), "latched")
        refusal = client.request("reset")
        t.check(not refusal["ok"], "reset under a nonzero stream must be refused")
        time.sleep(0.02)
    t.expect(refusal, "stale_command")
    time.sleep(0.6)
    t.expect(client.request("reset"))
    t.arm(client)
    time.sleep(0.2)
    t.rule(not any(speed for _, _, speed in rig.bus.setpoints()), "nothing but zeros on the bus")
    t.judge(rig, moves=False)


@scenario("the holder may only pause within its lease", 6)
def lease_is_exact(t):
    rig, client = t.running({"drive": {"lease_ms": 100}})
    t.arm_and_drive(client, 300, 300, 0.8, 0.03)
    time.sleep(0.3)
    t.expect(client.drive(300, 300), "not_armed")
    t.stopped_by(client, "lease_lost", "stopping")
    try:
        client.request("status")
    except Closed:
        t.check(False, "a lost lease does not end the connection")
    t.judge(rig)
