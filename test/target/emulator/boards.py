# SPDX-License-Identifier: MIT
"""The boards: which peripheral is where, and what is wired to the pins."""

from unicorn import arm_const as arm

from . import chip, chip_g4
from .can import Bus, Controller, FdController
from .lamp import Lamp

BLOCK_SIZE = 0x400
IRQ_EXTI0, IRQ_TRANSMIT, IRQ_RECEIVE, IRQ_ERROR = 6, 19, 20, 22
IRQ_SERIAL_RECEIVE, IRQ_SERIAL_TRANSMIT, IRQ_SERIAL = 16, 17, 38
IRQ_FDCAN = 21
SERIAL = 3 | 1 << IRQ_SERIAL - IRQ_SERIAL_RECEIVE
NO_DEVICE = None, (None, 0), None, None  # Its clock is never on.


class Board:
    """What all have in common. `blocks`: address of a block -> (name, its clock: offset in RCC and bit, or None)."""

    can_address, can_ram_address = 0x40006400, 0
    pins = {"estop": ("port_b", 0), "button": ("port_a", 1)}
    uart_pins, can_pairs = ("port_a", 3, 2), {"PB8": ("port_b", 8, 9), "PA11": ("port_a", 11, 12)}
    ports = ("port_a", "port_b", "port_c", "port_d")
    uart, controller = chip.Uart, Controller
    spaces = ((0x40000000, 0x30000),)  # Address and size of what has registers.
    without_interrupts = {*ports, "watchdog", "uart", "can_ram"}  # For those of the serial port the code does not wait.

    can_default = "PB8"

    def __init__(self, transceiver=None, crystal_hz=None):
        self.transceiver, self.crystal_hz = self.can_pairs[transceiver or self.can_default], crystal_hz

    def build(self, machine, seed):
        machine.clocks = self.clocks(machine)
        machine.clocks.crystal_hz = self.crystal_hz or machine.clocks.crystal_hz
        machine.exti, machine.watchdog, machine.uart = chip.Exti(), chip.Watchdog(machine, self.lsi_hz), self.uart(machine)
        machine.dma, machine.flash = self.dma(machine), self.flash(machine)
        machine.map_flash(machine.flash)
        for name, cached in zip(self.ports, machine.clock.inputs, strict=True):
            setattr(machine, name, self.port(cached))
        machine.can = self.controller(machine)
        machine.bus = Bus(machine, seed)
        machine.can_listens = False  # Clocked and on its pins.
        machine.lamp = Lamp(*self.lamp)
        self.machine = machine
        self.drive("estop", 0)  # The contact is closed.
        self.devices = {block: (name, clock, *self.accessors(name)) for block, (name, clock) in self.blocks.items()}
        for block, (name, _) in self.blocks.items():
            if name in self.ports:
                port = getattr(machine, name)
                port.cached.address = block + port.input_offset
        machine.clock.can_blocks[:] = self.can_address, self.can_ram_address
        machine.clock.read_can = machine.can.address_of_read()

    def reset(self, machine):
        machine.bus.chip_vanishes()
        for part in (
            machine.clocks,
            machine.exti,
            machine.watchdog,
            machine.uart,
            machine.dma,
            machine.flash,
            machine.can,
            *(getattr(machine, name) for name in self.ports),
        ):
            part.reset()
        self.remap, self.multiplexer = 0, {}
        machine.can_listens, machine.clock.can = False, None

    remap, multiplexer = 0, {}  # AFIO_MAPR, DMAMUX

    def drive(self, what, level):
        """Something outside drives a pin; None: nothing but the pin's own pull-up does."""
        port, pin = self.pins[what]
        if level is None:
            getattr(self.machine, port).release(pin)
        else:
            getattr(self.machine, port).drive(pin, level)

    def estop_level(self):
        """Level of the pin that EXTI line 0 watches."""
        port = self.ports[self.machine.exti.selection & 0xF]
        return getattr(self.machine, port).level(0)

    def uart_is_connected(self):
        port, rx, tx = self.uart_pins
        return getattr(self.machine, port).is_pair(rx, tx, 7)

    def interrupts(self, machine):
        """The interrupts whose lines are up, each a bit."""
        lines = machine.can.lines()
        if lines:
            lines = self.can_interrupts(lines)
        if machine.exti.line():
            lines |= 1 << IRQ_EXTI0
        if not machine.enabled >> IRQ_SERIAL_RECEIVE & SERIAL:
            return lines
        dma = machine.dma
        return lines | dma.receive.line() << IRQ_SERIAL_RECEIVE | dma.transmit.line() << IRQ_SERIAL_TRANSMIT | machine.uart.line() << IRQ_SERIAL

    def can_interrupts(self, lines):
        return (lines & 1) << IRQ_TRANSMIT | (lines >> 1 & 1) << IRQ_RECEIVE | (lines >> 2 & 1) << IRQ_ERROR

    def connect_can(self):
        machine = self.machine
        port, rx, tx = self.transceiver
        machine.can_listens = (
            getattr(machine, port).is_pair(rx, tx, 9) and self.is_mapped(self.transceiver) and machine.clocks.is_enabled(*self.blocks[self.can_address][1])
        )

    def is_mapped(self, _):
        """The controller is led to these pins."""
        return True

    def accessors(self, name):
        """How a device is read and written, each a function of the offset (and the value)."""
        machine = self.machine
        clocks, watchdog = machine.clocks, machine.watchdog
        if name in self.ports:
            port = getattr(machine, name)
            return lambda offset: self.read_port(port, offset), lambda offset, value: self.write_port(port, offset, value)
        return {
            "rcc": (lambda offset: clocks.read(offset, machine.now_ns), self.write_clocks),
            "flash": (machine.flash.read, machine.flash.write),
            "exti": (lambda offset: machine.exti.registers[offset], machine.exti.write),
            "selection": (lambda offset: machine.exti.selection if offset == 0x8 else self.remap, self.write_selection),
            "watchdog": (lambda offset: watchdog.read(offset, machine.now_ns), lambda offset, value: watchdog.write(offset, value, machine.now_ns)),
            "uart": (machine.uart.read, machine.uart.write),
            "dma": (machine.dma.read, machine.dma.write),
            "can": (machine.can.read, machine.can.write),
            "can_ram": (lambda offset: machine.can.read(BLOCK_SIZE + offset), lambda offset, value: machine.can.write(BLOCK_SIZE + offset, value)),
            "multiplexer": (lambda offset: self.multiplexer.get(offset, 0), lambda offset, value: self.multiplexer.update({offset: value})),
        }[name]

    def read_port(self, port, offset):
        value = port.read(offset)
        if offset == port.input_offset:
            port.cached.value, port.cached.is_known = value, 1
        return value

    def write_port(self, port, offset, value):
        if port.write(offset, value):
            self.connect_can()
            self.machine.look_at_pins()

    def write_clocks(self, offset, value):
        machine = self.machine
        machine.clocks.write(offset, value, machine.now_ns)
        for cached in machine.clock.inputs:
            cached.is_known = 0
        machine.clock.can = machine.can.model if machine.clocks.is_enabled(*self.blocks[self.can_address][1]) else None
        self.connect_can()

    def write_selection(self, offset, value):
        if offset == 0x8:
            self.machine.exti.select(value)
            return
        self.machine.expect(offset == self.remap_offset, "another EXTI selection than the first was written")
        self.remap = value
        self.connect_can()

    remap_offset = None

    def refuse(self, name, address):
        """No device is there, or its clock is off."""
        self.machine.expect(False, f"{name} was accessed without its clock" if name else f"0x{address:08X} was accessed, which is not modelled")
        return 0

    def read(self, block, offset):
        name, clock, read, _ = self.devices.get(block, NO_DEVICE)
        if clock is None or self.machine.clocks.is_enabled(*clock):
            return read(offset)
        return self.refuse(name, block + offset)

    def write(self, block, offset, value):
        name, clock, _, write = self.devices.get(block, NO_DEVICE)
        if clock is None or self.machine.clocks.is_enabled(*clock):
            write(offset, value)
        else:
            self.refuse(name, block + offset)
        self.machine.touch()
        if name not in self.without_interrupts:
            self.machine.clock.is_asked_to_stop = 1  # Other interrupts may come now.


class Stm32f103(Board):
    name, cpu_model, banks, lsi_hz, lsi_limits_hz = "stm32f103", arm.UC_CPU_ARM_CORTEX_M3, 14, 40_000, (30_000, 60_000)
    dma, flash, unique_id_address = chip.DmaF1, chip.FlashF1, 0x1FFFF7E8
    clocks, port, lamp, remap_offset = chip.ClocksF1, chip.PortF1, ("port_c", 13, 0), 0x4
    ram_size = 20 * 1024
    blocks = {
        0x40021000: ("rcc", None),
        0x40022000: ("flash", None),
        0x40003000: ("watchdog", None),
        0x40010000: ("selection", (0x18, 0)),
        0x40010400: ("exti", None),
        0x40010800: ("port_a", (0x18, 2)),
        0x40010C00: ("port_b", (0x18, 3)),
        0x40011000: ("port_c", (0x18, 4)),
        0x40011400: ("port_d", (0x18, 5)),
        0x40020000: ("dma", (0x14, 0)),
        0x40004400: ("uart", (0x1C, 17)),
        0x40006400: ("can", (0x1C, 25)),
    }

    def is_mapped(self, transceiver):
        """RM0008 9.4.2: CAN_REMAP. SWJ_CFG other than 0 would disable the debugger's pins."""
        self.machine.expect(not self.remap >> 24 & 7, "SWJ_CFG was changed")
        return self.remap >> 13 & 3 == {"port_a": 0, "port_b": 2}[transceiver[0]]


class Stm32f407(Board):
    name, cpu_model, banks, lsi_hz, lsi_limits_hz = "stm32f407", arm.UC_CPU_ARM_CORTEX_M4, 28, 32_000, (17_000, 47_000)
    dma, flash, unique_id_address = chip.DmaF4, chip.FlashF4, 0x1FFF7A10
    clocks, port, lamp = chip.ClocksF4, chip.PortF4, ("port_d", 12, 1)
    ram_size = 128 * 1024
    blocks = {
        0x40023800: ("rcc", None),
        0x40023C00: ("flash", None),
        0x40003000: ("watchdog", None),
        0x40013800: ("selection", (0x44, 14)),
        0x40013C00: ("exti", None),
        0x40020000: ("port_a", (0x30, 0)),
        0x40020400: ("port_b", (0x30, 1)),
        0x40020800: ("port_c", (0x30, 2)),
        0x40020C00: ("port_d", (0x30, 3)),
        0x40026000: ("dma", (0x30, 21)),
        0x40004400: ("uart", (0x40, 17)),
        0x40006400: ("can", (0x40, 25)),
    }


class Stm32f446(Stm32f407):
    """Other limits of the clock tree, and a clock instead of a crystal where the board has it from its debugger."""

    name, clocks, lamp = "stm32f446", chip.ClocksF446, ("port_a", 5, 1)


class Stm32g474(Board):
    """Nucleo-G474RE. PB8 is BOOT0: with the transceiver there the chip would start its ROM."""

    name, cpu_model, banks, lsi_hz, lsi_limits_hz = "stm32g474", arm.UC_CPU_ARM_CORTEX_M4, 0, 32_000, (29_500, 34_000)
    dma, flash, unique_id_address, uart, controller = chip_g4.DmaG4, chip_g4.FlashG4, 0x1FFF7590, chip_g4.UartG4, FdController
    clocks, port, lamp, can_default = chip_g4.ClocksG4, chip_g4.PortG4, ("port_a", 5, 1), "PA11"
    ram_size, can_ram_address = 96 * 1024, 0x4000A400
    spaces = ((0x40000000, 0x30000), (0x48000000, 0x2000))
    blocks = {
        0x40021000: ("rcc", None),
        0x40022000: ("flash", None),
        0x40003000: ("watchdog", None),
        0x40010000: ("selection", (0x60, 0)),
        0x40010400: ("exti", None),
        0x48000000: ("port_a", (0x4C, 0)),
        0x48000400: ("port_b", (0x4C, 1)),
        0x48000800: ("port_c", (0x4C, 2)),
        0x48000C00: ("port_d", (0x4C, 3)),
        0x40020000: ("dma", (0x48, 0)),
        0x40020800: ("multiplexer", (0x48, 2)),
        0x40004400: ("uart", (0x58, 17)),
        0x40006400: ("can", (0x58, 25)),
        0x4000A400: ("can_ram", (0x58, 25)),
    }

    def __init__(self, transceiver=None, crystal_hz=None):
        super().__init__(transceiver, crystal_hz)
        self.multiplexer = {}

    def can_interrupts(self, lines):
        return lines << IRQ_FDCAN


BOARDS = {board.name: board for board in (Stm32f103, Stm32f407, Stm32f446, Stm32g474)}
