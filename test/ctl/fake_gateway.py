# SPDX-License-Identifier: MIT
"""A gateway that only talks: answers like the real one, or misbehaves as a test wants it to."""

import contextlib
import json
import os
import socket
import tempfile
import threading
import time

HELLO = {"event": "hello", "name": "iwheel-gateway", "version": "0.1.0", "api": 1, "bus": "fake", "state": "listening", "client": 1}


def wheel(speed=0, applied=None, **more):
    """A wheel of a snapshot, everything known."""
    return {
        "heard": True,
        "at_rest": speed == 0,
        "speed_rpm": speed // 20,
        "speed_mm_s": speed,
        "acceleration_raw": 0,
        "commanded_mm_s": applied,
        "commanded_mA": None,
        "applied_mm_s": applied,
        "applied_mA": None,
        "battery_dV": 243,
        "temperature_degC": 31,
        "cpu_percent": 12,
        "ticks": 5000000000,
        "distance_mm": 12345,
        "force_raw": 812,
        "force_raw_mN": 8120,
        "force_offset_mN": 8000,
        "force_net_mN": -120,
        "force_validity": "valid",
        "offset_provenance": "wheel",
        "offset_origin": "wheel",
        "offset_contaminated": False,
        "offset_window": "good",
        "offset_samples": 40,
        "offset_deviation_mN": 10,
        "offset_drift_mN": 1,
        "unit_evidence": "cN",
        "speed_age_ms": 3,
        "status_age_ms": 17,
        "force_age_ms": 29,
        "offset_age_ms": 1000,
        "valid": {},
        "saturated": {"battery": False, "force": False},
        "reboots": 0,
        **more,
    }


def snapshot(state="listening", **more):
    """A complete reply of status."""
    return {
        "t_us": 1,
        "wall_us": 1,
        "version": "0.1.0",
        "state": state,
        "arming": False,
        "cause": None,
        "present": [],
        "lease": {"holder": None, "name": None, "pid": None, "remaining_ms": None, "lease_ms": 60},
        "bus": {"name": "can0", "state": "active", "timing": "unproven", "echo": "proven"},
        "estop": {"line": "ESTOP", "state": "released", "simulated": False},
        "left": wheel(),
        "right": wheel(),
        "pose": {"x_mm": 1, "y_mm": -2, "z_mm": 3, "psi_mrad": 4, "age_ms": 5, "limited": False},
        "ledger": {
            "setpoint_type": {"state": "assumed", "evidence": "configuration", "figure": None},
            "current_role": {"state": "assumed", "evidence": "configuration", "figure": None},
        },
        "budget": {"client_lost_ms": 887, "client_lost_mm": 554, "killed_ms": 1000, "killed_mm": 1000},
        "pair": {"deviation_mm": 0, "largest_mm": 12, "limit_mm": 60},
        "counters": {},
        "clients": 1,
        "listen_only": False,
        "shutting_down": False,
        "warnings": [],
        **more,
    }


class FakeGateway:
    """Listens on `path`; stores every request in `requests` as (time, object). Override `reply` to misbehave."""

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="iwheel-ctl-")
        self.path = os.path.join(self.folder.name, "gateway.sock")
        self.requests = []
        self.closed_at = None
        self.driving = 0
        self.stopped_at = None
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.path)
        self.listener.listen(4)
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def close(self):
        # A blocked accept() holds the listener open: shut it down first.
        with contextlib.suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        self.thread.join(5)
        self.folder.cleanup()

    def serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            with connection:
                try:
                    self.greet(connection)
                    self.talk(connection)
                except OSError:
                    pass
            self.closed_at = time.monotonic()

    def greet(self, connection):
        self.say(connection, HELLO)

    def talk(self, connection):
        with connection.makefile("rb") as lines:
            for line in lines:
                request = json.loads(line)
                self.requests.append((time.monotonic(), request))
                answer = self.reply(connection, request)
                if answer is not None:
                    self.say(connection, {"id": request.get("id"), **answer})

    @staticmethod
    def say(connection, value):
        connection.sendall(json.dumps(value).encode() + b"\n")

    def reply(self, connection, request):
        return getattr(self, "on_" + request["cmd"])(connection, request)

    def on_status(self, _connection, _request):
        turning = self.driving and self.stopped_at is None
        standing = self.stopped_at is not None and time.monotonic() - self.stopped_at > 0.2
        if turning or (self.stopped_at is not None and not standing):
            return {"ok": True, **snapshot("armed" if turning else "stopping", left=wheel(200, 200), right=wheel(200, 200))}
        return {"ok": True, **snapshot()}

    def on_why(self, _connection, _request):
        return {"ok": True, "number": 0, "cause": None, "sentence": None}

    def on_watch(self, _connection, request):
        return {"ok": True, "topics": request["topics"], "rate_hz": request.get("rate_hz", 10), "limited": False}

    def on_arm(self, _connection, _request):
        return {"ok": True, "state": "armed", "lease_ms": 60, "first_lease_ms": 1000, "stop_budget_ms": 1, "stop_budget_mm": 1, "warnings": []}

    def on_drive(self, _connection, request):
        self.driving += 1
        return {"ok": True, "left_mm_s": request["left_mm_s"], "right_mm_s": request["right_mm_s"], "left_mA": 2000, "right_mA": 2000, "limited": False}

    def on_stop(self, _connection, _request):
        self.stopped_at = time.monotonic()
        return {"ok": True, "state": "stopping"}

    def on_estop(self, _connection, _request):
        return {"ok": True, "state": "latched"}

    def on_reset(self, _connection, _request):
        return {"ok": False, "error": "estop_pressed", "message": "the e-stop is pressed; release the button"}

    def on_tare(self, _connection, request):
        zero = {"offset_mN": 8000, "samples": 40, "deviation_mN": 110, "drift_mN": 3, "before_mN": None, "before_provenance": "none"}
        return {"ok": True, "state": "listening", **{side: zero for side in ("left", "right") if request.get("side", side) == side}}

    def on_confirm(self, _connection, request):
        wrong = request.get("value") == "181"
        return {
            "ok": True,
            "item": request["item"],
            "state": "contradicted" if wrong else "confirmed",
            "evidence": "operator",
            "figure": None,
            "value": "192",
            "reason": "the operator \x1b says so",
            "disabled": "no distance; correct radius_mm" if wrong else None,
        }

    def on_config(self, _connection, request):
        if request.get("key", "").startswith("bus."):
            return {"ok": False, "error": "bad_value", "message": "bus.interface is no key of this gateway"}
        keys = [{"key": "wheels.setpoint_type", "value": None}, {"key": "drive.lease_ms", "value": request.get("value", "200")}]
        return {"ok": True, "keys": keys, "staged": "key" in request, "restarts": request.get("commit", False)}

    def count(self, cmd):
        return sum(1 for _, request in self.requests if request["cmd"] == cmd)

    def times(self, cmd):
        return [at for at, request in self.requests if request["cmd"] == cmd]
