# SPDX-License-Identifier: MIT
"""share/northbound.json with the real gateway: its messages in every state, the requests that it accepts, and the client's types."""

import json
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
import unittest

import pytest
from rig import BUILD, ROOT, RigCase, require_gateway

require_gateway()

import iwheel
from client import Closed
from harness import Rig
from iwheel import _protocol

sys.path.insert(0, os.path.join(ROOT, "test", "northbound"))
from described import Description
from northbound import camel

STOPS = ("stop", "disarm", "estop")  # The gateway refuses no field of these.
TOPICS = ["state", "bus", "estop", "lease", "stop", "force", "frame"]
# Parts that this rig cannot produce, with the reason. All other parts must be seen.
A_BOARD = "only a gateway without its own file has it: a microcontroller"
UNSEEN = {
    **dict.fromkeys([f"reply to config.{field}: a value" for field in ("keys", "restarts", "staged")], A_BOARD),
    **dict.fromkeys([f"configured_entry.{what}" for what in ("key: a value", "value: a value", "value: null")], A_BOARD),
    "bus_status.bitrate: a value": "a local bus has none",
    "bus_status.sample_point_permille: a value": "a local bus has none",
    "event offset.offset_mN: null": "a zero is replaced, and never removed",
    "bus_status.load_permille: a value": "a local bus is not measured",
    "bus_status.lost_frames: a value": "a local bus is not measured",
    "reply to arm.key: left out": A_BOARD,
    "estop_status.tried_wall_us: a value": "a simulated button is never tested; test/kernel has a line of the kernel",
}


class Witness:
    """Compares the gateway's messages with the description, and records which parts of the description it has seen."""

    def __init__(self):
        self.description = Description()
        self.complaints, self.seen = [], set()

    def reply(self, cmd, message):
        holder = self.description.objects[self.description.requests[cmd]["reply"]]
        self._look(f"reply to {cmd}", message, ("id", "ok"), holder)

    def event(self, message):
        name = message["event"]
        if name not in self.description.events:
            self.complaints.append(f"event {name} is not in share/northbound.json")
            return
        self._look(f"event {name}", message, ("event",), self.description.events[name])

    def refusal(self, cmd, message):
        self._look(f"refusal of {cmd}", message, ("id", "ok"), self.description.objects["refusal"])

    def _look(self, where, message, envelope, holder):
        body = {name: value for name, value in message.items() if name not in envelope}
        fields = self.description.fields(holder)
        self.complaints += self.description.complaints(body, fields, where)
        self._remember(where, body, fields)

    def _remember(self, where, body, fields):
        for name, field in fields.items():
            if name not in body:
                self.seen.add(f"{where}.{name}: left out")
                continue
            value = body[name]
            self.seen.add(f"{where}.{name}: {'null' if value is None else 'a value'}")
            inner = list(value) if field.get("list") else list(value.values()) if "keys" in field else [value]
            holder = self.description.objects.get(field["type"]) if isinstance(field["type"], str) else None
            for one in inner if holder and value is not None else ():
                self._remember(field["type"], one, self.description.fields(holder))

    def expected(self):
        """All parts of the description that must be seen."""
        tops = [(f"reply to {cmd}", self.description.objects[one["reply"]]) for cmd, one in self.description.requests.items()]
        tops += [(f"event {name}", event) for name, event in self.description.events.items()]
        inner = {
            field["type"]
            for _, holder in [*tops, *self.description.objects.items()]
            for field in self.description.fields(holder).values()
            if isinstance(field["type"], str) and field["type"] in self.description.objects
        }
        for where, holder in tops + [(name, self.description.objects[name]) for name in sorted(inner)]:
            for name, field in self.description.fields(holder).items():
                if name in holder["fields"] or not field.get("null"):  # An object that extends another may not have all of its states.
                    yield f"{where}.{name}: a value"
                if name in holder["fields"] and field.get("null"):
                    yield f"{where}.{name}: null"
                if field.get("optional"):
                    yield f"{where}.{name}: left out"


class Ear(threading.Thread):
    """Reads all events of a client until the connection ends."""

    def __init__(self, client):
        super().__init__(daemon=True)
        self.client, self.lines = client, []
        self.start()

    def run(self):
        try:
            while True:
                line = self.client.read_line(0.5)
                if line is not None:
                    self.lines.append(line)
        except (Closed, OSError, ValueError):
            pass

    def events(self):
        self.join(5)
        return [line for line in self.lines if "event" in line]


class Story(unittest.TestCase):
    maxDiff = None
    """Leads a gateway through its states and checks all its messages."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="iwheel-second-")
        self.addCleanup(folder.cleanup)
        self.second = os.path.join(folder.name, "button")
        self.rig = Rig(BUILD, RigCase.config, ("--uptime", "100", "--estop2", self.second))
        self.addCleanup(self.rig.close)
        self.records = self.rig.path("records")
        os.mkdir(self.records)
        self.rig.settings["record"]["directory"] = self.records
        self.rig.write_config()
        self.witness = Witness()

    def connect(self, *topics, rate_hz=50):
        client = self.rig.client()
        if topics:
            self.ask(client, "watch", topics=list(topics), rate_hz=rate_hz)
        return client

    def ask(self, client, cmd, refused=None, **fields):
        reply = client.request(cmd, **fields)
        self.assertEqual(reply.get("error"), refused, reply)
        if refused is None:
            self.witness.reply(cmd, reply)
        else:
            self.witness.refusal(cmd, reply)
        return reply

    def wait(self, client, condition, seconds=5.0):
        """Polls the status until the condition is true."""
        deadline = time.monotonic() + seconds
        while not condition(self.ask(client, "status")):
            self.assertLess(time.monotonic(), deadline, "the condition did not become true")
            time.sleep(0.02)

    def wait_granted(self, client, cmd, seconds=5.0, **fields):
        deadline = time.monotonic() + seconds
        while True:
            reply = client.request(cmd, **fields)
            if reply["ok"]:
                return self.witness.reply(cmd, reply)
            self.witness.refusal(cmd, reply)
            self.assertLess(time.monotonic(), deadline, reply)
            time.sleep(0.05)

    def wait_rest(self, client):
        self.wait(client, lambda s: s["left"]["at_rest"] and s["right"]["at_rest"] and s["state"] == "listening")

    def drive(self, client, seconds, left, right):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.ask(client, "drive", left_mm_s=left, right_mm_s=right)
            time.sleep(0.05)

    def judge_events(self, client):
        for event in client.collect():
            self.witness.event(event)
        client.events.clear()

    @pytest.mark.pace(1)
    def test_gateway_messages_match_the_description_both_ways(self):
        self.rig.sim.ask("mute both")
        self.rig.sim.ask("raw left 32767")
        self.rig.start_gateway(wheels=False)
        self.ears = [Ear(self.connect(*(topic for topic in TOPICS if topic != "frame"))), Ear(self.connect("frame"))]
        slow = self.connect("frame")  # This client does not read, so it loses events.
        me, other = self.connect(), self.connect()
        for part in (self.without_wheels, self.wheels_appear, self.rolling, self.zeros, self.driving, self.stops, self.bus, self.files):
            part(me, other)
        self.assertIsNotNone(slow.wait_event("lost"))  # The gateway sends this event when the socket has space again.
        self.judge_events(slow)
        self.rig.kill_gateway(signal.SIGTERM)
        for ear in self.ears:
            for event in ear.events():
                self.witness.event(event)
        self.another_start()
        self.assertEqual(self.witness.complaints[:20], [])
        unseen = set(self.witness.expected()) - self.witness.seen
        self.assertEqual(sorted(unseen - set(UNSEEN)), [])
        self.assertEqual(sorted(set(UNSEEN) - set(self.witness.expected())), [])

    def without_wheels(self, me, _):
        self.ask(me, "hello")
        self.ask(me, "status")
        self.ask(me, "why")
        self.ask(me, "arm", refused="wheel_lost")

    def wheels_appear(self, me, _):
        self.rig.sim.ask("unmute both")
        self.wait_rest(me)
        for frame in ("frame 12345678#0102", "frame 7FF#R"):
            self.rig.sim.ask(frame)

    def rolling(self, me, _):
        self.rig.sim.ask("slope 12")
        self.wait(me, lambda s: s["rolling"])
        self.rig.sim.ask("slope 0")
        self.wait(me, lambda s: not s["rolling"])
        self.wait_rest(me)

    def zeros(self, me, _):
        self.wait(me, lambda s: s["left"]["offset_window"] == "saturated")
        self.rig.sim.ask("raw left auto")
        self.wait_granted(me, "tare")
        self.wait_granted(me, "tare", side="left")
        self.wait_granted(me, "tare", side="right")
        self.ask(me, "confirm", item="wheel_radius", value=200)
        self.ask(me, "status")
        self.ask(me, "confirm", item="wheel_radius", how="a tape")
        self.ask(me, "confirm", item="mount_sign_left", value="yes")
        self.ask(me, "arm", refused="denied")
        self.ask(me, "confirm", item="mount_sign_left", value="no")
        self.ask(me, "confirm", item="track_of_a_horse", refused="bad_value")

    def driving(self, me, other):
        self.ask(me, "arm")
        self.ask(me, "status")
        self.ask(other, "drive", refused="not_holder", left_mm_s=0, right_mm_s=0)
        self.ask(other, "arm", refused="busy")
        self.ask(other, "arm", takeover=True, name="other")
        self.drive(other, 0.8, 300, -300)
        self.ask(other, "twist", v_mm_s=2000, yaw_mrad_s=100)
        self.ask(other, "stop")
        self.wait_rest(me)
        self.wait_granted(other, "arm", name="other")
        self.drive(other, 0.1, 100, 100)
        self.ask(other, "disarm")
        self.wait_rest(me)

    def stops(self, me, other):
        self.wait_granted(other, "arm", name="other")
        self.drive(other, 0.3, 200, 200)
        self.wait(me, lambda s: s["cause"] == "lease_lost")
        self.ask(me, "why")
        self.rig.sim.ask("estop press")
        self.wait(me, lambda s: "estop_line" in s["present"])
        self.rig.sim.ask("estop release")
        self.ask(me, "estop", reason="a test")
        self.wait(me, lambda _: self.ask(me, "why")["recording"] is not None)
        self.ask(me, "recording", name="../gateway.conf", refused="bad_value")
        name = self.ask(me, "recordings")["recordings"][-1]["name"]
        self.ask(me, "recording", name=f"{name}.log")
        folder = os.path.dirname(self.ask(me, "why")["recording"])
        for rest in ("stop-000098-rest.conf", "stop-000099-rest.log"):  # A crash leaves such files.
            with open(os.path.join(folder, rest), "w", encoding="ascii"):
                pass
        self.ask(me, "recordings")
        self.ask(me, "recording", name=f"{name}.conf")
        self.ask(me, "recording", name=f"{name}.conf", offset=-1, refused="out_of_range")
        self.recording_on_request(me)
        self.wait_granted(me, "reset")
        self.wait_granted(me, "release")
        self.wait_granted(me, "arm")
        self.rig.sim.ask("mute left")
        self.wait(me, lambda s: not s["left"]["heard"])
        self.ask(me, "why")
        self.rig.sim.ask("unmute left")
        self.wait_granted(me, "reset")
        self.rig.sim.ask("reboot right")
        self.wait(me, lambda s: not s["right"]["heard"])
        self.wait(me, lambda s: s["right"]["wheel_offset_mN"] is not None)
        self.wait_rest(me)

    def recording_on_request(self, me):
        self.ask(me, "recordings")  # There is none yet.
        self.ask(me, "record", on=True)
        self.wait(me, lambda _: self.ask(me, "recordings")["on_request"]["name"] is not None)
        self.ask(me, "record", on=True)  # It runs already.
        self.ask(me, "record", on=False)
        self.wait(me, lambda _: self.ask(me, "recordings")["on_request"]["ended"] == "request")
        self.ask(me, "record", on=False)

    def bus(self, me, _):
        self.rig.sim.ask("foreign once 100")
        self.wait(me, lambda s: "second_master" in s["present"])
        self.rig.sim.ask("bus down")
        self.wait(me, lambda s: s["bus"]["state"] == "down")
        self.rig.sim.ask("bus up")
        self.wait(me, lambda s: s["bus"]["state"] == "active")
        self.wait_rest(me)

    def files(self, me, _):
        """Replaces the directory by a file, so that nothing can be written there."""
        shutil.rmtree(self.records)
        with open(self.records, "w", encoding="utf-8"):
            pass
        self.ask(me, "estop")
        self.wait(me, lambda _: self.ask(me, "why")["recording_error"] is not None)
        self.wait_granted(me, "record", on=True)
        self.wait(me, lambda _: self.ask(me, "record", on=False)["fault"] is not None)
        self.ask(me, "confirm", item="gear_ratio")
        self.wait(me, lambda s: s["memory"]["state"] == "failed")
        os.unlink(self.records)
        os.mkdir(self.records)
        self.ask(me, "recordings")

    def another_start(self):
        """Starts without a setpoint type, and with the second contact of the e-stop."""
        del self.rig.settings["wheels"]["setpoint_type"]
        self.rig.settings["estop"] = {"line": self.rig.estop_line(), "line2": f"unix:{self.second}"}
        self.rig.write_config()
        self.rig.start_gateway()
        self.ask(self.connect(), "arm", refused="type_not_set")
        me = self.connect("estop")
        self.rig.sim.ask("contact 2 press")
        self.wait(me, lambda s: s["estop"]["pressed_at"] == "line2" and "estop_disagrees" in s["present"])
        self.judge_events(me)


class Requests(RigCase):
    def setUp(self):
        super().setUp()
        self.client = self.rig.client()
        self.description = Description()

    def error(self, cmd, fields):
        return self.client.request(cmd, **fields).get("error")

    def example(self, field):
        """A value of that type, and a value of another type."""
        kind = field["type"] if isinstance(field["type"], str) else field["type"][0]
        value = {"integer": 1, "boolean": False, "text": "x"}.get(kind) or (
            next(iter(self.description.words[kind])) if kind in self.description.words else {"boolean": False}.get(kind)
        )
        return ([value], {}) if field.get("list") else (value, {})

    def needed(self, request):
        named = {"name": "stop-000001-none.log"} if request["reply"] == "piece" else {}  # A name of the required form.
        return {**{name: self.example(field)[0] for name, field in request["fields"].items() if not field.get("optional")}, **named}

    def test_request_fields_match_the_description_exactly(self):
        names = {name for request in self.description.requests.values() for name in request["fields"]} | {"speed"}
        for cmd, request in self.description.requests.items():
            for name in sorted(names):
                with self.subTest(cmd, field=name):
                    field = request["fields"].get(name)
                    error = self.error(cmd, {**self.needed(request), name: self.example(field)[0] if field else 1})
                    self.assertEqual(error == "unknown_field", field is None and cmd not in STOPS, error)

    def test_required_fields_are_required_and_optional_ones_are_not(self):
        for cmd, request in self.description.requests.items():
            for name, field in request["fields"].items():
                with self.subTest(cmd, field=name):
                    without = {other: self.example(one)[0] for other, one in request["fields"].items() if other != name}
                    pair = name in ("left_mA", "right_mA")  # Both or none.
                    self.assertEqual(self.error(cmd, without) == "missing_field", pair or not field.get("optional"))

    def test_another_type_is_a_bad_value(self):
        for cmd, request in self.description.requests.items():
            for name, field in request["fields"].items():
                with self.subTest(cmd, field=name):
                    error = self.error(cmd, {**self.needed(request), name: self.example(field)[1]})
                    self.assertEqual(error, None if cmd in STOPS else "bad_value")

    def test_words_texts_and_numbers_end_where_it_is_described(self):
        for cmd, request in self.description.requests.items():
            for name, field in request["fields"].items():
                for value, fits in self.edges(name, field) if (cmd, name) != ("recording", "name") else [("x" * 64, False)]:
                    with self.subTest(cmd, field=name, value=value):
                        other = {"left_mA": "right_mA", "right_mA": "left_mA"}.get(name)
                        fields = {**self.needed(request), **({other: 0} if other else {}), name: value}
                        error = self.error(cmd, fields)
                        self.assertEqual(error in ("bad_value", "out_of_range"), not fits and cmd not in STOPS, error)

    def edges(self, name, field):
        """Values, and whether they are within the described limits."""
        kinds = field["type"] if isinstance(field["type"], list) else [field["type"]]
        words = [word for kind in kinds for word in self.description.words.get(kind, ())]
        for word in [*words, *(["horse"] if words else [])]:
            yield [word] if field.get("list") else word, word != "horse"
        if "bytes" in field:
            if kinds == ["text"]:  # The permitted texts of a value depend on the item.
                yield "x" * field["bytes"], True
            yield "x" * (field["bytes"] + 1), False
        for end, step in (("least", -1), ("most", 1)):
            if end in field:
                yield field[end] + step, False
                if end == "most" or not name.endswith("_mA"):  # A current below 0 is for current_role = setpoint.
                    yield field[end], True

    def test_the_limits_of_a_line_are_as_described(self):
        limits = self.description.limits
        request = {"cmd": "hello", "id": "x" * limits["id_text_bytes"]}
        line = json.dumps(request) + " " * limits["request_bytes"]
        self.client.send_raw(line[: limits["request_bytes"]].encode() + b"\n")
        self.assertTrue(self.client.read_reply()["ok"])
        self.client.send_raw(json.dumps({**request, "id": request["id"] + "x"}).encode() + b"\n")
        self.assertEqual(self.client.read_reply()["error"], "bad_value")
        self.client.send_raw(line[: limits["request_bytes"] + 1].encode() + b"\n")
        self.assertEqual(self.client.read_reply()["error"], "line_too_long")

    def test_every_request_is_described(self):
        message = self.client.request("horse")["message"]
        self.assertEqual(set(message.split("one of ")[1].split()), set(self.description.requests))

    def test_rates_are_granted_as_described(self):
        limit, default = self.description.limits["granted_rate_hz"], self.description.requests["watch"]["fields"]["rate_hz"]["default"]
        for asked, granted in ((None, default), (limit, limit), (limit + 1, limit)):
            fields = {} if asked is None else {"rate_hz": asked}
            self.assertEqual(self.client.request("watch", topics=[], **fields)["rate_hz"], granted)
        self.assertEqual(iwheel._wire.RATE_MAX_HZ, limit)


class Types(unittest.TestCase):
    def test_the_types_of_the_client_have_every_field(self):
        description = Description()
        self.assertEqual(_protocol.API, description.api)
        for name, holder in description.objects.items():
            known = getattr(_protocol, camel(name), None) or getattr(iwheel, camel(name), None)
            if known is not None:
                fields = getattr(known, "__dataclass_fields__", known.__annotations__)
                left_out = {"state"} if name == "terms" else set()  # This field is always the same.
                self.assertEqual(set(fields), set(description.fields(holder)) - left_out, name)
        for reply in {request["reply"] for request in description.requests.values()} - {"new_state"}:
            self.assertTrue(hasattr(iwheel, camel(reply)), f"{camel(reply)} is not exported")

    def test_refusals_that_the_client_knows_are_described(self):
        errors = set(Description().words["error"])
        self.assertLessEqual({*iwheel._wire.HARMLESS, *iwheel._wire.PASSING}, errors)
        self.assertLessEqual({*iwheel._wire.REPEATABLE}, set(Description().requests))


if __name__ == "__main__":
    unittest.main()
