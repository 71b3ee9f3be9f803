#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""./demo --mcu: the real STM32 image `gateway` on an emulated CPU, a pseudo terminal as its serial port, the relay, and iwheelctl, which turns wheels."""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "test/system"))

from ends import end_with_signals

BUILD_S, READY_S = 300, 30


class Failed(Exception):
    """A step did not have the expected result."""


class Story:
    """Emulator and relay. Each writes its output to a file, which this program reads."""

    def __init__(self, build, folder):
        self.build, self.folder, self.begin = build, Path(folder), time.monotonic()
        self.socket = str(self.folder / "gateway.sock")
        self.processes = []

    def show(self, text):
        print(f"[{time.monotonic() - self.begin:5.1f} s] {text}", flush=True)

    def start(self, name, command):
        output = self.folder / name
        with open(output, "wb") as file:
            process = subprocess.Popen([str(word) for word in command], stdin=subprocess.PIPE, stdout=file, stderr=file)
        self.processes.append((name, process, output))
        return output

    def wait(self, output, pattern, seconds):
        """Returns the match in the output of the program, or raises Failed."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            text = output.read_text(errors="replace")
            found = re.search(pattern, text)
            if found:
                return found
            for name, process, where in self.processes:
                if process.poll() is not None:
                    raise Failed(f"{name} ended: {where.read_text(errors='replace')[-600:]}")
            time.sleep(0.1)
        raise Failed(f"{pattern!r} was not printed within {seconds} s; the last output: {text[-400:]}")

    def ctl(self, *words):
        self.show("$ iwheelctl " + " ".join(words))
        done = subprocess.run([self.build / "app/ctl/iwheelctl", "--socket", self.socket, *words], capture_output=True, text=True, check=False)
        for line in (done.stdout + done.stderr).splitlines()[:8]:
            print("          " + line, flush=True)
        if done.returncode != 0:
            raise Failed(f"iwheelctl {words[0]} ended with {done.returncode}")

    def play(self):
        self.show("building the image gateway (some seconds)")
        bus = self.start("emulator", [ROOT / "app/demo/emulate", "--image", "gateway", "--every", "0.5"])
        port = self.wait(bus, r"serial port is (/dev/pts/\d+)", BUILD_S)[1]
        self.show(f"an emulated CPU runs it; its serial port is {port}")
        settings = self.folder / "serial.conf"
        settings.write_text("[northbound]\ngroup = none\n", encoding="ascii")
        relay = self.start("relay", [self.build / "app/bridge/serial/iwheel-serial", "-c", settings, "--port", port, "--socket", self.socket])
        said = self.wait(relay, r"board on \S+: start (\w+), version (\S+)", READY_S)
        self.show(f"iwheel-serial has connected: start {said[1]}, version {said[2]}")
        self.ctl("drive", "200", "200", "--for", "2s")
        turned = [float(speed) for speed in re.findall(r"left (-?\d+) mm/s", bus.read_text(errors="replace"))]
        if max(turned) < 100:
            raise Failed(f"the wheels did not turn: {turned}")
        self.show(f"largest speed of the left wheel on the bus: {max(turned):.0f} mm/s")
        self.ctl("why")
        self.show("the board decided lease, ramps and stop, not Linux. docs/user/serial.md: the same with a Nucleo")

    def end(self):
        for _, process, _ in reversed(self.processes):
            process.terminate()
            try:
                process.wait(3)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def main():
    parser = argparse.ArgumentParser(prog="./demo --mcu")
    parser.add_argument("--build", required=True, type=Path)
    options = parser.parse_args()
    end_with_signals()
    if shutil.which("arm-none-eabi-gcc") is None:
        sys.exit("demo: arm-none-eabi-gcc is missing; install it: scripts/install_tools mcu")
    with tempfile.TemporaryDirectory(prefix="iwheel-") as folder:
        story = Story(options.build, folder)
        try:
            story.play()
        except Failed as error:
            print(f"demo: {error}", file=sys.stderr)
            return 1
        finally:
            story.end()
    return 0


if __name__ == "__main__":
    os.environ.setdefault("PYTHONDONTWRITEBYTECODE", "1")
    sys.exit(main())
