# SPDX-License-Identifier: MIT
"""The same tests on the machine's own kernel, where it has vcan and gpio-sim and lets us use them."""

import os
import shutil
import subprocess
import sys

from boot import HERE, Boot


def why_not_native():
    """What keeps this machine's kernel from being used; None if nothing does."""
    if os.geteuid() != 0:
        return "--native needs root: it makes CAN interfaces and GPIO chips"
    if shutil.which("modprobe"):
        for module in ("vcan", "slcan", "gpio-sim"):
            subprocess.run(["modprobe", "-q", module], stderr=subprocess.DEVNULL, check=False)
    if not os.path.isdir("/sys/kernel/config/gpio-sim"):
        return "no /sys/kernel/config/gpio-sim here: it needs Linux 5.17 or later, modprobe gpio-sim, and configfs mounted"
    command = ["unshare", "--net", "ip", "link", "add", "vcan0", "type", "vcan"]
    made = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    return None if made.returncode == 0 else f"this kernel makes no vcan interface: {made.stdout.strip()}"


class NativeBoot(Boot):
    """No boot at all: the guest's program in a network of its own on this kernel."""

    def command(self, kernel):
        return ["unshare", "--net", sys.executable, os.path.join(HERE, "guest.py"), self.path("json")]
