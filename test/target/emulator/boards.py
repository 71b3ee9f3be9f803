# SPDX-License-Identifier: MIT
"""The two boards: which peripheral is where, and what is wired to the pins."""
from unicorn import arm_const as arm

from . import chip
from .can import Bus, Controller
from .lamp import Lamp

BLOCK_SIZE = 0x400
IRQ_EXTI0, IRQ_TRANSMIT, IRQ_RECEIVE, IRQ_ERROR = 6, 19, 20, 22


class Board:
    """What both have in common. `blocks`: address of a block -> (name, its clock: offset in RCC and bit, or None)."""

    can_address = 0x40006400

    def build(self, machine, seed):
        machine.clocks = self.clocks(machine)
        machine.port_a, machine.exti, machine.watchdog = self.port(), chip.Exti(), chip.Watchdog(self.lsi_hz)
        machine.port_c = self.port()
        machine.can = Controller(machine)
        machine.bus = Bus(machine, seed)
        machine.can_listens = False # Clocked and on its pins.
        machine.lamp = Lamp(self.lamp_port, self.lamp_pin, self.lamp_lit)
        machine.port_a.drive(0, 0) # The e-stop's contact is closed.

    def reset(self, machine):
        for part in (machine.clocks, machine.port_a, machine.port_c, machine.exti, machine.watchdog, machine.can):
            part.reset()
        machine.can_listens = False

    def interrupts(self, machine):
        """The interrupts whose lines are up."""
        lines = machine.can.lines()
        if machine.exti.line():
            yield IRQ_EXTI0
        if lines:
            for bit, irq in enumerate((IRQ_TRANSMIT, IRQ_RECEIVE, IRQ_ERROR)):
                if lines >> bit & 1:
                    yield irq

    def connect_can(self, machine):
        machine.can_listens = machine.port_a.is_can_pair(11, 12) and machine.clocks.is_enabled(*self.blocks[self.can_address][1])

    def find(self, machine, block, offset):
        name, clock = self.blocks.get(block, (None, None))
        machine.expect(name is not None, f"0x{block + offset:08X} was accessed, which is not modelled")
        if clock is not None and not machine.clocks.is_enabled(*clock):
            machine.expect(False, f"{name} was accessed without its clock")
            return None
        return name

    def read(self, machine, block, offset):
        name = self.find(machine, block, offset)
        if name == "rcc":
            return machine.clocks.read(offset, machine.now_ns)
        if name == "flash":
            return machine.clocks.acr
        if name in ("port_a", "port_c"):
            return getattr(machine, name).read(offset)
        if name == "exti":
            return machine.exti.registers[offset]
        if name == "selection":
            return machine.exti.selection
        if name == "watchdog":
            return machine.watchdog.read(offset, machine.now_ns)
        return machine.can.read(offset) if name == "can" else 0

    def write(self, machine, block, offset, value):
        name = self.find(machine, block, offset)
        if name == "rcc":
            machine.clocks.write(offset, value, machine.now_ns)
        elif name == "flash":
            machine.clocks.acr = value
        elif name in ("port_a", "port_c"):
            getattr(machine, name).write(offset, value)
        elif name == "exti":
            machine.exti.write(offset, value)
        elif name == "selection":
            machine.expect(offset == 0x8, "another EXTI selection than the first was written")
            machine.exti.selection = value
        elif name == "watchdog":
            machine.watchdog.write(offset, value, machine.now_ns)
        elif name == "can":
            machine.can.write(offset, value)
        if name in ("rcc", "port_a"):
            self.connect_can(machine)
        if name in ("port_a", "port_c"):
            machine.look_at_pins()
        elif name != "watchdog":
            machine.clock.is_asked_to_stop = 1 # Other interrupts may come now.


class Stm32f103(Board):
    name, cpu_model, banks, lsi_hz, lsi_limits_hz = "stm32f103", arm.UC_CPU_ARM_CORTEX_M3, 14, 40_000, (30_000, 60_000)
    clocks, port, lamp_port, lamp_pin, lamp_lit = chip.ClocksF1, chip.PortF1, "port_c", 13, 0
    blocks = {
        0x40021000: ("rcc", None), 0x40022000: ("flash", None), 0x40003000: ("watchdog", None),
        0x40010000: ("selection", (0x18, 0)), 0x40010400: ("exti", None), 0x40010800: ("port_a", (0x18, 2)),
        0x40011000: ("port_c", (0x18, 4)), 0x40006400: ("can", (0x1C, 25)),
    }


class Stm32f407(Board):
    name, cpu_model, banks, lsi_hz, lsi_limits_hz = "stm32f407", arm.UC_CPU_ARM_CORTEX_M4, 28, 32_000, (17_000, 47_000)
    clocks, port, lamp_port, lamp_pin, lamp_lit = chip.ClocksF4, chip.PortF4, "port_a", 5, 1
    blocks = {
        0x40023800: ("rcc", None), 0x40023C00: ("flash", None), 0x40003000: ("watchdog", None),
        0x40013800: ("selection", (0x44, 14)), 0x40013C00: ("exti", None), 0x40020000: ("port_a", (0x30, 0)),
        0x40006400: ("can", (0x40, 25)),
    }


BOARDS = {board.name: board for board in (Stm32f103, Stm32f407)}
