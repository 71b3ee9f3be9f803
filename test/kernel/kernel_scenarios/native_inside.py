# SPDX-License-Identifier: MIT
"""`test/kernel/run --native` on a kernel with everything that it needs: this one. The tests inside the test run in a network of their own."""

import os
import re
import subprocess
import sys

from boot import HERE
from catalogue import kernel_test

# The rig itself with seeded late gateways and an adapter, driving, a crash, a lost line.
INSIDE = (
    "plumbing_vcan",
    "plumbing_discipline",
    "plumbing_gpio",
    "plumbing_slcan",
    "plumbing_late_gateway",
    "plumbing_gateway_halted",
    "vcan_nominal",
    "vcan_row25_killed",
    "row14_",
)
LIMIT_S = 300
LAST_WORDS = 1500


@kernel_test("--native runs the tests on a kernel's own interfaces and lines, and finds the seeded fault", "plumbing", 0)
def plumbing_native(t):
    command = [sys.executable, os.path.join(HERE, "run"), "--native", "--build", t.plan["build"], "--log-lines", "5"]
    for name in INSIDE:
        command += ["--only", name]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=LIMIT_S, check=False)
    counts = re.fullmatch(r"(\d+) passed, (\d+) failed, (\d+) skipped", done.stdout.splitlines()[-1])
    good = done.returncode == 0 and counts and counts.groups() == (str(len(INSIDE)), "0", "0")
    t.check(good, f"all {len(INSIDE)} pass: exit code {done.returncode}\n{done.stdout[-LAST_WORDS:]}")
    t.figure(f"inside: {counts[0] if counts else 'nothing'}")
