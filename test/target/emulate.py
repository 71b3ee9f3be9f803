#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the STM32 image on an emulated Cortex-M and judges what it does.

usage: emulate.py MODEL_LIBRARY BUILDS [BOARD[.SCENARIO]]...

BUILDS holds BOARD-IMAGE.elf for the boards and images that scenarios.py names; test/target/run makes them. Without names, what is long and the same on both families runs on the first board only, unless IWHEEL_FULL is 1.
Needs the Python package unicorn. The last line is "N passed, N failed, N skipped".
"""

import gc
import os
import re
import subprocess
import sys
import tempfile
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.dont_write_bytecode = True

import beginnings
import scenarios
import symbols
from emulator.boards import BOARDS
from emulator.can import Controller, load_model
from emulator.machine import Machine


class Rig:
    """An image running on a board, and what a scenario may ask of it."""

    def __init__(self, board_name, elf, oscillator=None):
        with tempfile.TemporaryDirectory() as folder:  # Not /dev/stdout: objcopy run by root can put a file in its place.
            subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", str(elf), f"{folder}/image"], check=True)
            image = Path(folder, "image").read_bytes()
        kind = re.sub(r"^.*-", "", Path(elf).stem)
        self.machine = Machine(BOARDS[board_name](**scenarios.WIRING.get(kind, {})), image)
        self.machine.uart.baud = scenarios.BAUD.get(kind, self.machine.uart.baud)
        if oscillator is not None:
            self.machine.watchdog.lsi_hz = self.machine.board.lsi_limits_hz[oscillator]
        self.addresses, self.stack_area, self.elf = symbols.addresses(elf), symbols.stack_area(elf), elf
        self.stack_limit = self.stack_area[1] - self.stack_area[0] - scenarios.STACK_SPARE
        self.notes, self.expected_resets = [], []
        self.begun = None  # See beginnings.py.

    def run(self, span_ns):
        self.machine.run(span_ns)

    def setpoints(self, since_ns=0, until_ns=None):
        return self.machine.bus.setpoints(since_ns, until_ns)

    def counter(self, name):
        return int.from_bytes(self.machine.cpu.mem_read(self.addresses[name], 4), "little")

    def poke(self, name, value):
        """Sets a variable of the image."""
        address, size = symbols.variable(self.elf, name)
        self.machine.cpu.mem_write(address, (value % (1 << 8 * size)).to_bytes(size, "little"))

    def peek(self, name):
        return int.from_bytes(self.machine.cpu.mem_read(*symbols.variable(self.elf, name)), "little")

    def console(self):
        """The lines that it told so far."""
        return self.machine.uart.sent.decode("ascii").split("\r\n")

    def function(self, name):
        return symbols.function(self.elf, name)

    def stack_used(self):
        """Bytes of stack that were ever written: RAM begins with a pattern."""
        lowest, highest = self.stack_area
        memory = bytes(self.machine.cpu.mem_read(lowest, highest - lowest))
        return len(memory) - next((at for at, byte in enumerate(memory) if byte != self.machine.POISON), len(memory))

    def note(self, text):
        self.notes.append(text)

    def expect_resets(self, *causes):
        self.expected_resets = list(causes)

    def judge(self):
        """What holds in every scenario."""
        assert not self.machine.violations, "; ".join(self.machine.violations)
        violation = self.machine.can.violation().decode()
        assert not violation, f"bus controller: {violation}"
        assert self.stack_used() <= self.stack_limit, f"{self.stack_used()} bytes of stack were used"
        causes = [cause for _, cause in self.machine.resets]
        assert causes == self.expected_resets, f"resets: {causes}, expected: {self.expected_resets}"
        foreign = {frame.id for frame in self.setpoints()} - {scenarios.LEFT, scenarios.RIGHT}
        assert not foreign, f"ids sent that are not ours: {foreign}"


def attempt(function, *arguments):
    """None, or what went wrong."""
    try:
        function(*arguments)
    except AssertionError as error:
        line = traceback.extract_tb(error.__traceback__)[-1]
        return f"{error or line.line} (line {line.lineno} of {Path(line.filename).name})"
    except Exception:  # noqa: BLE001
        return traceback.format_exc()
    return None


def judge(rig, scenario):
    """(error or None, notes, seconds)"""
    started = time.time()

    def play():
        scenario(rig)
        rig.judge()

    return attempt(play), rig.notes, time.time() - started


def play(group):
    """[(name, error or None, notes, seconds)] of scenarios that begin alike."""
    library, folder, board, image, oscillator, several = group
    Machine.library = Controller.library = load_model(library)
    gc.disable()  # It takes a twentieth of the time, and has little to find before the end.
    rig = Rig(board, Path(folder) / f"{board}-{image}.elf", oscillator)
    failed = attempt(beginnings.run, rig, beginnings.of(several[0]))
    verdicts = []
    for scenario in several:
        verdict = (failed, [], 0) if failed else beginnings.apart(judge, rig, scenario) or ("it ended without a verdict", [], 0)
        verdicts.append((f"{board}.{scenario.__name__}", *verdict))
    del rig
    gc.collect()
    return verdicts


def groups(chosen, full):
    """(board, image, the watchdog's oscillator, scenarios that begin alike), the largest first."""
    found = {}
    for board in BOARDS:
        for image, several in scenarios.BY_BOARD[board].items():
            for scenario in several:
                if (
                    board in chosen
                    or f"{board}.{scenario.__name__}" in chosen
                    or (not chosen and (full or board != "stm32f407" or scenario not in scenarios.LONG))
                ):
                    found.setdefault((board, image, scenarios.OSCILLATOR.get(scenario), beginnings.of(scenario)), []).append(scenario)
    return sorted(((*alike[:3], several) for alike, several in found.items()), key=lambda group: -len(group[3]))


def main(arguments):
    if len(arguments) < 3:
        sys.exit(__doc__)
    tasks = [(Path(arguments[1]).resolve(), arguments[2], *group) for group in groups(arguments[3:], os.environ.get("IWHEEL_FULL") == "1")]
    passed = failed = 0
    with ProcessPoolExecutor(2) as pool:
        for verdicts in pool.map(play, tasks):
            for name, error, notes, seconds in verdicts:
                passed, failed = passed + (error is None), failed + (error is not None)
                told = f"FAIL: {error}" if error else "ok" + "".join(f", {note}" for note in notes)
                print(f"{name:<36} {seconds:5.1f} s  {told}", flush=True)
    print(f"{passed} passed, {failed} failed, 0 skipped")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
