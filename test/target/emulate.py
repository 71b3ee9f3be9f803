# SPDX-License-Identifier: MIT
"""Runs the STM32 image on an emulated Cortex-M and judges what it does.

usage: emulate.py MODEL_LIBRARY BOARD-IMAGE.elf SCENARIO     "ok", or "FAIL: " and why, of one scenario (for test/faults)

Needs the Python package unicorn.
"""

import subprocess
import sys
import tempfile
import traceback
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

    def __init__(self, elf, oscillator=None):
        with tempfile.TemporaryDirectory() as folder:  # Not /dev/stdout: objcopy run by root can put a file in its place.
            subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", str(elf), f"{folder}/image"], check=True)
            image = Path(folder, "image").read_bytes()
        board, kind = Path(elf).stem.split("-")
        self.machine = Machine(BOARDS[board](**scenarios.WIRING.get(kind, {})), image)
        self.machine.uart.baud = scenarios.BAUD.get(kind, self.machine.uart.baud)
        if oscillator is not None:
            self.machine.watchdog.lsi_hz = self.machine.board.lsi_limits_hz[oscillator]
        self.addresses, self.stack_area, self.elf = symbols.addresses(elf), symbols.stack_area(elf), elf
        self.stack_limit = self.stack_area[1] - self.stack_area[0] - scenarios.STACK_SPARE
        self.notes, self.expected_resets = [], []
        self.begun = None  # See beginnings.py.

    def run(self, span_ns):
        self.machine.run(span_ns)

    def open_estop(self):
        """Nothing but the pull-up drives the pin then, as with a cut wire. Returns when."""
        self.machine.board.drive("estop", None)
        return self.machine.now_ns

    def close_estop(self):
        self.machine.board.drive("estop", 0)

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
        """The lines that it has printed so far."""
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


def load(library):
    Machine.library = Controller.library = load_model(library)


def judge(rig, scenario):
    """(what went wrong or None, notes)"""
    error = None
    try:
        scenario(rig)
        rig.judge()
    except AssertionError as failed:
        line = traceback.extract_tb(failed.__traceback__)[-1]
        error = f"{failed or line.line} (line {line.lineno} of {Path(line.filename).name})"
    except Exception:  # noqa: BLE001
        error = traceback.format_exc()
    return error, rig.notes


def main(library, elf, name):
    board, kind = Path(elf).stem.split("-")
    scenario = next(one for one in scenarios.BY_BOARD[board][kind] if one.__name__ == name)
    load(Path(library).resolve())
    error, _ = judge(Rig(elf, scenarios.OSCILLATOR.get(scenario)), scenario)
    print(f"FAIL: {error}" if error else "ok")


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) == 4 else sys.exit(__doc__)
