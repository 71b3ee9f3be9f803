#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the STM32 image on an emulated Cortex-M and judges what it does.

usage: emulate.py MODEL_LIBRARY BUILDS [BOARD[.SCENARIO]]...

BUILDS holds BOARD-IMAGE.elf for the boards and images that scenarios.py names; test/target/run makes them. Without names, what is long and the same on both families runs on the first board only, unless IWHEEL_FULL is 1.
Needs the Python package unicorn. The last line is "N passed, N failed, N skipped".
"""
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

import scenarios
import symbols
from emulator.boards import BOARDS
from emulator.can import Controller, load_model
from emulator.machine import Machine


class Rig:
    """An image running on a board, and what a scenario may ask of it."""

    def __init__(self, board_name, elf, oscillator=None):
        with tempfile.TemporaryDirectory() as folder: # Not /dev/stdout: objcopy run by root can put a file in its place.
            subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", str(elf), f"{folder}/image"], check=True)
            image = Path(folder, "image").read_bytes()
        kind = re.sub(r"^.*-", "", Path(elf).stem)
        self.machine = Machine(BOARDS[board_name](**scenarios.WIRING.get(kind, {})), image)
        self.machine.uart.baud = scenarios.BAUD.get(kind, self.machine.uart.baud)
        self.stack_limit = scenarios.STACK.get(kind, 1024)
        if oscillator is not None:
            self.machine.watchdog.lsi_hz = self.machine.board.lsi_limits_hz[oscillator]
        self.addresses, self.stack_area, self.elf = symbols.addresses(elf), symbols.stack_area(elf), elf
        self.notes, self.expected_resets = [], []

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


def play(task):
    """(name, error or None, notes, seconds)"""
    library, folder, board, image, scenario = task
    Machine.library = Controller.library = load_model(library)
    started, name = time.time(), f"{board}.{scenario.__name__}"
    try:
        rig = Rig(board, Path(folder) / f"{board}-{image}.elf", scenarios.OSCILLATOR.get(scenario))
        scenario(rig)
        rig.judge()
        return name, None, rig.notes, time.time() - started
    except AssertionError as error:
        line = traceback.extract_tb(error.__traceback__)[-1]
        return name, f"{error or line.line} (line {line.lineno} of {Path(line.filename).name})", [], time.time() - started
    except Exception:
        return name, traceback.format_exc(), [], time.time() - started


def main(arguments):
    if len(arguments) < 3:
        sys.exit(__doc__)
    library, folder, chosen = Path(arguments[1]).resolve(), arguments[2], arguments[3:]
    full = os.environ.get("IWHEEL_FULL") == "1"
    tasks = [(library, folder, board, image, scenario)
             for board in BOARDS for image, several in scenarios.BY_BOARD[board].items() for scenario in several
             if board in chosen or f"{board}.{scenario.__name__}" in chosen
             or not chosen and (full or board != "stm32f407" or scenario not in scenarios.LONG)]
    failed = 0
    with ProcessPoolExecutor(2) as pool:
        for name, error, notes, seconds in pool.map(play, tasks):
            failed += error is not None
            told = f"FAIL: {error}" if error else "ok" + "".join(f", {note}" for note in notes)
            print(f"{name:<36} {seconds:5.1f} s  {told}", flush=True)
    print(f"{len(tasks) - failed} passed, {failed} failed, 0 skipped")
    return 1 if failed or not tasks else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
