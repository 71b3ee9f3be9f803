# SPDX-License-Identifier: MIT
"""A rig with the bridge: gateway and simulator of the system tests, a tap between gateway and bridge that writes the timeline, and a peer."""

import json
import os
import select
import socket
import threading
import time

from bus import now_us
from free_domain import free_domain
from harness import Process, wait_connect
from judge_log import Event
from peer import Peer
from settings_file import write_settings

TIMELINE = {"arm": "arm", "drive": "drive", "twist": "drive", "stop": "stop", "disarm": "stop", "estop": "estop", "reset": "reset"}


class Tap(threading.Thread):
    """Passes all lines between bridge and gateway on, and records requests and replies for the judge."""

    def __init__(self, path, gateway_path, timeline):
        super().__init__(daemon=True)
        self.gateway_path, self.timeline = gateway_path, timeline
        self.twists = []  # (t_us, v, yaw) of the bridge's requests
        self.armed = False
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(path)
        self.server.listen(8)
        self.start()

    def run(self):
        while True:
            try:
                bridge, _ = self.server.accept()
            except OSError:
                return
            gateway = socket.socket(socket.AF_UNIX)
            try:
                gateway.connect(self.gateway_path)
            except OSError:
                gateway.close()
                bridge.close()
                continue
            threading.Thread(target=self.pass_on, args=(bridge, gateway), daemon=True).start()

    def pass_on(self, bridge, gateway):
        asked, rests = {}, {bridge: b"", gateway: b""}
        while True:
            for source in select.select([bridge, gateway], [], [])[0]:
                try:
                    data = source.recv(1 << 18)
                except OSError:
                    data = b""
                other = gateway if source is bridge else bridge
                t_us = now_us()
                try:
                    if data:
                        other.sendall(data)
                except OSError:
                    data = b""
                if not data:
                    if self.armed:
                        self.timeline.append(Event(t_us, "gone"))
                    self.armed = False
                    bridge.close()
                    gateway.close()
                    return
                lines = (rests[source] + data).split(b"\n")
                rests[source] = lines.pop()
                for line in lines:
                    self.note(line, source is bridge, t_us, asked)

    def note(self, line, request, t_us, asked):
        if not request and not line.startswith(b'{"id":'):
            if b'"event":"stop"' in line and b'"cause":"lease_lost"' in line:
                self.timeline.append(Event(json.loads(line)["at_us"], "ramp", within_us=20_000))
            return
        message = json.loads(line)
        if request:
            asked[message["id"]] = (t_us, message)
            if message["cmd"] == "twist":
                self.twists.append((t_us, message["v_mm_s"], message["yaw_mrad_s"]))
            return
        begin_us, was = asked.pop(message["id"], (0, {"cmd": None}))
        kind = TIMELINE.get(was["cmd"])
        if kind == "drive":
            self.timeline.append(Event(begin_us, kind, t_us, message["ok"], message.get("left_mm_s", 1), message.get("right_mm_s", 1)))
        elif kind:
            self.timeline.append(Event(begin_us, kind, t_us, message["ok"]))
        self.armed = message["ok"] if kind == "arm" else (self.armed and kind not in ("stop", "estop"))


class Stream(threading.Thread):
    """Publishes cmd_vel at a rate until it is stopped; `make()` returns the message, or (message, source time in ns)."""

    def __init__(self, writer, make, every=0.05):
        super().__init__(daemon=True)
        self.writer, self.make, self.every, self.quit = writer, make, every, threading.Event()
        self.start()

    def run(self):
        due = time.monotonic()
        while not self.quit.is_set():
            made = self.make()
            self.writer.write(*made if isinstance(made, tuple) else (made,))
            due += self.every
            self.quit.wait(max(0, due - time.monotonic()))

    def stop(self):
        self.quit.set()
        self.join(2)


# These limits fit any machine, however busy: the scenarios judge the bridge.
PATIENT = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}}


class Ride:
    """`settings`: sections of ros2.conf."""

    def __init__(self, t, settings=None, config=None, gateway=True, start=True, **options):
        self.t, self.rig = t, t.rig({**PATIENT, **(config or {})}, **options)
        self.settings = {"gateway": {"socket": self.rig.path("tap.sock")}, "ros": {"network": "loopback"}}
        for section, keys in (settings or {}).items():
            self.settings.setdefault(section, {}).update(keys)
        ros = self.settings["ros"]
        self.domain = ros["domain"] = ros.get("domain") or free_domain()
        self.tap = Tap(self.rig.path("tap.sock"), self.rig.path("gateway.sock"), self.rig.timeline)
        self.conf = self.rig.path("ros2.conf")
        write_settings(self.conf, self.settings)
        if gateway:
            self.rig.start_gateway()
            self.client = self.rig.client()
        self.bridge = None
        if start:
            self.start_bridge()
        self.peer = Peer(self.domain, ros.get("namespace", ""), ros.get("release", "jazzy").upper())
        self.state = self.peer.reader("iwheel/state", "std_msgs/msg/String", depth=50, transient=True)
        self.diagnostics = self.peer.reader("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", depth=50)
        if start and gateway:
            t.check(self.await_state(lambda s: s["gateway"] == "up"), f"the bridge finds the gateway: {self.bridge.text()}")

    def program(self):
        return os.path.join(self.rig.build, "app", "bridge", "ros2", "iwheel-ros2")

    def start_bridge(self, setup=None):
        self.bridge = Process([self.program(), "-c", self.conf], self.rig.path("bridge.out"), setup)
        self.rig.processes.append(self.bridge)
        return self.bridge

    def await_state(self, wanted, seconds=4.0):
        message = self.state.wait(lambda m: wanted(json.loads(m.data)), seconds)
        return json.loads(message.data) if message else None

    def await_diagnosis(self, name, part, seconds=4.0):
        """Waits for a status of that name with these words; returns its level, or None."""

        def find(message):
            return [s for s in message.status if s.name == f"iwheel: {name}" and part in s.message]

        message = self.diagnostics.wait(find, seconds)
        return find(message)[0].level if message else None

    def commands(self, stamped=False):
        writer = self.peer.writer("cmd_vel", "geometry_msgs/msg/" + ("TwistStamped" if stamped else "Twist"))
        writer.await_match()
        return writer

    def stream(self, v, yaw=0.0, writer=None, every=0.05):
        message = self.peer.twist(v, yaw)
        return Stream(writer or self.commands(), lambda: message, every)

    def arm(self):
        """Arms through the service; repeats for a while, until the wheels are at standstill."""
        for _ in range(60):
            answer = self.peer.call("iwheel/arm")
            if answer and answer[0]:
                break
            time.sleep(0.05)
        self.t.check(answer is not None and answer[0], f"arm by the service: {answer}")
        return answer

    def driving(self, v=0.3, yaw=0.0, seconds=0.8, every=0.05):
        """Arms and drives; returns the stream."""
        writer = self.commands()
        self.arm()
        stream = self.stream(v, yaw, writer, every)
        time.sleep(seconds)
        self.t.check(self.moving(), f"the wheels are driven: {self.client.request('status')['state']}, {self.bridge.text()[-300:]}")
        return stream

    def resumes(self, stream, seconds, what, v=0.3):
        """The publisher of an earlier stream sends again, and the wheels turn; returns the new stream."""
        stream = self.stream(v, writer=stream.writer)
        time.sleep(seconds)
        self.t.check(self.moving(), what)
        return stream

    def refuses(self, verb, part, what, **options):
        """Checks that the call of the service is refused, with these words in its reason."""
        answer = self.peer.call(f"iwheel/{verb}", **options)
        self.t.check(answer and not answer[0] and part in answer[1], f"{what}: {answer}")

    def moving(self, since_us=None):
        return any(speed for _, _, speed in self.rig.bus.setpoints(since_us or now_us() - 200_000))

    def still(self, seconds=0.6):
        """True if only zeros are sent for that long."""
        begin_us = now_us()
        time.sleep(seconds)
        return not self.moving(begin_us)

    def restart_gateway(self, **options):
        self.rig.start_gateway(**options)
        self.client = self.rig.client()

    def reset(self):
        """Resets as the operator, after the cause has ended and the wheels are at standstill."""
        end = time.monotonic() + 8
        while time.monotonic() < end:
            state = self.client.request("status")["state"]
            if state == "listening":
                return
            if state == "latched":
                self.client.request("reset")
            time.sleep(0.1)
        self.t.check(False, "reset")

    def silence(self, *streams):
        """Ends these streams and waits until the gateway listens again: the judge needs the end of each session."""
        for stream in streams:
            stream.stop()
        self.t.check(self.rig.wait_status(self.client, lambda s: s["state"] == "listening", 6), "silence")

    def judge_at_rest(self, *streams):
        self.silence(*streams)
        self.t.judge(self.rig)


__all__ = ["Ride", "Stream", "now_us", "wait_connect"]
