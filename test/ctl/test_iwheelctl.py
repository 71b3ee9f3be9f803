# SPDX-License-Identifier: MIT
"""iwheelctl against a gateway that only talks: what it sends, when, what it shows, and how it fails."""

import itertools
import json
import os
import re
import signal
import socket
import statistics
import subprocess
import tempfile
import time
import unittest

from ctl import environment, program, run, run_as_stranger
from fake_gateway import FakeGateway, snapshot, wheel
from trials import until

PROGRAM = program()
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
VERBS = ("status", "watch", "drive", "stop", "disarm", "estop", "reset", "release", "tare", "why", "ledger", "confirm", "doctor", "bringup", "top")
NOT_ACKNOWLEDGED = {"ok": True, "number": 1, "cause": "send_stalled", "sentence": "setpoint not acknowledged", "at_us": 1}
PUSHED = {"ok": False, "error": "not_at_rest", "message": "the wheels turn"}


def start(*words, **more):
    return subprocess.Popen([PROGRAM, *words], stdout=more.pop("stdout", subprocess.PIPE), stderr=subprocess.PIPE, text=True, env=environment(), **more)


def end(process, number=signal.SIGTERM):
    """(stdout, stderr) of the program that this signal ends."""
    process.send_signal(number)
    return process.communicate(timeout=10)


class WithGateway(unittest.TestCase):
    def setUp(self):
        self.gateway = self.serve()

    def serve(self, kind=FakeGateway, **replies):
        """A gateway that replies so to these commands; None: not at all."""
        gateway = kind()
        for cmd, reply in replies.items():
            setattr(gateway, f"on_{cmd}", lambda *_, reply=reply: reply)
        self.addCleanup(gateway.close)
        return gateway

    def ctl(self, *words, gateway=None, path=None, **more):
        """(exit code, stdout, stderr, seconds)"""
        begin = time.monotonic()
        return *run("--socket", path or (gateway or self.gateway).path, *words, **more), time.monotonic() - begin

    def fails(self, code, part, *words, **more):
        """Checks the exit code and a part of the message; returns the seconds."""
        got, _, err, seconds = self.ctl(*words, **more)
        self.assertEqual(code, got, err)
        self.assertIn(part, err)
        return seconds


class Connecting(WithGateway):
    def test_missing_socket_asks_whether_the_gateway_runs(self):
        self.fails(69, "/nonexistent/x.sock does not exist; is the gateway running?", "status", path="/nonexistent/x.sock")

    def test_stale_socket_is_unavailable(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "s")
            with socket.socket(socket.AF_UNIX) as stale:
                stale.bind(path)
            self.fails(69, "no gateway answers", "status", path=path)

    def test_path_too_long_is_usage(self):
        self.fails(64, "too long", "status", path="/" + "a" * 107)

    def test_environment_names_the_socket_and_the_option_wins(self):
        self.assertEqual(0, run("status", env=environment(IWHEEL_SOCKET=self.gateway.path))[0])
        self.assertEqual(0, self.ctl("status", env=environment(IWHEEL_SOCKET="/nonexistent"))[0])
        self.assertEqual(69, run("status", env=environment(IWHEEL_SOCKET="/nonexistent"))[0])

    @unittest.skipUnless(os.geteuid() == 0, "needs root to become another user")
    def test_permission_names_the_group_and_the_command(self):
        os.chmod(self.gateway.folder.name, 0o755)
        os.chmod(self.gateway.path, 0o660)
        code, _, err = run_as_stranger(PROGRAM, "--socket", self.gateway.path, "status")
        self.assertEqual(77, code, err)
        self.assertIn("sudo usermod -aG root", err)

    def test_silence_after_connecting_times_out_in_two_seconds(self):
        class NoReply(FakeGateway):
            def greet(self, connection):
                time.sleep(4)

        seconds = self.fails(75, "no answer within 2 s", "status", gateway=self.serve(NoReply))
        self.assertTrue(1.9 < seconds < 3.5, seconds)

    def test_full_queue_of_callers_times_out(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "s")
            with socket.socket(socket.AF_UNIX) as listener:
                listener.bind(path)
                listener.listen(0)
                callers = []
                try:
                    while True:
                        caller = socket.socket(socket.AF_UNIX)
                        callers.append(caller)
                        caller.setblocking(False)
                        caller.connect(path)
                except BlockingIOError:
                    pass
                seconds = self.fails(75, "accepts no connection", "status", path=path)
                for caller in callers:
                    caller.close()
        self.assertTrue(1.9 < seconds < 3.5, seconds)

    def test_connection_closed_immediately_is_unavailable(self):
        class Rude(FakeGateway):
            def greet(self, connection):
                connection.close()

        self.fails(69, "ended the connection", "status", gateway=self.serve(Rude))

    def test_connection_refused_prints_the_reason(self):
        class Full(FakeGateway):
            def greet(self, connection):
                self.say(connection, {"id": None, "ok": False, "error": "too_many_clients", "message": "16 of 16; close one"})

        self.fails(1, "refused (too_many_clients): 16 of 16; close one", "status", gateway=self.serve(Full))

    def test_another_service_on_the_socket_is_reported(self):
        for first in (b"ok iwheel-sim\n", b"[1,2]\n", b'{"event":"hi"}\n', b'{"event":"hello","event":"hello"}\n', b"x" * 70000, b"\0\n"):

            class Other(FakeGateway):
                def greet(self, connection, first=first):
                    connection.sendall(first)

            self.fails(70, "does not use the gateway's protocol", "status", gateway=self.serve(Other))

    def test_reply_in_single_bytes_between_events_is_understood(self):
        class Slow(FakeGateway):
            def on_why(self, connection, request):
                self.say(connection, {"event": "lost", "count": 3})
                self.say(connection, {"id": 99, "ok": False, "error": "internal", "message": "not yours"})
                text = json.dumps({"id": request["id"], "ok": True, "number": 1, "sentence": "it stopped", "latched": True})
                for byte in text.encode() + b"\n":
                    connection.sendall(bytes([byte]))

        code, out, _, _ = self.ctl("why", gateway=self.serve(Slow))
        self.assertEqual(0, code)
        self.assertTrue(out.startswith("it stopped\n"), out)

    def test_no_reply_times_out_in_two_seconds(self):
        code, _, err, seconds = self.ctl("reset", gateway=self.serve(reset=None))
        self.assertEqual(75, code)
        self.assertTrue(1.9 < seconds < 3.5, (seconds, err))


class Showing(WithGateway):
    def show(self, values, why=None, **more):
        gateway = self.serve(status={"ok": True, **values}, **({"why": why} if why else {}))
        code, out, err, _ = self.ctl("status", gateway=gateway, **more)
        self.assertEqual(0, code, err)
        for line in out.splitlines():
            self.assertLessEqual(len(line), 80, line)
            self.assertNotRegex(line, r"[\x00-\x08\x0b-\x1f\x7f]")
        return out

    def test_units_and_values_side_by_side(self):
        out = self.show(snapshot("armed", left=wheel(298, 300), right=wheel(-301, -300)))
        self.assertRegex(out, r"measured +298 mm/s, 14 rpm +-301 mm/s, -16 rpm")
        self.assertRegex(out, r"applied +300 mm/s, -- +-300 mm/s, --")
        self.assertRegex(out, r"distance +12\.345 m, 5000000000 ticks +12\.345 m")
        self.assertRegex(out, r"net force +-0\.120 N +-0\.120 N")
        self.assertRegex(out, r"force offset +8\.000 N wheel +8\.000 N wheel")
        self.assertRegex(out, r"offset age +1\.0 s ago, 0\.010 N noise +1\.0 s ago")
        self.assertRegex(out, r"battery +24\.3 V, 17 ms ago +24\.3 V")
        self.assertIn("client lost: at most 887 ms, 0.554 m", out)
        self.assertIn("gateway killed: at most 1000 ms, 1.000 m, then unknown", out)

    def test_zero_of_an_earlier_run_shows_source_and_time(self):
        stored = {"offset_provenance": "stored", "offset_origin": "operator"}
        out = self.show(snapshot(left=wheel(**stored, offset_age_ms=3 * 86400000), right=wheel(**stored, offset_age_ms=7200000)))
        self.assertRegex(out, r"force offset +8\.000 N stored \(operator\) +8\.000 N stored \(operator\)")
        self.assertRegex(out, r"offset age +3 days ago, 0\.010 N noise +2 h ago")

    def test_zero_measured_under_load_is_in_doubt(self):
        none = wheel(force_offset_mN=None, offset_provenance="none", offset_origin=None, offset_contaminated=True)
        self.assertRegex(self.show(snapshot(left=none)), r"force offset +-- none IN DOUBT +8\.000 N wheel")

    def test_setpoint_unacknowledged_by_online_wheels_names_restart(self):
        restart = ("ip link set can7 down; ip link set can7 up", "systemctl enable --now iwheel-can-restart@can7.path")

        class Stalled(FakeGateway):
            online, bus = True, "can7"

            def on_status(self, _connection, _request):
                return {
                    "ok": True,
                    **snapshot(
                        "latched",
                        cause="send_stalled",
                        present=["send_stalled"],
                        left=wheel(),
                        right=wheel(heard=self.online),
                        bus={"name": self.bus, "state": "active"},
                    ),
                }

            def on_why(self, _connection, _request):
                return NOT_ACKNOWLEDGED

        gateway = self.serve(Stalled)
        doctor = ("doctor", "--no-press", "--listen", "200ms")
        for online, bus in ((True, "can7"), (False, "can7"), (True, "unix:/nowhere")):
            gateway.online, gateway.bus = online, bus
            outputs = {words[0]: self.ctl(*words, gateway=gateway)[1] for words in (("status",), ("why",), doctor)}
            findings = json.loads(self.ctl("--json", *doctor, gateway=gateway)[1])["findings"]
            (finding,) = (finding for finding in findings if finding["check"] == "send_stalled")
            self.assertEqual("fail", finding["verdict"])
            outputs["finding"] = finding["cure"]
            for what, text in outputs.items():
                text = " ".join(text.split())
                for command in restart:
                    self.assertEqual(online and bus == "can7", command in text, (what, text))
                self.assertEqual(not (online and bus == "can7"), "check the wheels' power and the cable" in text, (what, text))

    def test_why_of_setpoint_acknowledged_since_names_no_fix(self):
        self.assertNotIn("still", self.ctl("why", gateway=self.serve(why=NOT_ACKNOWLEDGED))[1])

    def test_contradiction_shows_observation_cost_and_next_step(self):
        entry = {
            "state": "contradicted",
            "evidence": "operator",
            "figure": None,
            "value": "no",
            "reason": "the operator found yes",
            "disabled": "arm is refused; correct invert under [left]",
        }
        out = self.show(snapshot(ledger={"mount_sign_left": entry}))
        self.assertIn("next          cannot arm, mount_sign_left is contradicted: correct invert", out)
        self.assertIn("CONTRADICTED  mount_sign_left = no: the operator found yes; disabled: arm is", out)
        self.assertNotIn("ready:", out)

    def test_wheels_that_turn_are_not_ready(self):
        for state in ("listening", "latched"):
            out = self.show(snapshot(state, rolling=True, left=wheel(281), right=wheel(281)))
            self.assertRegex(out, rf"STATE +{state}, rolling\nnext +a wheel turns although the gateway sends nothing")
            self.assertNotIn("ready:", out)
        for side in ("left", "right"):
            out = self.show(snapshot(rolling=False, **{side: wheel(60)}))
            self.assertIn("next          cannot arm: a wheel turns;", out)
            self.assertNotIn("ready:", out)

    def test_memory_is_shown_when_it_does_not_work(self):
        self.assertNotIn("STORED", self.show(snapshot(memory={"file": "/x/ledger-can0", "state": "kept", "reason": None})))
        out = self.show(snapshot(memory={"file": "/x/ledger-can0", "state": "failed", "reason": "No space left on device"}))
        self.assertIn("NOT STORED    /x/ledger-can0: No space left on device", out)

    def test_full_battery_is_a_lower_bound(self):
        out = self.show(snapshot(left=wheel(battery_dV=255, saturated={"battery": True})))
        self.assertRegex(out, r"battery +>= 25\.5 V, 17 ms ago +24\.3 V")

    def test_unknown_is_never_a_number(self):
        nothing = dict.fromkeys(wheel())
        out = self.show(snapshot(left={**nothing, "heard": False}, right={**nothing, "heard": False}))
        below = out[out.index("WHEELS") : out.index("POSE")]
        self.assertNotRegex(below, r"\d")
        self.assertIn("LEFT OFFLINE", below)
        self.assertGreaterEqual(below.count("--"), 40)

    def test_missing_and_wrong_fields_do_no_harm(self):
        self.assertIn("--", self.show({}))
        self.show(dict.fromkeys(snapshot(), 7))
        self.show(dict.fromkeys(snapshot(), "x"))
        self.show({key: [] for key in snapshot()})
        self.show({key: {} for key in snapshot()})
        self.show(snapshot(left=dict.fromkeys(wheel(), "x" * 300), present=[1, None], warnings=[{}, "w" * 500]))

    def test_names_cannot_command_the_terminal(self):
        lease = {"holder": 3, "name": "\u001b[2J\u0007\u009bevil\n", "pid": 1, "remaining_ms": 5, "lease_ms": 200}
        out = self.show(snapshot("armed", lease=lease, cause="\u001b]0;x"))
        self.assertIn("evil", out)

    MOVING = "\u007f\u0080\u009b2J\u009f\u061c\u200e\u200f\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"

    def hostile(self):
        """A gateway that sends such characters as they are, and others between its values."""

        class Hostile(FakeGateway):
            @staticmethod
            def say(connection, value):
                connection.sendall(json.dumps(value, ensure_ascii=False, separators=(",\r", ":\t")).encode() + b"\n")

            def on_status(self, _connection, _request):
                return {"ok": True, **snapshot("armed", cause=Showing.MOVING, warnings=[Showing.MOVING])}

            def on_why(self, _connection, _request):
                return {"ok": True, "number": 1, "sentence": Showing.MOVING, "latched": True, "recording": "/x" + Showing.MOVING}

            def on_stop(self, _connection, _request):
                return {"ok": False, "error": "busy" + Showing.MOVING, "message": Showing.MOVING}

            def on_watch(self, connection, request):
                reply = {"id": request["id"], **super().on_watch(connection, request)}
                self.say(connection, reply)
                self.say(connection, {"event": "lease", "name": Showing.MOVING, "filler": "x" * 5000 + Showing.MOVING})

        return self.serve(Hostile)

    def assert_plain(self, text):
        self.assertNotRegex(text, "[\\x00-\\x09\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u2028-\\u202e\\u2066-\\u2069]")

    def test_nothing_of_a_hostile_gateway_reaches_the_terminal_raw(self):
        gateway = self.hostile()
        for words in (("status",), ("why",), ("stop",), ("--json", "status"), ("--json", "why"), ("--json", "stop")):
            code, out, err, _ = self.ctl(*words, gateway=gateway)
            self.assertIn(code, (0, 1), err)
            self.assertTrue(out + err)
            self.assert_plain(out + err)
            if words[0] == "--json" and words[1] == "status":
                self.assertEqual(json.loads(out)["cause"], self.MOVING, "by number, so that programs read the same")

    def test_watch_prints_control_characters_of_events_as_numbers(self):
        process = start("--socket", self.hostile().path, "watch")
        self.addCleanup(process.kill)
        line = process.stdout.readline()
        self.assert_plain(line)
        event = json.loads(line)
        self.assertEqual((event["name"], event["filler"]), (self.MOVING, "x" * 5000 + self.MOVING))
        end(process, signal.SIGINT)

    def test_latched_names_cause_sentence_and_fix(self):
        out = self.show(
            snapshot("latched", cause="wheel_lost"), why={"ok": True, "number": 1, "sentence": "left wheel sent no telemetry for 53 ms", "latched": True}
        )
        self.assertIn("latched (wheel_lost)", out)
        self.assertRegex(out, r"next +switch the wheels on")
        self.assertIn("iwheelctl reset", out)
        self.assertIn("left wheel sent no telemetry for 53 ms", out)

    def test_held_zeros_are_shown_with_what_ends_them(self):
        out = self.show(snapshot("stopping", cause="client_stop", holding=True))
        self.assertIn("stopping (client_stop), holding", out)
        self.assertIn("iwheelctl release", out)
        self.assertNotIn("iwheelctl release", self.show(snapshot("stopping", cause="client_stop")))

    def test_listening_names_what_prevents_arming(self):
        unset = {
            "setpoint_type": {"state": "assumed", "evidence": "none"},
            "track": {"state": "assumed", "evidence": "none"},
            "wheel_radius": {"state": "contradicted"},
        }
        out = self.show(snapshot(ledger=unset, present=["bus_down"]))
        self.assertIn("set setpoint_type", out)
        self.assertIn("set track_mm under [wheels]; iwheelctl bringup measures it", " ".join(out.split()))
        self.assertNotIn("current_role", out)
        self.assertIn("bus_down: bring the bus up", out)
        self.assertIn("CONTRADICTED  wheel_radius", out)
        self.assertRegex(out, r"UNVERIFIED +setpoint_type")

    def test_json_is_the_gateways_own_line(self):
        code, out, _, _ = self.ctl("--json", "status")
        self.assertEqual(0, code)
        self.assertEqual({"id": 1, "ok": True, **snapshot()}, json.loads(out))
        self.assertEqual(["status"], [request["cmd"] for _, request in self.gateway.requests])
        code, out, err, _ = self.ctl("reset", "--json")
        self.assertEqual((1, "estop_pressed", ""), (code, json.loads(out)["error"], err))

    def test_colours_only_on_a_terminal_without_no_color(self):
        import pty

        for term, no_color, wanted in (("xterm", None, True), ("dumb", None, False), ("xterm", "1", False)):
            parent, child = pty.openpty()
            more = {"TERM": term, **({"NO_COLOR": no_color} if no_color else {})}
            done = subprocess.run([PROGRAM, "--socket", self.gateway.path, "status"], stdout=child, env=environment(**more), check=False)
            os.close(child)
            shown = b""
            try:
                while chunk := os.read(parent, 65536):
                    shown += chunk
            except OSError:
                pass
            os.close(parent)
            self.assertEqual(0, done.returncode)
            self.assertEqual(wanted, b"\033[" in shown, (term, no_color))

    def test_why_with_an_empty_sentence_is_no_stop(self):
        gateway = self.serve(why={"ok": True, "number": 0, "sentence": ""})
        self.assertEqual("no stop since the gateway's start\n", self.ctl("why", gateway=gateway)[1])

    def test_why_of_board_without_wall_clock_prints_only_the_age(self):
        stop = {"ok": True, "number": 1, "sentence": "somebody said stop", "latched": False, "age_ms": 553}
        for wall_us, wanted in ((None, r"\n0\.553 s ago; it did not latch\n"), (10**15, r"\nat 2001-09-0.*, 0\.553 s ago; it did not latch\n")):
            gateway = self.serve(why={**stop, "wall_us": wall_us})
            self.assertRegex(self.ctl("why", gateway=gateway)[1], wanted)

    def test_why_without_a_stop_says_so(self):
        code, out, _, _ = self.ctl("why")
        self.assertEqual((0, "no stop since the gateway's start\n"), (code, out))

    def test_output_that_cannot_be_written_is_no_success(self):
        with open("/dev/full", "w", encoding="ascii") as full:
            done = subprocess.run([PROGRAM, "--socket", self.gateway.path, "status"], stdout=full, stderr=subprocess.PIPE, check=False)
        self.assertEqual(69, done.returncode)


class Asking(WithGateway):
    def test_reading_verbs_send_nothing_that_moves(self):
        for words in (["status"], ["why"], ["status", "--json"]):
            self.ctl(*words)
        watch = start("--socket", self.gateway.path, "watch")
        until(lambda: self.gateway.count("watch"))
        watch.send_signal(signal.SIGINT)
        self.assertEqual(0, watch.wait(5))
        watch.communicate()
        self.assertLessEqual({request["cmd"] for _, request in self.gateway.requests}, {"status", "why", "watch"})

    def assert_one_request(self, wanted):
        """Its id is the number of the attempt: on a slow machine the first connection can time out before its line is read."""
        requests = [request for _, request in self.gateway.requests]
        self.assertEqual([wanted], [{name: value for name, value in request.items() if name != "id"} for request in requests])
        self.assertGreaterEqual(requests[0]["id"], 1)

    def test_simple_verbs_send_one_request(self):
        for words, wanted in (
            (["stop"], {"cmd": "stop"}),
            (["disarm"], {"cmd": "stop"}),
            (["estop"], {"cmd": "estop"}),
            (["estop", "dog", "in", "the way"], {"cmd": "estop", "reason": "dog in the way"}),
            (["estop", "x" * 300], {"cmd": "estop", "reason": "x" * 200}),
        ):
            self.gateway.requests.clear()
            self.assertEqual(0, self.ctl(*words)[0])
            self.assert_one_request(wanted)

    def test_stop_with_a_mistake_in_its_words_stops_and_is_usage(self):
        for words, cmd in (
            (["stop", "now"], "stop"),
            (["disarm", "--for", "2s"], "stop"),
            (["-x", "stop", "now"], "stop"),
            (["stop", "--"], "stop"),
            (["--json", "stop", "--socket"], "stop"),
            (["estop", ""], "estop"),
            (["--jsn", "estop"], "estop"),
        ):
            self.gateway.requests.clear()
            code, out, err, _ = self.ctl(*words)
            self.assertEqual((64, 1), (code, err.count("\n")), (words, err))
            self.assertIn("stopping" if cmd == "stop" else "latched", out)
            self.assert_one_request({"cmd": cmd})
        self.gateway.requests.clear()
        self.assertEqual((64, ""), self.ctl("stop", "--help", "")[:2])
        self.assertEqual(69, run("--socket", "/nonexistent", "stop", "now")[0])
        self.assertEqual([], self.gateway.requests)

    def test_stop_without_socket_stops_each_of_several_gateways(self):
        class Hung(FakeGateway):
            def greet(self, connection):
                time.sleep(3)

        other, hung = self.serve(), self.serve(Hung)
        folder = tempfile.TemporaryDirectory(dir=os.path.dirname(self.gateway.folder.name))
        self.addCleanup(folder.cleanup)
        os.link(self.gateway.path, os.path.join(folder.name, "can0.sock"))
        with socket.socket(socket.AF_UNIX) as killed:
            killed.bind(os.path.join(folder.name, "dead.sock"))

        def found(*words):
            """In a name space in which the folder is that of the gateways' sockets."""
            mount = 'cd "$0" && mount -t tmpfs none /run && mkdir /run/iwheel && mount -c --bind . /run/iwheel && exec "$@"'
            command = ["unshare", "--mount", "sh", "-c", mount, folder.name, PROGRAM, *words]
            done = subprocess.run(command, capture_output=True, text=True, timeout=30, env=environment(), check=False)
            return done.returncode, done.stdout, done.stderr

        if subprocess.run(["unshare", "--mount", "mount", "-t", "tmpfs", "none", "/run"], capture_output=True, check=False).returncode != 0:
            self.skipTest("needs the right to mount")
        self.assertEqual((0, ""), found("status")[::2])
        for gateway, name in ((other, "can1.sock"), (hung, "can2.sock")):
            os.link(gateway.path, os.path.join(folder.name, name))
        code, _, err = found("status")
        self.assertEqual((64, 3), (code, err.count("/run/iwheel/can")), err)
        for verb, state in (("stop", "stopping"), ("estop", "latched")):
            code, out, err = found(verb)
            self.assertEqual(0, code, err)
            self.assertEqual([f"/run/iwheel/can{i}.sock: {state}" for i in (0, 1)], sorted(line.split(": ")[0] + ": " + state for line in out.splitlines()))
            self.assertIn("can2.sock: the stop failed", err)
            self.assertEqual((1, 1), (self.gateway.count(verb), other.count(verb)))
        self.gateway.close()
        other.close()
        self.assertEqual(75, found("stop")[0])

    def test_reason_that_is_no_text_still_stops(self):
        done = subprocess.run([PROGRAM.encode(), b"--socket", self.gateway.path.encode(), b"estop", b"\xff\xfe"], capture_output=True, check=False)
        self.assertEqual(0, done.returncode)
        self.assert_one_request({"cmd": "estop"})

    def test_tare_shows_the_new_offset_of_the_side(self):
        code, out, _, _ = self.ctl("tare", "left")
        self.assertEqual((0, "left: the present force is zero now, 8.000 N (40 samples, 0.110 N noise); it was -- (none)\n"), (code, out))
        self.assertEqual("left", self.gateway.requests[0][1]["side"])
        self.assertEqual(2, self.ctl("tare")[1].count("zero now, 8.000 N"))

    def test_config_shows_stages_commits_and_names_pending_values(self):
        self.assertEqual("wheels.setpoint_type is not set\ndrive.lease_ms = 200\n", self.ctl("config")[1])
        _, out, _, _ = self.ctl("config", "set", "drive.lease_ms", "300")
        self.assertEqual("drive.lease_ms = 300\nstaged, and not in force yet; next: iwheelctl config commit (or iwheelctl config discard)\n", out)
        self.assertEqual("committed: the board restarts with it and closes its clients, which connect again\n", self.ctl("config", "commit")[1])
        self.assertEqual("discarded: the staged values are dropped\n", self.ctl("config", "discard")[1])
        self.assertEqual(
            [{}, {"key": "drive.lease_ms", "value": "300"}, {"commit": True}, {"commit": False}],
            [{name: value for name, value in request.items() if name not in ("cmd", "id")} for _, request in self.gateway.requests],
        )
        code, _, err, _ = self.ctl("config", "set", "bus.interface", "can1")
        self.assertEqual((1, True), (code, "no key of this gateway" in err), err)
        for words in (("set",), ("set", "drive.lease_ms"), ("set", "a", "b", "c"), ("show", "me"), ("write",)):
            self.assertEqual(64, self.ctl("config", *words)[0], words)

    def test_ledger_in_figures_alone_has_the_same_texts(self):
        figures = {
            "force_unit_left": {"state": "confirmed", "evidence": "bus", "figure": 10012, "value": "cN"},
            "track": {"state": "assumed", "evidence": "none", "figure": None, "value": "540"},
            "dlc": {"state": "confirmed", "evidence": "bus"},
            "wheel_radius": {"state": "contradicted", "evidence": "operator", "figure": None, "value": "192", "reason": None, "disabled": None},
        }
        self.gateway.on_status = lambda *_: {"ok": True, **snapshot(ledger=figures)}
        out = " ".join(self.ctl("ledger")[1].split())
        for text in (
            "dlc: measured on the bus",
            "force_unit_left = cN: at standstill, raw / offset is 10.012",
            "track = 540: not documented, not verified",
            "wheel_radius = 192: the operator found something else",
            "disabled: no speed in mm/s and no distance; correct radius_mm",
        ):
            self.assertIn(text, out)
        self.assertIn("the operator found something else", " ".join(self.ctl("status")[1].split()))

    def test_confirm_sends_item_and_value_and_prints_the_result(self):
        code, out, _, _ = self.ctl("confirm", "wheel_radius")
        self.assertEqual((0, "CONFIRMED     wheel_radius = 192: the operator ? says so\n"), (code, out))
        code, out, _, _ = self.ctl("confirm", "wheel_radius", "181")
        self.assertEqual(0, code)
        self.assertTrue(out.startswith("CONTRADICTED  wheel_radius = 192: "), out)
        self.assertIn("disabled: no distance; correct radius_mm", out)
        self.assertEqual(
            [{"cmd": "confirm", "item": "wheel_radius", "id": 1}, {"cmd": "confirm", "item": "wheel_radius", "value": "181", "id": 1}],
            [request for _, request in self.gateway.requests],
        )

    def test_confirm_sends_how_it_was_found(self):
        for words in (("track", "545", "--how", "a tape"), ("--how", "a tape", "track", "545")):
            self.gateway.requests.clear()
            self.assertEqual(0, self.ctl("confirm", *words)[0])
            self.assertEqual([{"cmd": "confirm", "item": "track", "value": "545", "how": "a tape", "id": 1}], [request for _, request in self.gateway.requests])
        self.gateway.requests.clear()
        for words in (("track", "545", "--how"), ("--how", "a tape"), ("track", "545", "600"), ("--how",)):
            self.assertEqual(64, self.ctl("confirm", *words)[0], words)
        self.assertFalse(self.gateway.requests)

    def test_ledger_prints_every_item_once_under_its_state(self):
        code, out, _, _ = self.ctl("ledger")
        self.assertEqual(0, code)
        self.assertEqual(1, out.count("setpoint_type"))
        self.assertTrue(out.startswith("ASSUMED"), out)

    def test_refusal_prints_name_and_message_and_exits_1(self):
        code, out, err, _ = self.ctl("reset")
        self.assertEqual((1, ""), (code, out))
        self.assertEqual("iwheelctl: refused (estop_pressed): the e-stop is pressed; release the button\n", err)

    def test_wrong_words_are_usage_and_are_not_sent(self):
        wrong = {
            "": ("", "fly", "-x"),
            "status": ("x", "--all"),
            "reset": ("1",),
            "release": ("1",),
            "why": ("me",),
            "tare": ("middle", "left right"),
            "confirm": ("", "dlc yes x"),
            "ledger": ("x",),
            "watch": ("speed", "--rate", "--rate 0", "--rate 101", "--rate 1x"),
            "drive": ("", "1", "1 2 3", "1.5 2", "a b", "40000 0", "32768 0", "0 -32769", "-- 1", "99999999999 1", "- 1", "1mm 2"),
            "drive 1 2": ("--current 1", "--current 2001 0", "--fast"),
            "drive 1 2 --for": ("", "2", "0s", "-1s", "601s", "1.5ms", "2h", "99999999999s"),
        }
        for words in (["drive", "", ""], *(f"{verb} {more}".split() for verb, all_of in wrong.items() for more in all_of)):
            code, out, err, _ = self.ctl(*words)
            self.assertEqual((64, ""), (code, out), words)
            self.assertTrue(err.startswith("iwheelctl: "), words)
        self.assertEqual([], self.gateway.requests)

    def test_unknown_verb_lists_the_known(self):
        err = self.ctl("fly")[2]
        for verb in VERBS:
            self.assertIn(verb, err)

    def test_help_of_every_verb_needs_no_gateway(self):
        for verb in VERBS:
            code, out, _ = run(verb, "--help")
            self.assertEqual(0, code)
            self.assertTrue(out.startswith("Usage: iwheelctl "), verb)
        self.assertEqual(0, run("--help")[0])
        self.assertRegex(run("--version")[1], r"^iwheelctl \d+\.\d+\.\d+\n$")


class Driving(WithGateway):
    def drive(self, *words, gateway=None):
        return self.ctl("drive", *words, gateway=gateway)

    def assert_stopped_once(self, gateway, drives_after=0):
        self.assertEqual(1, gateway.count("arm"))
        self.assertEqual(1, gateway.count("stop"))
        after = [at for at in gateway.times("drive") if at > gateway.times("stop")[0]]
        self.assertEqual(drives_after, len(after))

    def assert_spacing(self, gateway, seconds, most, late=1.5):
        """Never more than `most` commands, and half of them that far apart or less, however slow the machine was now and then; at most `late` times it."""
        times = gateway.times("drive")
        spacing = statistics.median(after - before for before, after in itertools.pairwise(times))
        self.assertLessEqual(len(times), most)
        self.assertTrue(0.8 * seconds < spacing < late * seconds, spacing)

    def test_drive_with_serial_commands_lost_ends_only_after_1_s(self):
        class Lossy(FakeGateway):
            last = 10**6  # Number of commands; later ones are ignored.

            def on_drive(self, connection, request):
                done = super().on_drive(connection, request)
                lost = self.driving > 1 and (self.driving % 3 == 0 or self.driving > self.last)
                return {"ok": False, "error": "stale_command", "message": "lost on the line"} if lost else done

        for last, wanted in ((10**6, 0), (20, 75)):
            gateway = self.serve(Lossy)
            gateway.last = last
            code, _, err, _ = self.drive("200", "200", "--for", "2s", gateway=gateway)
            self.assertEqual(wanted, code, err)
            self.assertEqual(wanted == 75, "did not answer a drive command for 1 s" in err, err)
            self.assert_stopped_once(gateway)

    def test_arms_drives_at_a_third_of_the_lease_and_stops(self):
        code, out, err, seconds = self.drive("-300", "250", "--for", "1s")
        self.assertEqual((0, ""), (code, err))
        self.assertRegex(out, r"^drove -300/250 mm/s for 1\.0 s and stopped: left 0\.000 m, right 0\.000 m\n$")
        self.assertTrue(1.2 < seconds < 3, seconds)
        self.assert_stopped_once(self.gateway)
        self.assert_spacing(self.gateway, 0.020, most=52)
        times = self.gateway.times("drive")
        self.assertTrue(0.97 < self.gateway.times("stop")[0] - times[0] < 1.1)
        # The next drive must not be refused as stale because of this one.
        until(lambda: self.gateway.closed_at is not None)
        self.assertGreater(self.gateway.closed_at - times[-1], 0.5)
        arm = next(request for _, request in self.gateway.requests if request["cmd"] == "arm")
        self.assertEqual({"cmd": "arm", "name": "iwheelctl", "t_us": snapshot()["t_us"], "id": arm["id"]}, arm)
        first = next(request for _, request in self.gateway.requests if request["cmd"] == "drive")
        self.assertEqual({"cmd": "drive", "left_mm_s": -300, "right_mm_s": 250, "id": first["id"]}, first)

    def test_drive_past_a_reboot_reports_the_distance_as_unknown(self):
        class Rebooting(FakeGateway):
            def on_status(self, connection, request):
                status = super().on_status(connection, request)
                if self.stopped_at is not None:
                    status["left"].update(reboots=1, distance_mm=10013)
                return status

        code, out, err, _ = self.drive("200", "200", "--for", "200ms", gateway=self.serve(Rebooting))
        self.assertEqual((0, ""), (code, err))
        self.assertIn("left unknown, right 0.000 m", out)

    def test_takeover_and_currents_are_passed_on(self):
        self.assertEqual(0, self.drive("1", "2", "--takeover", "--current", "-5", "6", "--for", "100ms")[0])
        arm = next(request for _, request in self.gateway.requests if request["cmd"] == "arm")
        first = next(request for _, request in self.gateway.requests if request["cmd"] == "drive")
        self.assertIs(True, arm["takeover"])
        self.assertEqual((-5, 6), (first["left_mA"], first["right_mA"]))

    def test_refused_arm_drives_nothing(self):
        gateway = self.serve(arm={"ok": False, "error": "busy", "message": '"joystick" drives'})
        self.fails(1, 'refused (busy): "joystick" drives', "drive", "1", "2", gateway=gateway)
        self.assertEqual(0, gateway.count("drive"))

    def test_arm_refused_before_standstill_is_requested_again(self):
        class ComingToRest(FakeGateway):
            def on_arm(self, connection, request):
                if self.count("arm") < 4:
                    return {"ok": False, "error": "not_at_rest", "message": "the wheels turn: wait until both stand"}
                return super().on_arm(connection, request)

        gateway = self.serve(ComingToRest)
        code, out, err, _ = self.drive("200", "200", "--for", "100ms", gateway=gateway)
        self.assertEqual((0, "iwheelctl: waiting for one second at most, because the wheels turn: wait until both stand\n"), (code, err))
        self.assertIn("drove 200/200 mm/s", out)
        self.assertEqual(4, gateway.count("arm"))
        self.assertGreater(gateway.times("drive")[0], gateway.times("arm")[-1])

    def test_wheels_that_go_on_turning_are_awaited_for_one_second(self):
        for words in ([], ["--json"]):
            gateway = self.serve(arm=PUSHED)
            code, out, err, _ = self.ctl(*words, "drive", "200", "200", gateway=gateway)
            times = gateway.times("arm")
            self.assertEqual((1, 0), (code, gateway.count("drive")))
            self.assertEqual(1, err.count("waiting for one second"))
            self.assertEqual((0, 1) if words else (1, 0), (err.count("refused (not_at_rest)"), out.count("not_at_rest")))
            self.assertTrue(1.0 <= times[-1] - times[0] < 3, times[-1] - times[0])
            self.assertTrue(2 < len(times) <= 22, len(times))

    def test_signal_while_the_wheels_are_waited_for_ends_it(self):
        gateway = self.serve(arm=PUSHED)
        process = start("--socket", gateway.path, "drive", "200", "200")
        until(lambda: gateway.count("arm") > 1)
        _, err = end(process, signal.SIGINT)
        self.assertEqual((1, 0), (process.returncode, gateway.count("drive")))
        self.assertIn("interrupted", err)

    def test_every_signal_stops_immediately_and_waits(self):
        for number in SIGNALS:
            gateway = self.serve()
            process = start("--socket", gateway.path, "drive", "200", "200", "--for", "60s")
            until(lambda g=gateway: g.count("drive") > 5)
            sent = time.monotonic()
            _, err = end(process, number)
            self.assertEqual(1, process.returncode, number)
            self.assertIn("interrupted after", err)
            self.assertLess(gateway.times("stop")[0] - sent, 0.1)
            self.assert_stopped_once(gateway)
            # One status before arming; then until 0.2 s after the stop, when the wheels are at standstill.
            self.assertGreater(gateway.times("status")[-1] - gateway.times("stop")[0], 0.2)

    def test_signal_before_the_first_answer_counts_no_time(self):
        gateway = self.serve(drive=None)
        process = start("--socket", gateway.path, "drive", "200", "200")
        until(lambda: gateway.count("drive") > 2)
        _, err = end(process, signal.SIGINT)
        self.assertIn("interrupted after 0.0 s of 2.0 s", err)

    def test_refusal_in_motion_stops_and_never_arms_again(self):
        class Latching(FakeGateway):
            def on_drive(self, connection, request):
                if self.driving < 10:
                    return super().on_drive(connection, request)
                return {"ok": False, "error": "latched", "message": "the e-stop was pressed"}

            def on_why(self, _connection, _request):
                return {"ok": True, "number": 1, "sentence": "e-stop pressed while driving 200/200 mm/s"}

        gateway = self.serve(Latching)
        code, _, err, _ = self.drive("200", "200", gateway=gateway)
        self.assertEqual(1, code)
        self.assertIn("the last stop: e-stop pressed while driving 200/200 mm/s", err)
        self.assertIn("refused (latched): the e-stop was pressed", err)
        self.assert_stopped_once(gateway)

    def test_silent_gateway_gets_a_stop_after_one_second(self):
        class Deaf(FakeGateway):
            def on_drive(self, connection, request):
                return super().on_drive(connection, request) if self.driving < 5 else None

        gateway = self.serve(Deaf)
        self.fails(75, "did not answer a drive command for 1 s", "drive", "200", "200", "--for", "10s", gateway=gateway)
        self.assert_stopped_once(gateway)
        self.assertTrue(0.9 < gateway.times("stop")[0] - gateway.times("drive")[4] < 1.3)

    def test_lost_gateway_is_reported(self):
        class Dying(FakeGateway):
            def on_drive(self, connection, request):
                if self.driving > 5:
                    connection.shutdown(socket.SHUT_RDWR)
                return super().on_drive(connection, request)

        seconds = self.fails(69, "watchdog", "drive", "200", "200", "--for", "10s", gateway=self.serve(Dying))
        self.assertLess(seconds, 2)

    def test_stalled_client_sends_no_burst(self):
        process = start("--socket", self.gateway.path, "drive", "200", "200", "--for", "1s")
        until(lambda: self.gateway.count("drive") > 5)
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.4)
        process.send_signal(signal.SIGCONT)
        process.communicate(timeout=10)
        self.assertLess(self.gateway.count("drive"), 36)  # 50 without the stall of 20 periods

    def test_latch_while_stopping_is_no_success(self):
        class LatchesAtStop(FakeGateway):
            def on_status(self, connection, request):
                if self.stopped_at is None:
                    return super().on_status(connection, request)
                return {"ok": True, **snapshot("latched", cause="wheel_rebooted")}

        code, out, err, _ = self.drive("1", "2", "--for", "100ms", gateway=self.serve(LatchesAtStop))
        self.assertEqual(1, code)
        self.assertIn("drove 1/2 mm/s", out)
        self.assertIn("while stopping the gateway latched (wheel_rebooted)", err)

    def test_lost_wheel_after_the_stop_is_reported_without_wait(self):
        class Unheard(FakeGateway):
            def on_status(self, connection, request):
                if self.stopped_at is None:
                    return super().on_status(connection, request)
                return {"ok": True, **snapshot("latched", left=wheel(heard=False, at_rest=None))}

        code, out, err, seconds = self.drive("1", "2", "--for", "100ms", gateway=self.serve(Unheard))
        self.assertEqual((1, ""), (code, out))
        self.assertIn("so it may still turn", err)
        self.assertLess(seconds, 4)

    def test_warnings_of_arm_are_shown(self):
        class Warning(FakeGateway):
            def on_arm(self, connection, request):
                return {**super().on_arm(connection, request), "warnings": ["no e-stop is configured"]}

        err = self.drive("1", "2", "--for", "100ms", gateway=self.serve(Warning))[2]
        self.assertIn("warning: no e-stop is configured", err)

    def test_nonsense_lease_counts_as_the_shortest(self):
        for lease in (0, -5, 10**12, None, "200"):

            class Odd(FakeGateway):
                def on_arm(self, connection, request, lease=lease):
                    return {**super().on_arm(connection, request), "lease_ms": lease}

            gateway = self.serve(Odd)
            self.assertEqual(0, self.drive("1", "2", "--for", "200ms", gateway=gateway)[0])
            self.assert_spacing(gateway, 0.0067, most=35, late=2.5)  # The next one that is possible is 20 ms.

    def test_json_prints_the_replies_to_arm_drive_and_stop(self):
        _, out, _, _ = self.ctl("--json", "drive", "1", "2", "--for", "100ms")
        replies = [json.loads(line) for line in out.splitlines()]
        self.assertEqual(3, len(replies))
        self.assertEqual((60, 1, "stopping"), (replies[0]["lease_ms"], replies[1]["left_mm_s"], replies[2]["state"]))


class Watching(WithGateway):
    class Talkative(FakeGateway):
        size = 10

        def on_watch(self, connection, request):
            self.say(connection, {"id": request["id"], **super().on_watch(connection, request)})
            for number in range(100000):
                self.say(connection, {"event": "state", "number": number, "filling": "x" * self.size})

    def test_events_are_passed_on_line_by_line_until_a_signal(self):
        for number in SIGNALS:
            gateway = self.serve(self.Talkative)
            process = start("--socket", gateway.path, "watch", "state", "stop", "--rate", "50")
            lines = [json.loads(process.stdout.readline()) for _ in range(100)]
            end(process, number)
            self.assertEqual(0, process.returncode)
            self.assertEqual(list(range(100)), [line["number"] for line in lines])
            request = gateway.requests[0][1]
            self.assertEqual((["state", "stop"], 50), (request["topics"], request["rate_hz"]))

    def test_without_words_the_usual_topics(self):
        process = start("--socket", self.gateway.path, "watch")
        until(lambda: self.gateway.count("watch"))
        end(process)
        self.assertEqual(["state", "bus", "estop", "lease", "stop"], self.gateway.requests[0][1]["topics"])

    def test_reader_that_leaves_ends_it_with_0(self):
        process = start("--socket", self.serve(self.Talkative).path, "watch")
        process.stdout.readline()
        process.stdout.close()
        self.assertEqual(0, process.wait(5))
        self.assertEqual("", process.stderr.read())
        process.stderr.close()

    def test_reader_that_leaves_is_noticed_without_events(self):
        process = start("--socket", self.gateway.path, "watch")
        until(lambda: self.gateway.count("watch"))
        process.stdout.close()
        self.assertEqual(0, process.wait(5))
        process.stderr.close()

    def test_reader_that_never_reads_does_not_hold_off_a_signal(self):
        class Fat(self.Talkative):
            size = 60000

        process = start("--socket", self.serve(Fat).path, "watch")
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        self.assertEqual(0, process.wait(5))
        process.communicate()

    def test_slow_reader_gets_latest_values_and_number_of_skipped(self):
        class Flood(FakeGateway):
            total, done = 20000, False

            def on_watch(self, connection, request):
                self.say(connection, {"id": request["id"], **super().on_watch(connection, request)})
                for number in range(self.total):
                    self.say(connection, {"event": "state", "number": number, "filling": "x" * 200})
                    if number == 10:
                        self.say(connection, {"event": "fault", "cause": "bus_down", "present": True})
                self.done = True

        gateway = self.serve(Flood)
        process = start("--socket", gateway.path, "watch")
        until(lambda: gateway.done, 60)  # The output of iwheelctl is not read, but iwheelctl still receives all events.
        time.sleep(0.2)
        lines = []
        while not lines or lines[-1].get("number") != Flood.total - 1:
            lines.append(json.loads(process.stdout.readline()))
        end(process)
        states = [line["number"] for line in lines if line["event"] == "state"]
        lost = sum(line["count"] for line in lines if line["event"] == "lost")
        self.assertLess(len(states), Flood.total / 10)  # The contents of the pipe, and then the last one.
        self.assertEqual(states, sorted(states))
        self.assertEqual(Flood.total, len(states) + lost)
        self.assertEqual(1, sum(line["event"] == "fault" for line in lines))

    def test_gateway_that_ends_is_unavailable(self):
        class Ending(FakeGateway):
            def on_watch(self, connection, request):
                self.say(connection, {"id": request["id"], **super().on_watch(connection, request)})
                connection.shutdown(socket.SHUT_RDWR)

        process = start("--socket", self.serve(Ending).path, "watch")
        _, err = process.communicate(timeout=10)
        self.assertEqual(69, process.returncode)
        self.assertIn("ended the connection", err)

    def test_full_disk_is_reported(self):
        with open("/dev/full", "w", encoding="ascii") as full:
            process = start("--socket", self.serve(self.Talkative).path, "watch", stdout=full)
            _, err = process.communicate(timeout=10)
        self.assertEqual(69, process.returncode)
        self.assertTrue(re.search("cannot write: No space", err), err)
