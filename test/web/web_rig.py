# SPDX-License-Identifier: MIT
"""Simulated wheels, gateway and web bridge in one private folder, and an HTTP client of the tests that may send anything."""

import hashlib
import hmac
import http.client
import json
import secrets
import signal
import socket
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "test/system"), str(ROOT / "test/support")]

from bus import now_us
from free_port import free_port
from harness import WORDS, Process, Rig
from settings_file import write_settings
from trials import until

# For any machine, however busy; as in the demonstration.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


class Person:
    """A sender with a token, as in docs/user/web.md: it has its own session, and sends a proof with each request."""

    def __init__(self, rig, token=None):
        self.rig, self.token, self.session, self.sequence, self.challenge = rig, token, secrets.token_hex(16), 0, None

    def begin(self):
        self.challenge = json.loads(self.rig.ask("GET", "/api/challenge", token="")[1])
        self.session, self.sequence = secrets.token_hex(16), 0

    def mac(self, method, target, sequence):
        text = "\n".join((method, target, self.session, self.challenge["nonce"], str(sequence)))
        return hmac.new((self.token or self.rig.token).encode(), text.encode(), hashlib.sha256).hexdigest()

    def header(self, method, target):
        if self.challenge is None:
            self.begin()
        self.sequence += 1
        return f"IWheel {self.session} {self.challenge['nonce']} {self.sequence} {self.mac(method, target, self.sequence)}"

    def ask(self, method, target, **options):
        """(status, JSON). A bridge that was started again does not know the session."""
        for _ in range(2):
            status, body = self.rig.ask(
                method, target, headers={"Authorization": self.header(method, target), **options.pop("headers", {})}, token="", **options
            )
            answer = json.loads(body)
            if status != 401 or answer["error"] != "bad_session":
                break
            self.begin()
        return status, answer

    @property
    def boot(self):
        if self.challenge is None:
            self.begin()
        return self.challenge["boot"]

    def arm(self, t_us=None, **options):
        return self.ask("POST", f"/api/arm?boot={self.boot}&t_us={t_us or now_us()}", **options)

    def drive(self, key, sequence, age_us=0, v=150):
        return self.ask("POST", f"/api/drive?key={key}&sequence={sequence}&t_us={now_us() - age_us}&v_mm_s={v}&yaw_mrad_s=0")

    def reset(self, t_us=None, stop=None):
        stop = self.ask("GET", "/api/stops")[1]["stops"][0]["number"] if stop is None else stop
        return self.ask("POST", f"/api/reset?boot={self.boot}&t_us={t_us or now_us()}&stop={stop}")


class WebRig(Rig):
    """`driving`: the page may drive and reset."""

    def __init__(self, build, driving=False, settings=None):
        self.driving, self.web, self.port = driving, None, free_port()
        self.person, self.proved = Person(self), None
        self.web_settings = {"gateway": {"rate_hz": 20}, "web": {"port": self.port}, "fleet": {}, "drive": {}}
        super().__init__(str(build), CONFIG)
        self.web_settings["gateway"]["socket"] = self.path("gateway.sock" if driving else "watch.sock")
        self.web_settings["web"]["token_file"] = self.path("token")
        self.web_settings["web"]["page"] = str(page_folder(build))
        if driving:
            self.web_settings["drive"] = {"enabled": "yes", "allow_reset": "yes"}
        for section, keys in (settings or {}).items():
            self.web_settings[section].update(keys)

    def said(self):
        return (self.web.text()[-WORDS:] if self.web else "") + super().said()

    def gateway_command(self, *extra):
        return super().gateway_command("--watch-socket", self.path("watch.sock"), *extra)

    def start(self):
        self.start_gateway()
        self.start_web()
        return self

    def write_web(self):
        write_settings(self.path("web.conf"), self.web_settings)

    def start_web(self, wait=True):
        self.write_web()
        self.web = Process([self.program("iwheel-web"), "-c", self.path("web.conf")], self.path("web.out"))
        self.processes.append(self.web)
        if wait:
            until(self.answers, what=f"the bridge answers: {self.web.text()}")
        return self.web

    def end_web(self, seconds=5):
        self.web.signal(signal.SIGTERM)
        assert self.web.wait(seconds) == 0, self.web.text()

    def starts_web(self):
        """It starts, whatever it answers."""
        web = self.start_web(wait=False)
        until(lambda: "its address with the token" in web.text(), what="it starts")

    def refuses_to_start(self, code, words, about=""):
        web = self.start_web(wait=False)
        assert web.wait(5) == code and words in web.text(), (about, web.text())

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

    @property
    def read_secret(self):
        return hmac.new(self.token.encode(), b"iwheel-web read", hashlib.sha256).hexdigest()[:32]

    def ask(self, method, path, headers=None, token=None, timeout=5):
        """(status, body) of one request. It is proved with the right token, unless another one is given; "" proves nothing."""
        proof = {}
        if token is None and not (headers and "Authorization" in headers):
            proof = {"Authorization": self.prove(method, path)}
        elif token:
            person = Person(self, token)
            proof = {"Authorization": person.header(method, path)}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        try:
            connection.putrequest(method, path, skip_host=bool(headers and "Host" in headers))
            for name, value in (*proof.items(), *(headers or {}).items()):
                connection.putheader(name, value)
            connection.endheaders()
            answer = connection.getresponse()
            self.headers = dict(answer.getheaders())
            return answer.status, answer.read().decode()
        finally:
            connection.close()

    def prove(self, method, path):
        """A session lasts until the bridge ends."""
        if self.person.challenge is None or self.proved is not self.web:
            self.person.begin()
            self.proved = self.web
        return self.person.header(method, path)

    def at_standstill(self):
        until(lambda: self.ask_json("GET", "/api/status")[1]["state"] == "listening", what="the wheels are at standstill")

    def ask_json(self, method, path, **options):
        status, body = self.ask(method, path, **options)
        return status, json.loads(body)

    def stream(self, seconds=5):
        """An open event stream: a socket file behind its header."""
        one = socket.create_connection(("127.0.0.1", self.port), timeout=seconds)
        one.sendall(f"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {self.read_secret}\r\n\r\n".encode())
        return one


def page_folder(build):
    """The page as an installation contains it."""
    return Path(build).resolve() / "app/bridge/web/page"
