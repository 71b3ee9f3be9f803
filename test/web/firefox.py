# SPDX-License-Identifier: MIT
"""A page in Debian's Firefox, by WebDriver BiDi: Firefox serves it on its own, on a local WebSocket. Playwright drives only its own build of Firefox."""

import base64
import contextlib
import json
import os
import secrets
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path

from trials import Skip, until

ASSETS = Path(os.environ.get("IWHEEL_WEB_ASSETS") or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "iwheel/web")
# No first-run pages, no search for updates, no request to any other machine.
PREFERENCES = {
    "app.update.enabled": False,
    "browser.aboutwelcome.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "browser.startup.homepage_override.mstone": "ignore",
    "datareporting.policy.dataSubmissionEnabled": False,
    "dom.w3c_touch_events.enabled": 1,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "services.settings.server": "data:,",
    "toolkit.telemetry.reportingpolicy.firstRun": False,
}
KEYS = {"Tab": "\ue004", "Enter": "\ue006", "Escape": "\ue00c", "ArrowLeft": "\ue012", "ArrowUp": "\ue013", "ArrowRight": "\ue014", "ArrowDown": "\ue015"}


class WebSocket:
    """A client of one WebSocket (RFC 6455) on this machine: text messages only."""

    def __init__(self, port, path):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        key = base64.b64encode(secrets.token_bytes(16)).decode()
        self.socket.sendall(
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        self.file = self.socket.makefile("rb")
        status = self.file.readline()
        assert b" 101 " in status, status
        while self.file.readline() not in (b"\r\n", b""):
            pass

    def send(self, text, opcode=1):
        data, mask = text if isinstance(text, bytes) else text.encode(), secrets.token_bytes(4)
        size = len(data)
        head = bytes([0x80 | size]) if size < 126 else b"\xfe" + size.to_bytes(2, "big") if size < 65536 else b"\xff" + size.to_bytes(8, "big")
        key = (mask * (size // 4 + 1))[:size]
        masked = (int.from_bytes(data, "big") ^ int.from_bytes(key, "big")).to_bytes(size, "big")
        self.socket.sendall(bytes([0x80 | opcode]) + head + mask + masked)

    def receive(self):
        message = b""
        while True:
            first, size = self.file.read(2)
            if size > 125:
                size = int.from_bytes(self.file.read(2 if size == 126 else 8), "big")
            data, opcode = self.file.read(size), first & 15
            if opcode == 9:  # Ping.
                self.send(data, 10)
            elif opcode == 8:
                raise ConnectionError("Firefox closed the connection")
            else:
                message += data
                if first & 0x80:
                    return message.decode()


class Page:
    """The subset of playwright's page that the tests use; `errors` has what the page's console reports."""

    def __init__(self, port):
        self.socket, self.number, self.errors = WebSocket(port, "/session"), 0, []
        self.command("session.new", capabilities={"alwaysMatch": {"acceptInsecureCerts": True}})
        self.context = self.command("browsingContext.getTree")["contexts"][0]["context"]
        self.command("session.subscribe", events=["log.entryAdded"])

    def command(self, method, **params):
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            message = json.loads(self.socket.receive())
            if message["type"] == "event":
                entry = message["params"]
                if entry.get("level") == "error":
                    self.errors.append(entry["text"])
            elif message.get("id") == self.number:
                assert message["type"] == "success", message
                return message["result"]

    def open(self, url):
        self.command("browsingContext.navigate", context=self.context, url=url, wait="complete")

    def size(self, width, height):
        self.command("browsingContext.setViewport", context=self.context, viewport={"width": width, "height": height})

    def evaluate(self, expression):
        """The value of an expression of the page, through JSON. A debugger is not bound by the page's policy."""
        result = self.command(
            "script.evaluate",
            expression=f"Promise.resolve({expression}).then((value) => JSON.stringify(value ?? null))",
            target={"context": self.context},
            awaitPromise=True,
        )
        assert result["type"] == "success", (expression, result["exceptionDetails"]["text"])
        return json.loads(result["result"]["value"])

    def run(self, script):
        self.command("script.evaluate", expression=f"{script};0", target={"context": self.context}, awaitPromise=False)

    def seen(self, condition):
        return until(lambda: self.evaluate(condition), 15, condition)

    def text(self, selector):
        return self.evaluate(f"document.querySelector({json.dumps(selector)}).innerText")

    def middle(self, selector):
        """Scrolls to the element, and returns its middle."""
        return self.evaluate(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'nearest'}}); const r = e.getBoundingClientRect();"
            " return [Math.round(r.left + r.width / 2), Math.round(r.top + r.height / 2)]; })()"
        )

    def act(self, kind, identity, actions, **parameters):
        self.command("input.performActions", context=self.context, actions=[{"type": kind, "id": identity, "actions": actions, **parameters}])

    def pointer(self, kind, *steps, finger=0):
        """Steps of one mouse or finger: "down", "up", or a place to move to."""
        actions = [
            {"type": "pointerMove", "x": round(one[0]), "y": round(one[1])} if isinstance(one, tuple | list) else {"type": f"pointer{one.title()}", "button": 0}
            for one in steps
        ]
        self.act("pointer", f"{kind}{finger}", actions, parameters={"pointerType": kind})

    def click(self, selector):
        self.pointer("mouse", self.middle(selector), "down", "up")

    def tap(self, selector):
        self.pointer("touch", self.middle(selector), "down", "up")

    def key(self, name, *ways):
        self.act("key", "keys", [{"type": f"key{way}", "value": KEYS.get(name, name)} for way in ways or ("Down", "Up")])

    def let_go(self):
        self.command("input.releaseActions", context=self.context)

    def picture(self, path, whole=False):
        data = self.command("browsingContext.captureScreenshot", context=self.context, origin="document" if whole else "viewport")["data"]
        Path(path).write_bytes(base64.b64decode(data))


def port_of(process, profile):
    """Firefox chooses a free port, and writes it into its profile."""

    def written():
        assert process.poll() is None, f"Firefox ended with {process.returncode}"
        with contextlib.suppress(OSError, ValueError, KeyError):
            return json.loads((profile / "WebDriverBiDiServer.json").read_text(encoding="utf-8"))["ws_port"]

    return until(written, 60, "Firefox answers")


@contextlib.contextmanager
def firefox_page(url, width, height, scheme="light", language="en"):
    """The page of `url` in a Firefox with a new profile. An error on its console fails the test."""
    program = shutil.which("firefox-esr")
    if program is None:
        raise Skip("firefox-esr is missing (scripts/install_tools check brings it)")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        profile = Path(folder)
        preferences = {**PREFERENCES, "intl.accept_languages": language, "layout.css.prefers-color-scheme.content-override": 0 if scheme == "dark" else 1}
        profile.joinpath("user.js").write_text("".join(f"user_pref({json.dumps(k)}, {json.dumps(v)});\n" for k, v in preferences.items()), encoding="utf-8")
        environment = {**os.environ, "HOME": folder, "MOZ_HEADLESS_WIDTH": "1600", "MOZ_HEADLESS_HEIGHT": "1000"}
        command = [program, "--headless", "--no-remote", "--profile", folder, "--remote-debugging-port", "0", "about:blank"]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment) as process:
            try:
                page = Page(port_of(process, profile))
                page.size(width, height)
                page.open(url)
                yield page
                assert not page.errors, page.errors
            finally:
                process.terminate()
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
                time.sleep(0.1)
