# SPDX-License-Identifier: MIT
"""The fixes that the programs print: every command in them exists, and those that can be executed here clear the trouble."""

import glob
import json
import os
import re
import shutil
import signal
import subprocess
import time
import unittest
from pathlib import Path

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
import pytest
from ctl import BUILD, program, run, run_as_stranger, start
from harness import Rig, read_only

# Programs of others that fixes name: the Debian package, and the words that may follow. None: anything.
PROGRAMS = {
    "apt-get": ("apt", {"install"}),
    "candump": ("can-utils", None),
    "chmod": ("coreutils", {"go-w"}),
    "chown": ("coreutils", None),
    "chrt": ("util-linux", {"-f"}),
    "gpiodetect": ("gpiod", None),
    "gpioinfo": ("gpiod", None),
    "groupadd": ("passwd", {"--system"}),
    "ip": ("iproute2", None),
    "journalctl": ("systemd", {"-u"}),
    "mkdir": ("coreutils", {"-p"}),
    "modprobe": ("kmod", {"can_raw"}),
    "systemctl": ("systemd", {"start", "stop", "restart", "enable"}),
    "sysctl": ("procps", None),
    "timedatectl": ("systemd", {"set-ntp"}),
    "usermod": ("passwd", {"-aG"}),
}
OURS = {"iwheelctl", "iwheel-sim", "iwheel-gateway"}


def output(*command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False, stdin=subprocess.DEVNULL)
    return done.stdout + done.stderr


def sentences():
    """(file, text) of every string in the sources of the programs, its pieces put together."""
    text_of = r'"(?:[^"\\\n]|\\.)*"'
    parts = (
        "lib/begin",
        "lib/config",
        "lib/inspect",
        "lib/northbound",
        "lib/recording",
        "lib/sockets",
        "app/ctl",
        "app/gateway",
        "app/sim",
        "app/bridge/serial",
    )
    for path in sorted(path for part in parts for path in glob.glob(os.path.join(ROOT, part, "**", "*.c"), recursive=True)):
        source = re.sub(r"//[^\n]*|^#include.*$", "", Path(path).read_text(encoding="utf-8"), flags=re.MULTILINE)
        for match in re.finditer(rf"{text_of}(?:\s*(?:[A-Z][A-Za-z0-9_]+\s*)?{text_of})*", source):
            pieces = re.findall(r'"((?:[^"\\\n]|\\.)*)"', match.group())
            yield os.path.relpath(path, ROOT), "".join(pieces).replace('\\"', '"').replace("\\n", "\n")


@pytest.mark.exact
class EveryCommandExists(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.texts = list(sentences())
        cls.verbs = {line.split("\t")[0] for line in output(program("iwheelctl"), "help", "--list").splitlines()}
        cls.words = {verb: output(program("iwheelctl"), "help", verb, "--list").split() for verb in cls.verbs}
        cls.words["doctor"].append("IFACE")

    def find(self, pattern, least=1):
        """(place, match) of each match in the texts; no match is a mistake of this test."""
        found = [(f"{path}: {text[:160]}", match) for path, text in self.texts for match in re.finditer(pattern, text)]
        self.assertGreaterEqual(len(found), least, pattern)
        return found

    def test_fixes_name_known_verbs_and_options_of_iwheelctl(self):
        for place, match in self.find(r"(?<![/\w])iwheelctl ([a-z]+)((?: [^\s;,)|]+)*)", 60):
            verb, rest = match.groups()
            if match.group().startswith("iwheelctl of its version"):
                continue
            self.assertIn(verb, self.verbs, place)
            for option in re.findall(r" (--[a-z-]+)", rest):
                self.assertIn(option, [*self.words[verb], "--for"], place)
                self.assertIn(option, self.words[verb], place)
            item = rest.split()[0] if rest.split() else ""
            if verb == "confirm" and re.search(r": iwheelctl confirm$|: iwheelctl confirm \w", match.string[: match.end()]):
                self.assertIn(item.rstrip("."), self.words["confirm"], place)

    def test_options_and_commands_of_the_simulator_and_the_gateway(self):
        commands = {line.split()[0] for line in self.simulator_commands()}
        for name in ("iwheel-sim", "iwheel-gateway"):
            options = set(re.findall(r"--[a-z-]+", output(program(name), "--help"))) | {"-c"}
            for place, match in self.find(rf"(?<![/@\w]){name} ((?:--?[a-z]|[a-z])\S*)((?: [^\s;,)]+)*)", 3):
                first, rest = match.groups()
                for option in re.findall(r"(?:^| )(--[a-z-]+)", f"{first}{rest}"):
                    self.assertIn(option, options, place)
                if name == "iwheel-sim" and not first.startswith("-"):
                    self.assertIn(first.rstrip("`"), commands | {"or"}, place)  # "the other iwheel-sim or choose another path"

    def simulator_commands(self):
        rig = Rig(BUILD)
        self.addCleanup(rig.close)
        return output(program("iwheel-sim"), "--control", rig.path("control"), "help").splitlines()

    def test_programs_of_others_are_known_with_the_words_that_follow(self):
        names = "|".join(PROGRAMS)
        for place, match in self.find(rf"(?:^|(?<=[:;(] )|(?<=sudo )|(?<=\()|(?<=; ))({names}) (\S+)", 20):
            wanted = PROGRAMS[match.group(1)][1]
            if wanted is not None:
                self.assertIn(match.group(2).strip("),;"), wanted, place)
        for place, match in self.find(r"sudo (\S+)"):
            self.assertIn(match.group(1), OURS | set(PROGRAMS), place)

    def test_text_behind_a_colon_is_a_known_command(self):
        prose = {"the"}
        for place, match in self.find(r"(?:then|with|do|see|how): ([a-z][\w-]+)", 30):
            self.assertIn(match.group(1), OURS | set(PROGRAMS) | {"sudo"} | prose, place)

    def test_units_exist(self):
        for place, match in self.find(r"(?:systemctl \w+(?: --now)?|journalctl -u) ([\w-]+)(?:(@)[\w%]*)?(\.path)?", 5):
            unit = f"{match[1]}{match[2] or ''}{match[3] or '.service'}"
            self.assertTrue(os.path.exists(os.path.join(ROOT, "share", "systemd", unit)), place)

    def test_files_of_ours_exist(self):
        for place, match in self.find(r"(?<![/\w])((?:share|docs|scripts)/[\w./-]+\w)"):
            self.assertTrue(os.path.exists(os.path.join(ROOT, match.group(1))), place)

    def test_packages_are_those_that_the_checks_install(self):
        installed = Path(ROOT, "scripts", "install_tools").read_text(encoding="utf-8")
        for place, match in self.find(r"apt-get install ([a-z][\w.-]+)"):
            self.assertIn(match.group(1).rstrip("."), installed, place)
        for place, match in self.find(r"^(lib\w+-dev)$"):  # Put in for %s.
            self.assertIn(match.group(1), installed, place)

    def test_keys_of_the_configuration_exist(self):
        keys, section = set(), ""
        for line in output(program("iwheel-gateway"), "--print-config", "-c", os.path.join(ROOT, "share", "gateway.conf")).splitlines():
            section = line[1:-1] if line.startswith("[") else section
            if match := re.match(r";? ?(\w+) *=", line):
                keys.add((section, match.group(1)))
        sections = {section for section, _ in keys}
        for place, match in self.find(r"(?<!under )\[(\w+)\] (\w+)", 10):
            if match.group(1) in sections:
                self.assertIn(match.groups(), keys, place)
        for place, match in self.find(r"(\w+)(?: \([^)]*\))?(?: or (\w+))? under \[(\w+)\]", 10):
            one, other, section = match.groups()
            for key in filter(None, (one, other)):
                if key not in ("it", "them", "both", "and", "s"):
                    self.assertIn((section, key), keys, place)

    @unittest.skipUnless(shutil.which("ip"), "ip is missing (apt-get install iproute2)")
    def test_ip_knows_every_word_of_its_commands(self):
        known = set(re.findall(r"[a-z][a-z-]+", output("ip", "link", "help", "can") + output("ip", "link", "help") + output("ip", "help")))
        for place, match in self.find(r"(?:^|[^\w-])ip ((?:-\w+ )?link (?:[^;,()\n|]+))", 8):
            words = [word for word in match.group(1).split() if re.fullmatch(r"-?[a-z][a-z-]+", word)]
            self.assertTrue(words, place)
            for word in words:
                self.assertIn(word.lstrip("-"), known | {"can", "off", "or", "brief", "details"}, (word, place))


class CarriedOut(unittest.TestCase):
    """Each test causes a trouble, executes the fix that a program prints, and checks that the trouble is gone."""

    # Fixes that need hands, by their words, and the command for the simulated wheels.
    HANDS = {
        "release the e-stop button": "estop release",
        "release the button": "estop release",
        "check that no person is in the way": None,
        "switch the wheels on": "normal",
        "find out why a wheel lost power": None,
        "check the wheels' power and the cable": "normal",
        "bring the bus up": "bus up",
        "switch off the other program or device": "foreign off",
        "check the wheel: it ran faster": "runaway both off",
        "free the wheel": "unblock both",
        "check `invert` and the wheels' wiring": "sign both normal",
        "see why the left wheel turned against its command": None,
        "unload both wheels": "load both 0",
        "check cable, termination and bit rate": "normal",
        "when it is gone": "padding off",
    }

    # Wheels and echoes may be late: this machine does other things too.
    PATIENT = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "decel_mm_s2": 3000}}

    def setUp(self):
        self.rig = None
        self.begin()

    def begin(self):
        """Other wheels, another bus."""
        if self.rig:
            self.rig.close()
        self.rig = Rig(BUILD, self.PATIENT)
        self.addCleanup(self.rig.close)

    def ctl(self, *words):
        return run("--socket", self.rig.path("gateway.sock"), *words)

    def status(self):
        return json.loads(self.ctl("--json", "status")[1])

    def wait_for(self, holds, what, seconds=8.0):
        end = time.monotonic() + seconds
        while not holds(status := self.status()):
            self.assertLess(time.monotonic(), end, f"{what}: {status['state']}, {status['cause']}, {status['present']}")
            time.sleep(0.02)
        return status

    def next_step(self):
        """The action that `status` prints."""
        out = self.ctl("status")[1]
        return " ".join(out[out.index("next") : out.index("last stop")].removeprefix("next").split())

    def use_hands(self, fix):
        known = [phrase for phrase in self.HANDS if phrase in fix]
        for phrase in known:
            if self.HANDS[phrase]:
                self.rig.sim.ask(self.HANDS[phrase])
        return known

    def run_commands(self, fix):
        """Executes every command of ours in the text, with the socket and the control socket added."""
        commands = re.findall(r"(?:iwheelctl|iwheel-sim) [^;,():]+?(?= \w+:|[;,()]|$)", fix)
        where = {
            "iwheelctl": f"{program('iwheelctl')} --socket {self.rig.path('gateway.sock')}",
            "iwheel-sim": f"{program('iwheel-sim')} --control {self.rig.path('control')}",
        }
        for command in commands:
            line = re.sub(r"\b(iwheelctl|iwheel-sim)(?= )", lambda match: where[match.group(1)], command)
            done = subprocess.run(line, shell=True, capture_output=True, text=True, timeout=30, check=False)
            self.assertEqual(0, done.returncode, (command, done.stdout, done.stderr))
        return commands

    def drives(self):
        """A short drive succeeds, at the latest the third time: a wheel sends again only a moment after the bus is up, and then counts as rebooted for a second."""
        for _ in range(3):
            code, out, err = self.ctl("drive", "150", "150", "--for", "300ms")
            if code == 0:
                return
            time.sleep(1.1)
        self.fail((code, out, err))

    def drive_into(self, fault):
        """Drives until the fault has stopped the wheels."""
        process = start("--socket", self.rig.path("gateway.sock"), "drive", "300", "300", "--for", "20s")
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)
        self.wait_for(lambda s: (s["left"]["speed_mm_s"] or 0) > 200 or s["state"] == "latched", "driving")
        self.rig.sim.ask(fault)

    LATCHES = {"wheel_lost": "mute left", "send_stalled": "ack off", "bus_down": "bus down", "second_master": "foreign on", "overspeed": "runaway both on 1000"}

    def test_what_status_says_next_leads_out_of_every_latch(self):
        for cause, fault in self.LATCHES.items():
            with self.subTest(cause):
                self.begin()
                self.rig.start_gateway()
                self.drive_into(fault)
                self.wait_for(lambda s: s["state"] == "latched", cause)
                self.assertEqual(cause, self.status()["cause"])
                self.leave_latch()

    def leave_latch(self):
        fix = self.next_step()
        self.assertTrue(self.use_hands(fix), fix)
        self.wait_for(lambda s: not s["present"] and s["left"]["at_rest"] and s["right"]["at_rest"], fix)
        time.sleep(0.6)  # The last command of the client is no longer stored.
        self.assertEqual(["iwheelctl reset"], self.run_commands(fix), fix)
        self.assertEqual("listening", self.status()["state"])
        self.drives()

    def test_what_status_says_next_leads_out_of_both_e_stops(self):
        self.rig.start_gateway()
        for press in (lambda: self.rig.sim.ask("estop press"), lambda: self.ctl("estop")):
            press()
            self.wait_for(lambda s: s["state"] == "latched", "e-stop")
            self.leave_latch()

    def test_refusal_fix_makes_the_same_request_succeed(self):
        self.rig.start_gateway()
        for fault in ("busoff on", "estop press"):
            self.rig.sim.ask(fault)
            time.sleep(0.2)
            code, _, err = self.ctl("drive", "100", "100", "--for", "200ms")
            self.assertEqual(1, code)
            self.assertTrue(self.use_hands(err) or "iwheel-sim" in err, err)
            time.sleep(1.2)
            self.run_commands(err)
            self.drives()

    def drives_after_block(self, which, cause, advice):
        self.rig.start_gateway()
        self.drive_into(f"block {which}")
        self.wait_for(lambda s: s["cause"] == cause, cause)
        fix = self.next_step()
        self.assertIn(advice, self.ctl("status")[1].replace("\n", " ") + fix)
        self.rig.sim.ask(f"unblock {which}")
        self.wait_for(lambda s: s["state"] == "listening", "rest")
        self.drives()

    def test_wheels_that_were_blocked_drive_when_they_are_free(self):
        self.drives_after_block("both", "wheel_blocked", "free the wheel, then arm again")

    def test_wheel_that_was_blocked_alone_drives_when_it_is_free(self):
        self.drives_after_block("left", "pair_diverges", "check that the wheel turns freely and drives, then arm again")

    def doctor(self, *words):
        out = self.ctl("--json", "doctor", f"unix:{self.rig.path('bus')}", "--listen", "0.4s", *words)[1]
        return {finding["check"]: finding for finding in json.loads(out)["findings"] if finding["verdict"] != "ok"}

    def test_doctors_cures_of_the_bus(self):
        button = ("--estop", f"unix:{self.rig.path('button')}")
        self.rig.sim.ask("busoff on")
        self.assertTrue(self.run_commands(self.doctor(*button)["bus_state"]["cure"]))
        self.assertNotIn("bus_state", self.doctor(*button))
        self.rig.sim.ask("babble 333 20000 on")
        time.sleep(0.1)
        for next_to_gateway in (False, True):
            if next_to_gateway:
                self.rig.start_gateway()
            fix = self.doctor(*(() if next_to_gateway else button))["unknown_ids"]["cure"]
            where = f"{program('iwheelctl')} --socket {self.rig.path('gateway.sock')}"
            line = re.sub(r"\biwheelctl\b", where, fix.split(": ", 1)[1])
            self.assertIn("333", output("sh", "-c", line), line)
        self.rig.sim.ask("normal")
        self.rig.kill_gateway(signal.SIGTERM)
        self.rig.sim.end()
        fix = self.doctor(*button)["interface"]["cure"]
        self.assertRegex(fix, r"^start the simulator: iwheel-sim --can unix:\S+$")
        command = fix.split(": ", 1)[1].split()
        with subprocess.Popen(
            [program(command[0]), *command[1:], "--estop", self.rig.path("button"), "--control", self.rig.path("control"), "--quiet"]
        ) as simulator:
            time.sleep(0.8)
            self.assertNotIn("interface", self.doctor(*button))
            simulator.terminate()

    def settle(self, item, make):
        """Makes the contradiction and runs doctor's fix; then doctor does not report it any more."""
        make()
        self.wait_for(lambda s: s["ledger"][item]["state"] == "contradicted", item)
        fix = self.doctor()["ledger"]["cure"]
        self.use_hands(fix)
        time.sleep(0.3)
        if match := re.match(r"correct (\w+)(?: or \w+)? under \[(\w+)\].*then: systemctl restart iwheel-gateway", fix):
            key, section = match.groups()
            right = {
                "setpoint_type": 2,
                "current_role": "setpoint",
                "force_unit": "dN" if section == "left" else "cN",
                "invert": "yes",
                "radius_mm": 181,
                "track_mm": 600,
                "gear_ratio": "3/2",
            }[key]
            self.rig.settings.setdefault(section, {})[key] = right
            self.rig.write_config()
            self.rig.kill_gateway(signal.SIGTERM)
            self.rig.start_gateway()
        elif "iwheelctl tare" in fix:
            time.sleep(2.2)
            self.run_commands(fix)
        else:
            self.run_commands(re.search(r"iwheelctl confirm \S+", fix).group())
        time.sleep(0.3)
        self.assertNotIn("ledger", self.doctor(), (item, fix))

    def test_doctor_fix_of_each_contradiction_clears_it(self):
        wrong = {
            "setpoint_type": "2",
            "current_role": "setpoint",
            "mount_sign_left": "yes",
            "mount_sign_right": "yes",
            "wheel_radius": "181",
            "track": "600",
            "gear_ratio": "3/2",
            "feedback_sign_left": "no",
            "feedback_sign_right": "no",
            "pose_byte_order": "no",
        }
        for item, value in wrong.items():
            with self.subTest(item):
                self.begin()
                self.rig.start_gateway()
                self.settle(item, lambda: self.ctl("confirm", item, value))
        with self.subTest("dlc"):
            self.begin()
            self.rig.start_gateway()
            self.settle("dlc", lambda: self.rig.sim.ask("padding on"))

    def test_item_nearly_right_is_asked_after(self):
        self.rig.start_gateway()
        for typed, meant in (("whel_radius", "did you mean wheel_radius?"), ("setpoint", "did you mean setpoint_type?"), ("xyzzy", "iwheelctl ledger")):
            code, _, err = self.ctl("confirm", typed)
            self.assertEqual(1, code)
            self.assertIn(meant, err)
        self.assertNotIn("did you mean", err)
        self.assertNotIn("did you mean", self.ctl("confirm", "wheel_radius", "x")[2])

    def test_tare_settles_a_raw_force_without_its_zero(self):
        self.rig.sim.ask("removed both on")
        self.rig.start_gateway()
        self.settle("offset_included", lambda: None)


class Check(unittest.TestCase):
    """Findings of `iwheel-gateway --check` before and after the fix."""

    def setUp(self):
        self.rig = Rig(BUILD)
        self.addCleanup(self.rig.close)

    def read_only_disk(self):
        """The setup of a process for which the folder is one."""
        if os.geteuid() != 0:
            self.skipTest("needs root to mount")
        os.mkdir(self.rig.path("disk"))
        return read_only(self.rig.path("disk"))

    def check(self, *words, setup=None):
        done = subprocess.run([*self.rig.gateway_command("--check"), *words], capture_output=True, text=True, timeout=30, preexec_fn=setup, check=False)
        lines = [line.split(" ", 1) for line in done.stdout.splitlines()]
        return done.returncode, {verdict: [text for other, text in lines if other == verdict] for verdict, _ in lines}, done

    def set(self, section, **keys):
        self.rig.settings.setdefault(section, {}).update(keys)
        self.rig.write_config()

    def start_refused(self, about, setup=None):
        """The start fails for the same reason."""
        done = subprocess.run(self.rig.gateway_command(), capture_output=True, text=True, timeout=30, preexec_fn=setup, check=False)
        self.assertEqual(69, done.returncode, done.stderr)
        self.assertIn(about, done.stderr)

    def only(self, verdict, about, setup=None):
        """The one finding of that verdict about this; the exit code fits it."""
        code, found, done = self.check(setup=setup)
        texts = [text for text in found.get(verdict, []) if about in text]
        self.assertEqual(({"warn": 0, "fail": 1}[verdict], 1), (code, len(texts)), done.stdout + done.stderr)
        return texts[0]

    def gone(self, verdict, about):
        code, found, done = self.check()
        self.assertEqual((0, []), (code, [text for text in found.get(verdict, []) if about in text]), done.stdout)

    def test_group_that_does_not_exist(self):
        self.set("northbound", group="no-such-group")
        text = self.only("warn", "group no-such-group does not exist")
        self.assertIn("or to none", text)
        self.set("northbound", group="none")
        self.gone("warn", "group")

    def test_mode_that_lets_everybody_drive(self):
        for mode in ("0777", "0666", "0662"):
            self.set("northbound", mode=mode)
            text = self.only("warn", f"socket mode {mode}: every user of this machine")
        key, value = re.search(r"\[northbound\] (\w+) = (\w+)", text).groups()
        self.set("northbound", **{key: value})
        self.gone("warn", "mode")

    def test_record_directory_that_cannot_be_is_a_warning(self):
        Path(self.rig.path("file")).touch()
        self.set("record", directory=self.rig.path("file"))
        self.only("warn", "Not a directory")
        self.set("record", directory=self.rig.path("a/b"))
        text = self.only("warn", "record: directory")
        self.assertIn("No such file or directory", text)
        self.assertIn("the gateway starts, but records no stop", text)
        self.assertFalse(os.path.exists(self.rig.path("a")), "--check makes nothing")
        self.rig.start_gateway()
        self.rig.kill_gateway(signal.SIGTERM)
        command = re.search(r"create it: (.*)$", text).group(1).replace("sudo ", "")
        subprocess.run(command, shell=True, check=True)
        self.gone("warn", "record")
        for new in ("a/new", "a/new/"):
            self.set("record", directory=self.rig.path(new))
            self.gone("warn", "record")
        self.assertFalse(os.path.exists(self.rig.path("a/new")))

    def test_record_directory_of_another_user(self):
        if os.geteuid() != 0:
            self.skipTest("needs root to become another user")
        os.chmod(self.rig.folder, 0o755)
        os.mkdir(self.rig.path("theirs"), 0o755)
        self.set("record", directory=self.rig.path("theirs"))
        command = self.rig.gateway_command("--check")
        text = next(line for line in run_as_stranger(*command)[1].splitlines() if "record" in line)
        self.assertIn("Permission denied", text)
        subprocess.run(re.search(r"sudo (chown \d+ \S+)", text).group(1), shell=True, check=True)
        self.assertIn("ok   record", run_as_stranger(*command)[1])

    def test_record_directory_on_a_read_only_disk_is_a_warning(self):
        mount = self.read_only_disk()
        for directory in ("disk", "disk/new"):
            self.set("record", directory=self.rig.path(directory))
            text = self.only("warn", "Read-only file system", setup=mount)
            self.assertIn("record: directory", text)
            self.assertIn("mount it for writing", text)
            self.assertNotIn("chown", text)
            self.rig.start_gateway(setup=mount)
            self.rig.kill_gateway(signal.SIGTERM)

    def test_socket_on_a_read_only_disk_fails_as_the_start_does(self):
        mount = self.read_only_disk()
        for directory in ("disk", "disk/new"):
            self.rig.socket_name = f"{directory}/gateway.sock"
            text = self.only("fail", "Read-only file system", setup=mount)
            self.assertIn("mount it for writing", text)
            self.start_refused("Read-only file system", mount)

    def test_socket_name_in_use_fails_as_the_start_does(self):
        os.symlink("nowhere", self.rig.path("link"))
        Path(self.rig.path("file")).touch()
        for name, about in (("link", "is a symbolic link"), ("file", "exists and is not a socket")):
            self.rig.socket_name = name
            self.only("fail", about)
            self.start_refused(about)
            self.assertTrue(os.path.lexists(self.rig.path(name)))

    def test_watch_socket_that_cannot_be_is_a_warning(self):
        self.set("northbound", watch_socket=self.rig.path("a/b/watch.sock"))
        text = self.only("warn", "No such file or directory")
        self.assertIn(self.rig.path("a/b/watch.sock"), text)
        self.set("northbound", watch_socket="none")
        self.gone("warn", "watch")
        self.set("northbound", watch_socket=self.rig.path("a/b/watch.sock"))
        self.rig.start_gateway()

    def test_socket_in_shared_directory_warns_as_at_the_start(self):
        os.mkdir(self.rig.path("shared"))
        os.chmod(self.rig.path("shared"), 0o1777)
        self.rig.socket_name = "shared/gateway.sock"
        self.only("warn", "any user can create another socket there")
        os.symlink("nowhere", self.rig.path("shared/gateway.sock"))
        self.only("fail", "is a symbolic link")

    def test_socket_directory_that_anybody_may_write(self):
        os.mkdir(self.rig.path("open"))
        os.chmod(self.rig.path("open"), 0o777)
        self.rig.socket_name = "open/gateway.sock"
        text = self.only("fail", "other users than the directory's owner may write")
        subprocess.run([*re.search(r"\((chmod go-w)\)", text).group(1).split(), self.rig.path("open")], check=True)
        self.gone("fail", "socket")

    def test_machine_without_can_or_gpio_is_judged_as_far_as_it_goes(self):
        if glob.glob("/dev/gpiochip*"):
            self.skipTest("this machine has GPIO")
        code, found, done = self.check("--estop", "ESTOP")
        self.assertEqual((69, 1), (code, len(found.get("skip", []))), done.stdout)
        self.assertIn("e-stop ESTOP", found["skip"][0])
        self.assertTrue(any("left wheel" in text for text in found["ok"]), "the bus is checked anyway")
        # A key that depends on the wheels does not change the exit code; a mistake does.
        del self.rig.settings["wheels"]["setpoint_type"]
        self.rig.write_config()
        self.assertEqual(69, self.check("--estop", "ESTOP")[0])
        self.set("wheels", setpoint_type="300")
        self.assertEqual(78, self.check("--estop", "ESTOP")[0])

    def test_config_before_commissioning_listens_and_refuses_arm(self):
        right = dict(self.rig.settings["wheels"])
        for missing, error in (("setpoint_type", "type_not_set"), ("current_role", "type_not_set"), ("track_mm", "track_not_set")):
            del self.rig.settings["wheels"][missing]
            self.rig.write_config()
            text = self.only("warn", f"{missing} not configured: the gateway starts and listens, arm will be refused")
            self.assertIn("set it under [wheels]", text)
            code, found, done = self.check("--listen-only")
            self.assertEqual((0, []), (code, [text for text in found.get("warn", []) if "configured" in text]), done.stdout)
            self.rig.start_gateway()
            refused = self.rig.client().request("arm")
            self.assertEqual((False, error), (refused["ok"], refused.get("error")))
            self.rig.kill_gateway(signal.SIGTERM)
            self.set("wheels", **{missing: right[missing]})
        self.gone("warn", "not configured")

    def test_bus_that_cannot_be_opened_hides_no_other_finding(self):
        code, found, done = self.check("--can", "nocan0")
        texts = [text for verdict in ("skip", "fail") for text in found.get(verdict, []) if "bus nocan0" in text]
        self.assertEqual(1, len(texts), done.stdout)
        self.assertIn(code, (69, 1))
        self.assertTrue(any("e-stop unix:" in text and "released" in text for text in found["warn"]), done.stdout)
        self.assertTrue(any("record" in text for text in found["ok"]))
