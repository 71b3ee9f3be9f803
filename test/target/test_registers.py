# SPDX-License-Identifier: MIT
"""The reads of registers that block_hook.c serves without Python: they return the values of the models, and without a clock they are refused."""

import ctypes
import os
import struct
from pathlib import Path

import pytest

pytest.importorskip("unicorn", reason="the Python package unicorn is missing in .venv (scripts/python_packages .venv requirements/check.txt)")
import emulate
from emulator.block_clock import Space
from emulator.boards import BOARDS
from emulator.machine import SYSTEM, SYSTICK, Machine

pytestmark = pytest.mark.exact
SYST_CSR, SYST_RVR, SYST_CVR, ICSR = (SYSTEM + offset for offset in (0x10, 0x14, 0x18, 0xD04))


class Cpu:
    """Accesses registers as code on the emulated CPU does. `slow`: the reads that reached Python."""

    def __init__(self, board):
        emulate.load(Path(os.environ["IWHEEL_BUILD"], "test/target/libiwheel_can_models.so").resolve())
        self.machine = Machine(board, struct.pack("<II", 0x20000400, 0x08000101))
        self.space, self.slow = Space(ctypes.pointer(self.machine.clock), 0), []
        original = self.machine.on_read
        self.machine.clock.read = type(self.machine.clock.read)(lambda *access: self.slow.append(access[1]) or original(*access))
        self.library = self.machine.library
        self.library.block_clock_read.restype = ctypes.c_uint64
        self.library.block_clock_write.restype = None

    def read(self, address):
        return self.library.block_clock_read(None, ctypes.c_uint64(address), 4, ctypes.byref(self.space))

    def write(self, address, value):
        self.library.block_clock_write(None, ctypes.c_uint64(address), 4, ctypes.c_uint64(value), ctypes.byref(self.space))

    def block(self, name):
        return next((address, clock) for address, (found, clock) in self.machine.board.blocks.items() if found == name)

    def set_clock(self, clock, on):
        offset, bit = clock
        self.write(self.block("rcc")[0] + offset, on << bit)


@pytest.fixture(params=BOARDS)
def cpu(request):
    return Cpu(BOARDS[request.param]())


def test_can_register_follows_the_model_and_its_clock(cpu):
    address, clock = cpu.block("can")
    cpu.set_clock(clock, 1)
    assert cpu.read(address + 0x1C) == cpu.machine.can.read(0x1C) != 0 and not cpu.slow
    assert not cpu.machine.violations
    cpu.set_clock(clock, 0)
    assert cpu.read(address + 0x1C) == 0 and cpu.machine.violations == ["can was accessed without its clock"]


def test_input_register_follows_the_pins_and_its_clock(cpu):
    board, (name, pin) = cpu.machine.board, cpu.machine.board.pins["estop"]
    address, clock = cpu.block(name)
    port, address = getattr(cpu.machine, name), address + getattr(cpu.machine, name).input_offset
    cpu.set_clock(clock, 1)
    cpu.write(address - port.input_offset, 0x44444444 if port.input_offset == 8 else 0)
    for level in (1, 0, 1):
        board.drive("estop", level)
        assert cpu.read(address) >> pin & 1 == level and len(cpu.slow) == 1
        assert cpu.read(address) >> pin & 1 == level and len(cpu.slow) == 1, "the second read reached Python"
        cpu.slow.clear()
    assert not cpu.machine.violations
    cpu.set_clock(clock, 0)
    assert cpu.read(address) == 0 and cpu.machine.violations == [f"{name} was accessed without its clock"]


def test_systick_counts_and_becomes_pending(cpu):
    cpu.write(SYST_RVR, 7999)
    cpu.write(SYST_CSR, 1)
    first, second = cpu.read(SYST_CVR), cpu.read(SYST_CVR)
    assert 7999 > first > second and cpu.read(SYST_RVR) == 7999 and not cpu.read(ICSR) and not cpu.slow
    while not cpu.slow:
        cpu.read(SYST_CVR)
    assert cpu.read(ICSR) == 1 << 26 and SYSTICK in cpu.machine.pending and cpu.slow == [SYST_CVR]
