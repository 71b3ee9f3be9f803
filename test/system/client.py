# SPDX-License-Identifier: MIT
"""A northbound client that writes down what it did and when."""

import json
import select
import socket
import threading
import time

from bus import now_us
from judge_log import Event


class Closed(Exception):
    """The gateway closed the connection."""


class Client:
    """Requests of arm, drive, stop, estop and reset go to the timeline (a list of Event) with the time sent and answered."""

    def __init__(self, path, timeline=None, name="test", timeout=3.0):
        self.timeline = timeline if timeline is not None else []
        self.name, self.timeout = name, timeout
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(timeout)
        self.socket.connect(path)
        self.pending = b""
        self.events = []
        self.number = 0
        self.lock = threading.RLock()
        self.closed = False
        self.late = []  # Waits of the last `stream` that ended late: [(end_us, late_us)].

    # Lines -----------------------------------------------------------------------------------------------------------

    def send_raw(self, data):
        self.socket.sendall(data)

    def read_line(self, timeout=None):
        """The next line as an object; None after the timeout; Closed at the end."""
        deadline = time.monotonic() + (self.timeout if timeout is None else timeout)
        while b"\n" not in self.pending:
            left = deadline - time.monotonic()
            if not select.select([self.socket], [], [], max(0, left))[0]:
                return None
            try:
                data = self.socket.recv(65536)
            except OSError as error:
                raise Closed(str(error)) from error
            if not data:
                raise Closed("end of file")
            self.pending += data
        line, self.pending = self.pending.split(b"\n", 1)
        return json.loads(line)

    def read_reply(self, timeout=None):
        deadline = time.monotonic() + (self.timeout if timeout is None else timeout)
        while True:
            line = self.read_line(max(0, deadline - time.monotonic()))
            if line is None or "ok" in line:
                return line
            self.events.append(line)

    def collect(self, seconds=0.0):
        """Returns the received events, after waiting that long for more."""
        deadline = time.monotonic() + seconds
        with self.lock:
            while True:
                line = self.read_line(max(0, deadline - time.monotonic()))
                if line is None:
                    break
                if "event" in line:
                    self.events.append(line)
        return self.events

    def wait_event(self, wanted, timeout=3.0, **fields):
        """The first event of that name with those fields, already here or still to come."""
        deadline = time.monotonic() + timeout
        while True:
            for event in self.events:
                if event["event"] == wanted and all(event.get(k) == v for k, v in fields.items()):
                    return event
            line = self.read_line(max(0, deadline - time.monotonic()))
            if line is None:
                return None
            if "event" in line:
                self.events.append(line)

    # Requests --------------------------------------------------------------------------------------------------------

    def request(self, cmd, **fields):
        with self.lock:
            self.number += 1
            t_us = now_us()
            self.send_raw((json.dumps({"cmd": cmd, "id": self.number, **fields}) + "\n").encode())
            reply = self.read_reply()
            if reply is None:
                raise TimeoutError(f"no reply to {cmd} within {self.timeout} s")
            self._note(cmd, t_us, now_us(), reply["ok"], fields)
            return reply

    def _note(self, cmd, t_us, done_us, ok, fields):
        if cmd in ("arm", "reset", "drive"):
            self.timeline.append(Event(t_us, cmd, done_us, ok, fields.get("left_mm_s", 0), fields.get("right_mm_s", 0)))
        elif cmd in ("stop", "disarm", "estop"):
            self.timeline.append(Event(t_us, "stop" if cmd != "estop" else "estop", done_us))

    def arm(self, **fields):
        return self.request("arm", name=self.name, **fields)

    def drive(self, left, right, **fields):
        return self.request("drive", left_mm_s=left, right_mm_s=right, **fields)

    def stream(self, left, right, seconds, every=0.05):
        """Drives for that long, with absolute deadlines. Returns the first refusal, or None."""
        begin = time.monotonic()
        step, self.late = 0, []
        while step * every < seconds:
            reply = self.drive(left, right)
            if not reply["ok"]:
                return reply
            step += 1
            due = max(begin + step * every, time.monotonic())
            time.sleep(max(0, due - time.monotonic()))
            self.late.append((now_us(), int((time.monotonic() - due) * 1e6)))
        return None

    def close(self, holder=False):
        """`holder`: this connection holds the lease, so its end stops the wheels."""
        with self.lock:
            if not self.closed:
                if holder:
                    self.timeline.append(Event(now_us(), "gone"))
                self.socket.close()
                self.closed = True


class Streamer(threading.Thread):
    """Drives in the background until `stop`, or until the gateway refuses a command."""

    def __init__(self, client, left, right, every=0.05):
        super().__init__(daemon=True)
        self.client, self.target, self.every = client, (left, right), every
        self.quit = threading.Event()
        self.refusal = None
        self.refused_us = None
        self.count = 0
        self.start()

    def run(self):
        due = time.monotonic()
        while not self.quit.is_set():
            try:
                reply = self.client.drive(*self.target)
            except (Closed, TimeoutError, OSError) as error:
                self.refusal, self.refused_us = {"error": "closed", "message": str(error)}, now_us()
                return
            if not reply["ok"]:
                self.refusal, self.refused_us = reply, now_us()
                return
            self.count += 1
            due += self.every
            self.quit.wait(max(0, due - time.monotonic()))

    def stop(self, after=0.0):
        """Ends it after that time; returns the refusal, if there was one."""
        time.sleep(after)
        self.quit.set()
        self.join(4)
        return self.refusal
