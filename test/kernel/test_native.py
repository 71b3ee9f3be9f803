#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""--native: its requirements, its messages about missing parts, and how it starts the tests. Needs no kernel modules.

Usage: test/kernel/test_native.py
"""

import contextlib
import io
import os
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]
import campaign
import native


def answers(code, text=""):
    return mock.patch.object(native.subprocess, "run", return_value=subprocess.CompletedProcess([], code, text))


class Native(unittest.TestCase):
    def setUp(self):
        self.folder = self.enterContext(tempfile.TemporaryDirectory())
        self.enterContext(mock.patch.object(native.os, "geteuid", return_value=0))
        self.enterContext(mock.patch.object(native.shutil, "which", side_effect=lambda name: f"/bin/{name}"))
        self.enterContext(mock.patch.object(native, "GPIO_SIM", self.folder))

    def test_all_there_nothing_is_missing(self):
        with answers(0):
            self.assertIsNone(native.why_not_native())

    def test_not_root_names_the_fix(self):
        with mock.patch.object(native.os, "geteuid", return_value=1000), answers(0):
            self.assertIn("sudo", native.why_not_native())

    def test_program_missing_names_its_package(self):
        with mock.patch.object(native.shutil, "which", side_effect=lambda name: None if name == "tc" else name), answers(0):
            self.assertIn("apt-get install iproute2", native.why_not_native())

    def test_no_gpio_sim_names_the_module(self):
        with mock.patch.object(native, "GPIO_SIM", self.folder + "/none"), answers(0):
            self.assertIn("modprobe gpio-sim", native.why_not_native())

    def test_no_vcan_reports_the_output_of_ip(self):
        with answers(2, "Error: Unknown device type.\n"), mock.patch.object(native, "why_not_alone", return_value=None):
            self.assertRegex(native.why_not_native(), "modprobe vcan.*Unknown device type")

    def test_chroot_of_a_plain_folder_names_the_fix(self):
        with answers(1, "unshare: cannot change root filesystem propagation: Invalid argument\n"):
            self.assertRegex(native.why_not_native(), "propagation.*mount --bind")

    def test_modules_are_asked_for_first(self):
        with answers(0) as run:
            native.why_not_native()
        asked = [" ".join(call.args[0]) for call in run.call_args_list]
        self.assertEqual([f"modprobe -q {name}" for name in ("vcan", "slcan", "gpio-sim")], asked[:3])

    def test_refusal_is_a_skip_and_nothing_runs(self):
        out = io.StringIO()
        programs = mock.patch.object(campaign, "find_program")
        with programs, mock.patch.object(campaign, "why_not_native", return_value="REASON"), contextlib.redirect_stdout(out):
            self.assertEqual(0, campaign.main(["--native"]))
        self.assertEqual(["SKIPPED: REASON", "0 passed, 0 failed, 1 skipped"], out.getvalue().splitlines())

    def test_arguments_that_make_no_sense_are_refused(self):
        for words in (["--native", "--report"], ["--repeat", "0"], ["--jobs", "0"], ["--hours", "-1"]):
            with self.subTest(words), contextlib.redirect_stderr(io.StringIO()), self.assertRaises(SystemExit) as refused:
                campaign.parse(words)
            self.assertEqual(2, refused.exception.code)


class NativeBoot(unittest.TestCase):
    """A real start without a test in its plan: it needs no module, only the right to have a network of its own."""

    def test_plan_without_tests_is_worked_off_and_ends(self):
        reason = native.why_not_alone() if os.geteuid() == 0 else "needs root"
        if reason:
            self.skipTest(reason)
        plan = {"build": "/nowhere", "group": "plumbing", "tests": [], "virtual": True, "full": False, "seed": 1, "hours": 1}
        with tempfile.TemporaryDirectory() as folder:
            boot = native.NativeBoot(None, folder, "plumbing", plan, os.sched_getaffinity(0))
            boot.child.wait(30)
            self.assertEqual(("", 0, []), (boot.text("console"), boot.child.returncode, boot.results()))


if __name__ == "__main__":
    unittest.main()
