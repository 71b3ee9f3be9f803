# SPDX-License-Identifier: MIT
"""The same tests on the machine's own kernel, if it has vcan and gpio-sim and permits their use. All of them run in real time.

test_native.py tests what it requires, its messages about missing parts, and how it starts the tests. Some of the
tests run with it inside the kernel of the tests (kernel_scenarios/native_inside.py). Whether they pass on another kernel
depends on that kernel; docs/developer/fault-catalogue.md shows where they were run.
"""

import os
import shutil
import subprocess
import sys

from boot import HERE, Boot
from harness import die_with_parent


GPIO_SIM = "/sys/kernel/config/gpio-sim"
PROGRAMS = {"unshare": "util-linux", "nsenter": "util-linux", "mount": "mount", "ip": "iproute2", "tc": "iproute2"}
# A network of its own, /sys for it, and a separate folder for the markers of armed gateways, so that those of real ones stay untouched.
ALONE = ["unshare", "--net", "--mount", "sh", "-e", "-c"]
SURROUNDINGS = """
mount -t sysfs sysfs /sys
[ ! -d /sys/kernel/config ] || mount -t configfs configfs /sys/kernel/config
mkdir -p /run/iwheel
mount -t tmpfs tmpfs /run/iwheel
ip link set lo up
exec "$@"
"""


def why_not_alone():
    """Reason why a private network and private mounts are not available, and the fix; None if they are."""
    tried = subprocess.run([*ALONE, "true"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if tried.returncode == 0:
        return None
    # In a chroot of a plain folder, mounts would appear outside of it too.
    fix = " (in a chroot: mount --bind its folder onto itself before you enter it)" if "propagation" in tried.stdout else ""
    return f"a private network and private mounts are not available here: {tried.stdout.strip()}{fix}"


def why_not_native():
    """Reason why this machine's kernel cannot be used, and the fix; None if it can."""
    if os.geteuid() != 0:
        return "--native needs root: it makes CAN interfaces and GPIO chips; run it with sudo, or without --native"
    missing = sorted({package for program, package in PROGRAMS.items() if not shutil.which(program)})
    if missing:
        return f"--native needs programs that are missing here: apt-get install {' '.join(missing)}"
    if shutil.which("modprobe"):
        for module in ("vcan", "slcan", "gpio-sim"):
            subprocess.run(["modprobe", "-q", module], stderr=subprocess.DEVNULL, check=False)
    if not os.path.isdir(GPIO_SIM):
        return f"no {GPIO_SIM} here: it needs Linux 5.17 or later, modprobe gpio-sim, and configfs mounted; or run without --native"
    reason = why_not_alone()
    if reason:
        return reason
    command = ["unshare", "--net", "ip", "link", "add", "vcan0", "type", "vcan"]
    made = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    return None if made.returncode == 0 else f"this kernel makes no vcan interface (modprobe vcan, or run without --native): {made.stdout.strip()}"


class NativeBoot(Boot):
    """No boot: the guest's program with a private network and private mounts on this kernel."""

    def prepare(self):
        die_with_parent()

    def command(self, kernel):
        return [*ALONE, SURROUNDINGS, "native", sys.executable, os.path.join(HERE, "guest.py"), self.path("json")]
