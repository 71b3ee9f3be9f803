# SPDX-License-Identifier: MIT
"""iwheelctl top on terminals of many sizes, seen through a terminal emulator (pyte, from PyPI)."""

import os
import signal
import threading
import time
import unittest

import ctl
import pytest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
from fake_gateway import FakeGateway, snapshot
from harness import Rig
from operator_at_terminal import Operator

pyte = pytest.importorskip("pyte")  # PyPI, requirements/check.txt
pytestmark = pytest.mark.native("processor time: virtual time needs five times as much")


def environment(**more):
    return ctl.environment("LC_ALL", **{"TERM": "xterm-256color", "LANG": "C.UTF-8", **more})


class Top:
    """The program on an emulated terminal."""

    def __init__(self, path, columns=80, rows=24, **more):
        self.operator = Operator([ctl.program(), "--socket", path, "top"], environment(**more), columns, rows)
        self.screen = pyte.Screen(columns, rows)
        self.stream = pyte.ByteStream(self.screen)
        self.fed = 0

    def screen_after(self, seconds=0.0):
        """The rows of the screen."""
        end = time.monotonic() + seconds
        while True:
            self.operator.pump(0.05)
            self.stream.feed(self.operator.raw[self.fed :])
            self.fed = len(self.operator.raw)
            if time.monotonic() >= end:
                return list(self.screen.display)

    def wait_for(self, text, seconds=8.0):
        """The screen once the text is on it, and all that was drawn with it."""
        end = time.monotonic() + seconds
        while True:
            rows = self.screen_after()
            if any(text in row for row in rows):
                return self.screen_after(0.2)
            if time.monotonic() > end:
                raise AssertionError(f"{text!r} is not on the screen; exit status {self.operator.process.poll()}:\n" + "\n".join(rows))

    def blocks(self, row):
        """The big letters: which cells of a row are painted."""
        return "".join("#" if self.screen.buffer[row][x].reverse else " " for x in range(self.screen.columns)).rstrip()

    def resize(self, columns, rows):
        self.screen.resize(rows, columns)
        self.operator.resize(columns, rows)

    def press(self, key):
        self.operator.type(key)

    def end(self):
        self.operator.type("q")
        code = self.operator.wait()
        self.operator.close()
        return code


class WithWheels(unittest.TestCase):
    def setUp(self):
        # Wheels and echoes may be late: this machine does other things too.
        self.rig = Rig(ctl.BUILD, {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}})
        self.addCleanup(self.rig.close)
        self.rig.start_gateway()
        self.drives = []

    def top(self, *size, **more):
        top = Top(self.rig.path("gateway.sock"), *size, **more)
        self.addCleanup(top.operator.close)
        return top

    def full_top(self, **more):
        """With its whole screen."""
        top = self.top(**more)
        top.wait_for("LEDGER")
        return top

    def drive(self, left, right):
        process = ctl.start("--socket", self.rig.path("gateway.sock"), "drive", str(left), str(right), "--for", "20s")
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)
        self.drives.append(process)
        return process

    def see_driving(self, top):
        """The screen while it drives; a drive that a busy machine ended is begun again."""
        for _ in range(5):
            process = self.drive(300, -150)
            while process.poll() is None:
                rows = top.screen_after()
                if any("meas" in row and "│███" in row for row in rows) and any("300 mm/s" in row for row in rows):
                    return top.screen_after(0.5)
        raise AssertionError("it never drove:\n" + "\n".join(rows))

    def test_top_on_one_screen_shows_all_and_state_in_big_letters(self):
        top = self.top()
        rows = top.wait_for("LEDGER")
        self.assertEqual(24, len(rows))
        for text in (
            "e-stop released (SIMULATED)",
            "LEFT   appl",
            "RIGHT  appl",
            "force",
            "24.8 V",
            "BUS     active",
            "GAPS",
            "worst --",
            "STOP    at most",
            "SPACE stop   E e-stop   R reset   Q quit",
            "1 warning",
        ):
            self.assertTrue(any(text in row for row in rows), (text, rows))
        self.assertEqual(" #      ###   #### #####", top.blocks(1)[:24])  # L I S T
        self.assertEqual(" #####  ###  ####    #", top.blocks(5)[:22].rstrip())
        self.assertEqual(0, top.end())

    def test_bars_follow_the_wheels_and_space_stops_them(self):
        top = self.full_top()
        rows = self.see_driving(top)
        left, right = (next(row for row in rows if row.startswith(f" {name}")) for name in ("LEFT", "RIGHT"))
        self.assertIn("│███", left, rows)
        self.assertIn("███│", right)
        self.assertNotIn("███│", left)
        self.assertTrue(any("iwheelctl drives (pid" in row for row in rows), rows)
        self.assertTrue(any("worst" in row and "--" not in row for row in rows), rows)
        top.press("\x13")  # Ctrl-S.
        top.screen_after(1)
        top.press(" ")
        top.wait_for("stop: done, now stopping")
        rows = top.wait_for("last stop: ")
        self.assertTrue(any("client stop" in row for row in rows), rows)
        self.assertEqual(0, top.end())

    def test_keys_stop_without_a_connection(self):
        class OnlyStops(FakeGateway):  # As a gateway with its maximum of clients: no greeting.
            def greet(self, connection):
                pass

        gateway = OnlyStops()
        self.addCleanup(gateway.close)
        top = Top(gateway.path)
        self.addCleanup(top.operator.close)
        top.wait_for("does not answer")
        for key, cmd, name in ((" ", "stop", "stop"), ("e", "estop", "e-stop")):
            top.press(key)
            top.wait_for(f"{name}: done")
            self.assertEqual(1, gateway.count(cmd))
        gateway.close()
        top.press(" ")
        top.wait_for("stop failed: no program listens")
        self.assertEqual(0, top.end())

    def test_keys_latch_and_reset(self):
        top = self.full_top()
        top.press("E")
        rows = top.wait_for("estop software")
        self.assertEqual(" #      ###  ##### ", top.blocks(1)[:19])  # L A T
        self.assertTrue(any("then: iwheelctl reset" in row for row in rows))
        top.screen_after(1.2)  # The cause must not have been seen for a second.
        top.press("r")
        top.wait_for("reset: done")
        top.wait_for("ready: iwheelctl drive")
        self.rig.sim.ask("estop press")
        top.wait_for("e-stop pressed")
        top.wait_for("estop line")
        top.press("r")
        top.wait_for("reset refused")
        self.assertEqual(0, top.end())

    def test_machine_that_rolls_away_is_not_listening_and_ready(self):
        top = self.top(40, 24)
        top.wait_for("LISTENING")
        self.rig.sim.ask("slope 10")
        rows = top.wait_for(" ROLLING ")
        self.assertIn("hold the machine, or use its parking brake", " ".join(" ".join(rows).split()))
        self.assertFalse(any("ready:" in row for row in rows), rows)
        self.assertEqual(0, top.end())

    def test_every_size_shows_the_state_and_resizing_does_no_harm(self):
        top = self.full_top()
        for columns, rows in ((60, 24), (40, 12), (20, 4), (10, 2), (200, 60), (30, 24), (80, 10), (80, 24)):
            top.resize(columns, rows)
            screen = top.screen_after(0.5)
            self.assertEqual((rows, columns), (len(screen), len(screen[0])))
            big = rows >= 20 and columns >= 55
            self.assertTrue((big and "#" in top.blocks(1)) or any("LISTENING" in row for row in screen), (columns, rows, screen))
            if columns >= 40 and rows >= 10:
                self.assertTrue(any("mm/s" in row for row in screen), (columns, rows, screen))
            if columns >= 20 and rows >= 4:
                self.assertTrue(any("SPACE stop" in row for row in screen), (columns, rows, screen))
        self.assertEqual(0, top.end())

    def test_top_with_40_columns_shows_whole_lines(self):
        top = self.top(40, 24)
        rows = top.wait_for("LEDGER")
        for text in ("e-stop released (SIMULATED)", " LISTENING ", "SPACE stop  E e-stop  R reset  Q quit", "worst --"):
            self.assertTrue(any(text in row for row in rows), (text, rows))
        together = " ".join(" ".join(rows).split())
        whole = (
            "ready: iwheelctl drive LEFT RIGHT (mm/s) arms and MOVES the wheels",
            "no stop since the gateway started",
            "STOP at most",
            "no button of this machine stops the wheels",
        )
        for text in whole:
            self.assertIn(text, together)
        for row in rows:  # Up to the margin only where a sentence goes on, or happens to end.
            cut = len(row.rstrip()) == 40 and not row.startswith((" iWheel", " LEFT", " RIGHT"))
            self.assertFalse(cut and not any(text.endswith(row.strip()) for text in whole), row)
        self.rig.sim.ask("estop press")
        top.wait_for("LATCHED")
        self.assertIn("release the e-stop button (or fix its wire), then: iwheelctl reset", " ".join(" ".join(top.screen_after(0.5)).split()))
        self.assertEqual(0, top.end())

    @staticmethod
    def dots(top, rows, columns):
        """How many cells of a part of the screen have dots of a plot."""
        lines = top.screen_after()[rows[0] : rows[1]]
        return sum(0x2800 < ord(c) < 0x2900 or c == "*" for line in lines for c in line[columns[0] : columns[1]])

    def test_large_terminals_show_speed_and_force_of_the_last_minute(self):
        for size, more in (((200, 60), {}), ((80, 60), {}), ((80, 60), {"LANG": "C", "TERM": "vt220"})):  # pyte knows no REP, xterm has it.
            top = self.top(*size, **more)
            rows = top.wait_for("LEFT speed, mm/s")
            for text in ("RIGHT speed, mm/s", "LEFT force, N", "RIGHT force, N", "60 s ago", "now", "SPACE stop"):
                self.assertTrue(any(text in row for row in rows), (text, rows))
            self.rig.sim.ask("load both 60")
            self.see_driving(top) if not more else top.screen_after(1)
            top.screen_after(1.5)
            begin = next(i for i, row in enumerate(rows) if "LEFT speed" in row)
            wide = (8, 98) if size[0] == 200 else (8, 80)
            self.assertGreater(self.dots(top, (begin, begin + 7), wide), 2, "\n".join(top.screen_after()))
            if more:
                self.assertTrue(all(ord(c) < 128 for row in top.screen_after() for c in row))
            elif size[0] == 200:
                self.assertTrue(any("-500" in row[100:] or "-200" in row[100:] for row in top.screen_after()), "right: backwards too")
                force = next(i for i, row in enumerate(rows) if "LEFT force" in row)
                self.assertTrue(any("+50 " in row or "+100 " in row for row in top.screen_after()[force:]), top.screen_after())
            self.assertEqual(0, top.end())
            self.rig.sim.ask("load both 0")
            for process in self.drives:
                process.terminate()
                process.wait()

    def test_small_terminal_has_no_plot(self):
        top = self.top(80, 24)
        self.assertFalse(any("last minute" in row or "60 s ago" in row for row in top.wait_for("LEDGER")))
        top.resize(80, 36)
        rows = top.wait_for("LEFT speed")
        self.assertFalse(any("force, N" in row for row in rows), "speed before force")
        self.assertEqual(0, top.end())

    def test_time_without_a_gateway_is_a_gap_not_a_line(self):
        top = self.top(200, 60)
        rows = top.wait_for("LEFT speed")
        begin = next(i for i, row in enumerate(rows) if "LEFT speed" in row)
        top.screen_after(2.0)
        before = self.dots(top, (begin, begin + 17), (8, 98))
        self.rig.kill_gateway(signal.SIGKILL)
        top.wait_for("waiting for a gateway")
        top.screen_after(3.0)
        self.rig.start_gateway()
        top.wait_for("LEFT speed")
        line = next(row for row in top.screen_after(1.0)[begin:] if row[8:98].strip("\u00b7 ") and "speed" not in row)[8:98]
        self.assertGreater(before, 0)
        self.assertRegex(line, "[\u2801-\u28ff]\u00b7+[\u2801-\u28ff]", line)
        self.assertEqual(0, top.end())

    def test_it_waits_for_a_gateway_that_went_and_comes(self):
        top = self.full_top()
        self.rig.kill_gateway(signal.SIGKILL)
        top.wait_for("waiting for a gateway")
        rows = top.screen_after(0.3)
        self.assertFalse(any("mm/s" in row for row in rows), "no old speeds")
        self.assertEqual(" #   #  ###", top.blocks(1)[:11])  # N O
        self.rig.start_gateway()
        top.wait_for("LEDGER")
        self.assertEqual(0, top.end())

    def test_gateway_that_hangs_is_reported(self):
        top = self.top(40, 12)  # Small, so that the word is written in plain letters.
        top.wait_for("LISTENING")
        self.rig.gateway.signal(signal.SIGSTOP)
        top.wait_for("NO ANSWER")
        self.rig.gateway.signal(signal.SIGCONT)
        top.wait_for("LISTENING")
        self.assertEqual(0, top.end())

    def test_lost_wheel_is_marked_and_unknown_values_are_dashes(self):
        top = self.full_top()
        self.rig.sim.ask("mute right")
        top.wait_for("LOST")
        rows = top.screen_after(0.5)
        does = next(row for row in rows if "LOST" in row)
        self.assertTrue(does.rstrip().endswith("--"), does)
        self.assertEqual(0, top.end())

    def test_without_colours_there_are_none_but_emphasis(self):
        for more in ({"NO_COLOR": "1"}, {"TERM": "vt100"}):
            top = self.full_top(**more)
            raw = top.operator.raw
            self.assertNotRegex(raw, rb"\x1b\[[0-9;]*3[0-7]m", more)
            self.assertIn("#", top.blocks(1))
            self.assertEqual(0, top.end())

    def test_without_utf8_bars_are_of_ascii(self):
        top = self.top(LANG="C")
        rows = top.wait_for("LEDGER")
        self.assertTrue(all(ord(c) < 128 for row in rows for c in row), rows)
        self.assertEqual(0, top.end())

    def test_signal_leaves_the_terminal_in_order(self):
        top = self.full_top()
        top.operator.process.send_signal(signal.SIGTERM)
        self.assertEqual(0, top.operator.wait())
        self.assertIn(b"\x1b[?1049l", top.operator.raw)


class WithoutWheels(unittest.TestCase):
    def operator(self, words, columns=80, **more):
        operator = Operator([ctl.program(), *words], environment(**more), columns)
        self.addCleanup(operator.close)
        return operator

    def test_no_gateway_is_waited_for_with_the_reason(self):
        top = Top("/nonexistent/gateway.sock")
        self.addCleanup(top.operator.close)
        top.wait_for("no gateway answers; start it")
        self.assertEqual(0, top.end())

    def test_hostile_names_cannot_command_the_terminal(self):
        evil = "\x1b]0;owned\x07\x1b[2Jevil\u009b31m" + "x" * 200

        class Hostile(FakeGateway):
            def on_watch(self, connection, request):
                def stream():
                    try:
                        for _ in range(20):
                            self.say(
                                connection,
                                {
                                    "event": "state",
                                    **snapshot(
                                        "armed",
                                        lease={"holder": 7, "name": evil, "pid": 1, "remaining_ms": 5, "lease_ms": 200},
                                        warnings=[evil],
                                        ledger={evil: {"state": "contradicted"}},
                                    ),
                                },
                            )
                            time.sleep(0.1)
                    except OSError:
                        pass

                threading.Timer(0.2, stream).start()
                return super().on_watch(connection, request)

        gateway = Hostile()
        self.addCleanup(gateway.close)
        top = Top(gateway.path)
        self.addCleanup(top.operator.close)
        top.wait_for("evil")
        self.assertNotIn(b"\x1b]0;owned", top.operator.raw)
        self.assertNotIn("\u009b".encode(), top.operator.raw)
        self.assertEqual("", top.screen.title)
        self.assertEqual(0, top.end())

    def test_not_a_terminal_and_an_unknown_one_are_usage(self):
        code, _, err = ctl.run("top", env=environment())
        self.assertEqual(64, code)
        self.assertIn("iwheelctl status", err)
        operator = self.operator(["top"], TERM="no-such-thing")
        operator.expect("this terminal cannot draw")
        self.assertEqual(64, operator.wait())

    def test_top_on_dumb_terminal_names_another_verb_and_ends(self):
        operator = self.operator(["--socket", "/nonexistent", "top"], TERM="dumb")
        operator.expect("(TERM=dumb); without drawing: iwheelctl status, or iwheelctl watch")
        self.assertEqual(64, operator.wait())
        self.assertNotIn(b"\x1b", operator.raw)

    def test_drive_on_dumb_or_narrow_terminal_stays_on_its_line(self):
        for more, columns in (({"TERM": "dumb"}, 80), ({}, 40)):
            gateway = FakeGateway()
            self.addCleanup(gateway.close)
            operator = self.operator(["--socket", gateway.path, "drive", "200", "200", "--for", "300ms"], columns, **more)
            self.assertEqual(0, operator.wait(), operator.text)
            if more:
                self.assertNotIn(b"\x1b", operator.raw)
            for line in operator.text.split("\x1b[K")[1:]:
                self.assertLess(len(line.split("\r")[0].split("\n")[0]), max(columns, 80) if "drove" in line else columns)
