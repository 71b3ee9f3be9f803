# SPDX-License-Identifier: MIT
"""Simulated wheels, gateway and web bridge in one private folder, and an HTTP client of ours that may send anything."""

import http.client
import json
import socket
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "test/system"))

from bus import now_us  # noqa: E402
from client import Closed  # noqa: E402
from harness import Process, Rig  # noqa: E402
from judge_log import LEFT, RIGHT  # noqa: E402

# For any machine, however busy; as in the demonstration.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


def needs(**rig):
    """Marks a test with what its rig is made with."""
    def mark(function):
        function.rig = rig
        return function
    return mark


def full(function):
    """Marks a test that only --full runs."""
    function.full = True
    return function


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def until(condition, seconds=10.0, what="it"):
    """The first true value of the condition; fails loudly if there is none in time."""
    deadline = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {seconds} s: {what}")
        time.sleep(0.02)


class WebRig(Rig):
    """`driving`: the page may drive and reset."""

    def __init__(self, build, driving=False, settings=None):
        self.driving, self.web, self.port = driving, None, free_port()
        self.web_settings = {"gateway": {"rate_hz": 20}, "web": {"port": self.port}, "drive": {}}
        super().__init__(str(build), CONFIG)
        self.web_settings["gateway"]["socket"] = self.path("gateway.sock" if driving else "watch.sock")
        self.web_settings["web"]["token_file"] = self.path("token")
        self.web_settings["web"]["page"] = str(page_folder(build))
        if driving:
            self.web_settings["drive"] = {"enabled": "yes", "allow_reset": "yes"}
        for section, keys in (settings or {}).items():
            self.web_settings[section].update(keys)

    def gateway_command(self, *extra):
        return super().gateway_command("--watch-socket", self.path("watch.sock"), *extra)

    def start(self):
        self.start_gateway()
        self.start_web()
        return self

    def write_web(self):
        with open(self.path("web.conf"), "w", encoding="utf-8") as file:
            for section, keys in self.web_settings.items():
                file.write(f"[{section}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()))

    def start_web(self, wait=True):
        self.write_web()
        self.web = Process([self.program("iwheel-web"), "-c", self.path("web.conf")], self.path("web.out"))
        self.processes.append(self.web)
        if wait:
            until(self.answers, what=f"the bridge answers: {self.web.text()}")
        return self.web

    def answers(self):
        if self.web.child.poll() is not None:
            raise AssertionError(f"iwheel-web ended with {self.web.child.returncode}: {self.web.text()}")
        try:
            return self.ask("GET", "/health")[0] in (200, 503)
        except OSError:
            return False

    def connected(self):
        until(lambda: self.ask("GET", "/health")[0] == 200, what="the bridge has the gateway's state")
        return self

    @property
    def token(self):
        return Path(self.path("token")).read_text(encoding="ascii").strip()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/#token={self.token}"

    def ask(self, method, path, headers=None, token=None, timeout=5):
        """(status, body) of one request with the right token, unless another one is given; "" sends none."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        try:
            connection.putrequest(method, path, skip_host=bool(headers and "Host" in headers))
            given = self.token if token is None else token
            if given:
                connection.putheader("Authorization", f"Bearer {given}")
            for name, value in (headers or {}).items():
                connection.putheader(name, value)
            connection.endheaders()
            answer = connection.getresponse()
            self.headers = dict(answer.getheaders())
            return answer.status, answer.read().decode()
        finally:
            connection.close()

    def ask_json(self, method, path, **options):
        status, body = self.ask(method, path, **options)
        return status, json.loads(body)

    def stream(self, seconds=5):
        """An open event stream: a socket file behind its header."""
        one = socket.create_connection(("127.0.0.1", self.port), timeout=seconds)
        one.sendall(f"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {self.token}\r\n\r\n".encode())
        return one


def page_folder(build):
    """The page as it would be installed."""
    return Path(build).resolve() / "bridge/web/page"


class Skip(Exception):
    """This cannot be tested here."""


class Driver(threading.Thread):
    """A client of the gateway that drives until it is told to end, or the wheels are stopped."""

    def __init__(self, rig, speed=200):
        super().__init__(daemon=True)
        self.client, self.speed, self.ended = rig.client(name="joystick"), speed, threading.Event()
        self.turning = False
        self.start()
        until(lambda: rig.bus.setpoints() and abs(rig.bus.setpoints()[-1][2]) == speed, what="the wheels are told to turn, and at this speed")
        self.turning = True

    def run(self):
        """A busy machine may stop the wheels before the test begins: then once more, after the silence that `arm` wants."""
        wait, cmd = 0.05, {"cmd": "arm", "name": "joystick"}
        try:
            while not self.ended.wait(wait):
                done = self.client.request(**cmd)["ok"]
                if not done and self.turning:
                    return
                wait = 0.05 if done else 0.6
                cmd = {"cmd": "drive", "left_mm_s": self.speed, "right_mm_s": self.speed} if done else {"cmd": "arm", "name": "joystick"}
        except (OSError, Closed):
            return  # The rig has ended.

    def end(self):
        self.ended.set()
        self.join(2)


def longest_gap_ms(rig, since_us):
    """The longest time between two setpoints of one wheel on the bus, until now."""
    until_us = now_us()
    gaps = []
    for wheel in (LEFT, RIGHT):
        times = [since_us] + [t_us for t_us, id_, _ in rig.bus.setpoints(since_us) if id_ == wheel and t_us < until_us]
        gaps += [after - before for before, after in zip(times, times[1:] + [until_us])]
    return max(gaps) / 1000


def braking_ms(rig, since_us, seconds=2):
    """How long after this time the first setpoint was on the bus that is nearer to zero than the one before it of that wheel."""
    def found():
        last = {}
        for t_us, wheel, speed in rig.bus.setpoints():
            if t_us >= since_us and abs(speed) < last.get(wheel, 0):
                return t_us
            last[wheel] = abs(speed)
        return None

    return (until(found, seconds, "the wheels are told to brake") - since_us) / 1000
