# SPDX-License-Identifier: MIT
"""Simulated wheels, gateway and web bridge in one private folder, and an HTTP client of ours that may send anything."""

import http.client
import json
import socket
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "test/system"))

from harness import Process, Rig  # noqa: E402
from trials import until  # noqa: E402

# For any machine, however busy; as in the demonstration.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class WebRig(Rig):
    """`driving`: the page may drive and reset."""

    def __init__(self, build, driving=False, settings=None):
        self.driving, self.web, self.port = driving, None, free_port()
        self.web_settings = {"gateway": {"rate_hz": 20}, "web": {"port": self.port}, "fleet": {}, "drive": {}}
        super().__init__(str(build), CONFIG)
        self.web_settings["gateway"]["socket"] = self.path("gateway.sock" if driving else "watch.sock")
        self.web_settings["web"]["token_file"] = self.path("token")
        self.web_settings["web"]["page"] = str(page_folder(build))
        if driving:
            self.web_settings["drive"] = {"enabled": "yes", "allow_reset": "yes"}
        for section, keys in (settings or {}).items():
            self.web_settings[section].update(keys)

    def words(self):
        return self.web.text() if self.web else ""

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
