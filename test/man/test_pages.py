#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The manual pages of a build contain the text that its programs print. The build does not run the programs; this test does.

Usage: test_pages.py BUILD [unittest's arguments]
"""

import os
import socket
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = ""
FOLDERS = {
    "iwheel-gateway": "gateway",
    "iwheelctl": "ctl",
    "iwheel-sim": "sim",
    "iwheel-ros2": "bridge/ros2",
    "iwheel-serial": "bridge/serial",
    "iwheel-web": "bridge/web",
    "iwheel-mqtt": "bridge/mqtt",
    "iwheel-fleet": "bridge/mqtt",
}


def program(name):
    return os.path.join(BUILD, "app", FOLDERS[name], name)


def built(names):
    return [name for name in names if os.path.exists(program(name))]


def output(name, *arguments):
    return subprocess.run([program(name), *arguments], check=True, capture_output=True, text=True).stdout


def literal(text):
    return "\n```\n" + text.rstrip("\n").replace("\\", "\\\\") + "\n```\n"


class Pages(unittest.TestCase):
    def page(self, name):
        """Returns the input of scdoc."""
        with open(os.path.join(BUILD, "man", name + ".scd"), encoding="utf-8") as file:
            return file.read()

    def expect_printed(self, name, text):
        self.assertTrue(text.strip())
        self.expect_block(name, literal(text))

    def expect_block(self, name, block):
        page = self.page(name)
        if block not in page:
            missing = [line for line in block.splitlines() if line not in page.splitlines()]
            self.fail(f"man/{name}.scd of the build lacks what the program prints: " + "\n".join(missing or ["each line of it, but not in this order"]))

    def test_each_page_has_the_help_of_its_program(self):
        for name in built(FOLDERS):
            with self.subTest(name):
                self.expect_printed(f"{name}.1", output(name, "--help"))

    def test_each_verb_that_completes_has_its_help_in_the_page(self):
        verbs = [line.split("\t")[0] for line in output("iwheelctl", "help", "--list").splitlines()]
        self.assertGreater(len(verbs), 20)
        for verb in verbs:
            with self.subTest(verb):
                self.expect_block("iwheelctl.1", f"## {verb}\n" + literal(output("iwheelctl", verb, "--help")))

    def test_simulator_commands_are_those_that_a_running_one_lists(self):
        with tempfile.TemporaryDirectory() as folder:
            control = os.path.join(folder, "control")
            command = [program("iwheel-sim"), "--quiet", "--can", f"unix:{folder}/bus", "--estop", f"{folder}/button", "--control", control]
            with subprocess.Popen(command, stdout=subprocess.DEVNULL) as simulator, socket.socket(socket.AF_UNIX) as client:
                try:
                    while client.connect_ex(control) != 0 and simulator.poll() is None:  # The file exists before the simulator accepts connections.
                        time.sleep(0.01)
                    self.expect_printed("iwheel-sim.1", output("iwheel-sim", "--control", control, "help"))
                finally:
                    simulator.terminate()

    def test_keys_of_the_gateway_are_those_that_it_prints(self):
        self.expect_printed("iwheel-gateway.conf.5", output("iwheel-gateway", "--print-config", "-c", os.path.join(ROOT, "share", "gateway.conf")))

    def test_every_page_is_made_without_a_warning_and_installed(self):
        expected = {name[: -len(".scd")] for name in os.listdir(os.path.join(ROOT, "man"))}
        expected -= {f"{name}.1" for name in set(FOLDERS) - set(built(FOLDERS))}
        with tempfile.TemporaryDirectory() as prefix:
            for component in ("gateway", "tools", "ros2", "serial", "web", "mqtt", "client-dev"):
                subprocess.run(["cmake", "--install", BUILD, "--prefix", prefix, "--component", component], check=True, capture_output=True)
            pages = {name: os.path.join(at, name) for at, _, names in os.walk(os.path.join(prefix, "share", "man")) for name in names}
            self.assertEqual(set(pages), expected)
            for name, path in pages.items():
                with self.subTest(name), open(path, "rb") as file:
                    made = subprocess.run(["scdoc"], input=self.page(name).encode(), capture_output=True, check=True)
                    self.assertEqual(made.stderr, b"")
                    # The first lines contain the day of the build.
                    self.assertEqual(file.read().split(b"\n.SH", 1)[1], made.stdout.split(b"\n.SH", 1)[1])


class Missing(unittest.TestCase):
    def renew(self, line):
        with tempfile.NamedTemporaryFile("w", suffix=".scd") as page:
            page.write(f"x(1)\n\n# NAME\n\n{line}\n")
            page.flush()
            return subprocess.run([sys.executable, os.path.join(ROOT, "scripts", "man_pages.py"), page.name], capture_output=True, check=False).returncode

    def test_page_without_its_program_is_an_error(self):
        self.assertEqual(self.renew("; file share/gateway.conf"), 0)
        self.assertNotEqual(self.renew("; file share/gone.conf"), 0)
        self.assertNotEqual(self.renew("; help iwheelctl"), 0)


if __name__ == "__main__":
    BUILD = os.path.abspath(sys.argv.pop(1))
    for absent in sorted(set(FOLDERS) - set(built(FOLDERS))):
        print(f"note: the page of {absent} is not checked: the program was not built")
    unittest.main()
