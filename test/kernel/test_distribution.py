#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The distribution's kernel: its requirements, and the messages if it is not available. Needs no emulator.

Usage: test/kernel/test_distribution.py
"""

import os
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]
import distribution


def answers(*texts, code=0):
    done = [subprocess.CompletedProcess([], code, text) for text in texts]
    return mock.patch.object(distribution.subprocess, "run", side_effect=done)


class Distribution(unittest.TestCase):
    def setUp(self):
        self.folder = self.enterContext(tempfile.TemporaryDirectory())
        self.enterContext(mock.patch.dict(os.environ, {"XDG_CACHE_HOME": self.folder}))
        self.enterContext(mock.patch.object(distribution.shutil, "which", side_effect=lambda name, path: f"/bin/{name}"))
        self.enterContext(mock.patch.object(distribution.os, "uname", return_value=mock.Mock(machine="x86_64")))

    def test_program_missing_names_its_package(self):
        with mock.patch.object(distribution.shutil, "which", side_effect=lambda name, path: None if name == "cpio" else name):
            self.assertIn("apt-get install cpio", distribution.why_not_emulated("amd64"))

    def test_another_machine_is_reported(self):
        with mock.patch.object(distribution.os, "uname", return_value=mock.Mock(machine="riscv64")):
            self.assertIn("this machine is riscv64", distribution.why_not_emulated("amd64"))

    def test_distribution_without_such_a_package_is_reported(self):
        with answers("linux-image-amd64\n"):
            self.assertIn("no package linux-image-amd64", distribution.why_not_emulated("amd64"))

    def test_output_of_apt_is_reported(self):
        with answers("E: No packages found\n", code=100):
            self.assertIn("E: No packages found", distribution.why_not_emulated("amd64"))

    def test_a_kernel_that_was_fetched_is_not_fetched_again(self):
        stored = os.path.join(self.folder, "iwheel", "linux-image-6.1.0-1-amd64-6.1.9-1")
        os.makedirs(stored)
        with open(os.path.join(stored, "vmlinuz"), "w", encoding="ascii"):
            pass
        with answers("  Depends: linux-image-6.1.0-1-amd64\n", "  Candidate: 6.1.9-1\n"):
            self.assertIsNone(distribution.why_not_emulated("amd64"))

    def foreign(self, *packages):
        """arm64 with its files present and these packages of this project; returns the reason why it cannot be emulated."""
        root = os.path.join(self.folder, "iwheel", "distribution-arm64", "root")
        ours = os.path.join(self.folder, "build", "cross", "arm64")
        for folder in (os.path.join(root, "boot"), ours):
            os.makedirs(folder)
        for path in (os.path.join(root, "wanted"), os.path.join(root, "boot", "vmlinuz-6"), *(os.path.join(ours, name) for name in packages)):
            with open(path, "w", encoding="ascii"):
                pass
        with mock.patch.object(distribution, "ROOT", self.folder), answers(""):
            return distribution.why_not_emulated("arm64")

    def test_foreign_architecture_uses_kernel_of_its_own_files(self):
        self.assertIsNone(self.foreign("iwheel-gateway_1_arm64.deb", "iwheel-tools_1_arm64.deb"))
        self.assertTrue(os.path.exists(os.path.join(self.folder, "iwheel", "distribution-arm64", "vmlinuz")))

    def test_foreign_architecture_without_packages_names_the_fix(self):
        self.assertIn("no packages for arm64: ./check cross", self.foreign("iwheel-gateway_1_arm64.deb"))

    def test_image_has_what_a_link_leads_to_and_the_folders_above(self):
        target, link = os.path.join(self.folder, "far", "target"), os.path.join(self.folder, "link")
        os.mkdir(os.path.dirname(target))
        with open(target, "w", encoding="ascii"):
            pass
        os.symlink("far/target", link)
        image = distribution.Image()
        image.add(link)
        top = os.path.realpath(self.folder)
        self.assertLessEqual({os.path.join(top, name) for name in ("link", "far", "far/target")} | {top}, image.files)


if __name__ == "__main__":
    unittest.main()
