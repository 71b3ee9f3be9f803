# SPDX-License-Identifier: MIT
"""Peripherals of STM32G474 that differ from those of chip.py: clocks, ports, USART, DMA with its multiplexer, flash. Sections are those of RM0440."""

from . import chip
from .chip import MS, US

INTERNAL, CRYSTAL, PLL = 1, 2, 3  # SW and SWS of RCC_CFGR (7.4).


class ClocksG4(chip.Clocks):
    """7.4. Range 1 without boost (6.1)."""

    crystal_hz = 24_000_000
    internal_hz, csr_offset, cfgr_offset, pllcfgr_offset, acr_reset = 16_000_000, 0x94, 0x08, 0x0C, 0x40600
    apb1_reset_offset = 0x38
    pll_bits = 0
    prefetch, prefetch_max_hz, cache_on, cache_reset, acr_without, must_read_acr = 1 << 8, 1 << 40, 1 << 10, 1 << 12, 0x1800, True

    def reset(self):
        super().reset()
        self.cr, self.cfgr, self.pllcfgr = 0x500, INTERNAL << 2 | INTERNAL, 0x1000

    def update(self, now_ns):
        """As on the other families, which number the sources from 0."""
        wanted = self.cfgr
        self.expect(wanted & 3, "SW has a reserved value")
        self.cfgr = wanted & ~0xF | max((wanted & 3) - 1, 0)
        super().update(now_ns)
        self.cfgr = wanted & ~0xC | ((self.cfgr >> 2 & 3) + 1) << 2

    def read(self, offset, now_ns):
        """RCC_CIFR: CSSF, as far as the port reads it."""
        return self.crystal_failed << 8 if offset == 0x1C else super().read(offset, now_ns)

    def write(self, offset, value, now_ns):
        if offset == self.csr_offset:
            self.flags = 0 if value >> 23 & 1 else self.flags
            return
        if offset == 0x88:  # 7.4: FDCANSEL.
            self.expect(not self.chip.can.is_on(), "the clock of the bus was changed while it is in use")
        if offset == self.cfgr_offset:
            self.expect(self.acr_is_read or value & 3 != PLL, "the wait states were not read back before the clock rises")
        super().write(offset, value, now_ns)
        if self.cfgr & 3 == PLL:
            self.check_limits()

    def runs_from_crystal(self):
        return self.cfgr >> 2 & 3 == PLL and self.pll_from_hse()

    def pll_from_hse(self):
        return self.pllcfgr & 3 == 3

    def pll_hz(self):
        source = self.crystal_hz if self.pll_from_hse() else self.internal_hz
        m, n, r = (self.pllcfgr >> 4 & 0xF) + 1, self.pllcfgr >> 8 & 0x7F, ((self.pllcfgr >> 25 & 3) + 1) * 2
        self.expect(self.pllcfgr >> 24 & 1, "the PLL's output R is off")
        self.expect(2_660_000 <= source / m <= 16_000_000, "the PLL's input is not 2.66 to 16 MHz")
        self.expect(96_000_000 <= source / m * n <= 344_000_000 and n >= 8, "the PLL runs outside its limits")
        return source * n // m // r

    def apb1_hz(self):
        return self.core_hz // (1, 1, 1, 1, 2, 4, 8, 16)[self.cfgr >> 8 & 7]

    def can_hz(self):
        """The kernel clock of FDCAN: of the crystal, of an output that this model does not have, or of its bus."""
        return {0: self.crystal_hz, 2: self.apb1_hz()}.get(self.enable.get(0x88, 0) >> 24 & 3, 0)

    def check_limits(self):
        self.expect(self.core_hz <= 150_000_000, f"the core runs at {self.core_hz} Hz")
        self.expect(not self.cfgr >> 4 & 0xF, "the bus of the memories is divided")
        self.expect(self.cfgr >> 2 & 3 != PLL or self.can_hz() <= self.apb1_hz(), "the kernel of FDCAN is faster than its bus")
        self.expect((self.acr & 0xF) >= (self.core_hz - 1) // 30_000_000, "too few wait states of the flash")


class PortG4(chip.PortF4):
    """9.4: after a reset the pins are analog, and an analog pin reads low."""

    def reset(self):
        super().reset()
        self.registers[0] = 0xFFFFFFFF

    def level(self, pin):
        return 0 if self.two(0, pin) == 3 else super().level(pin)


class UartG4(chip.Uart):
    """37.8: other offsets, flags that ICR clears, and UE is bit 0 of CR1. Inside, registers are those of the older version."""

    def read(self, offset):
        if offset == 0x1C:
            return super().read(0)
        if offset == 0x24:
            self.said_sr = False
            self.chip.expect(not self.by_dma(), "the CPU read a byte that belongs to the DMA")
            return super().read(4)
        self.chip.expect(False, f"0x{offset:X} of the USART was read, which is not modelled")
        return 0

    def write(self, offset, value):
        if offset == 0x20:
            self.flags &= ~(value & 0x1F)
            if value & 0x40:
                super().write(0, 0)  # As the older version clears TC.
        elif offset == 0:
            super().write(0xC, value & ~0x2001 | (value & 1) << 13)
        elif offset in (0x8, 0xC, 0x28):
            self.said_sr = True  # A write of TDR alone clears TC.
            super().write({0x8: 0x14, 0xC: 8, 0x28: 4}[offset], value)
        else:
            self.chip.expect(False, f"0x{offset:X} of the USART was written, which is not modelled")


class ChannelG4(chip.ChannelF1):
    """12.6, and the multiplexer before it (13): input 26 is received by USART2, 27 sent."""

    def data_register(self):
        return 0x40004428 if self.control() & self.FROM_MEMORY else 0x40004424

    def begin(self):
        channel, wanted = (6, 27) if self.control() & self.FROM_MEMORY else (5, 26)
        self.chip.expect(self.chip.board.multiplexer.get(4 * channel) == wanted, "the multiplexer does not connect USART2 with its channel")
        super().begin()


class DmaG4(chip.DmaF1):
    kind = ChannelG4

    def write(self, offset, value):
        self.chip.expect(offset != self.clear_offset or not value & 0x1111111, "CGIF was written: a transfer error at that moment would be lost")
        super().write(offset, value)


class FlashG4(chip.Flash):
    """3.7: the last 8 KiB, of which the store has the first 2 of each 4. Two words are one write. `broken`: 64 bits whose write was cut off: reading
    them raises the NMI. `eccr_lost`: the operation that was cut off has damaged ECCR too (ES0430 2.2.3)."""

    base, size, lock, unit, program_ns, erase_ns = 0x0807E000, 0x2000, 1 << 31, 4, 85 * US, 25 * MS
    word_bytes = 8  # Each word of the store is written with its inverse.
    two_banks = True  # The option DBANK.

    def __init__(self, machine):
        self.broken, self.eccr_lost = set(), False
        super().__init__(machine)

    def reset(self):
        super().reset()
        self.eccr, self.half = 0, None

    def fetch(self, address, size):
        if address & ~7 in self.broken:
            self.report(0 if self.eccr_lost else 1 << 31)
        return super().fetch(address, size)

    def report(self, flags):
        self.eccr |= flags
        self.chip.nmi = True
        self.chip.clock.is_asked_to_stop = 1
        self.chip.touch()

    def expect_no_cache(self):
        """ES0430 2.2.2. The image runs from bank 1."""
        clocks = self.chip.clocks
        self.chip.expect(not self.two_banks or not clocks.acr & clocks.cache_on, "bank 2 of the flash was changed with the data cache on")

    def program(self, address, size, value):
        self.expect_no_cache()
        self.chip.expect(size == 4, f"the flash was written with {size} bytes at a time")
        if not address & 4:
            self.half = address, value
            return
        self.chip.expect(self.half is not None and self.half[0] == address - 4, "64 bits of the flash were not written as a whole")
        first, self.half, at = self.half, None, address - 4 - self.base
        if self.chip.power_lost or first is None:
            return
        self.chip.expect(self.cr & (self.lock | 1) == 1, "the flash was written without PG")
        self.chip.expect(self.memory[at : at + 8] == b"\xff" * 8, f"0x{address:08X} of the flash was programmed twice")
        self.operations += 1
        if self.is_cut():
            self.broken.add(address - 4)
            self.memory[at : at + 4] = (first[1] | 0x5A5A5A5A).to_bytes(4, "little")
        else:
            self.memory[at : at + 8] = first[1].to_bytes(4, "little") + value.to_bytes(4, "little")
        self.spend_ns(self.program_ns)

    def read(self, offset):
        return self.chip.clocks.read_acr() if offset == 0 else {0x10: self.sr, 0x14: self.cr, 0x18: self.eccr, 0x20: self.two_banks << 22}.get(offset, 0)

    def write(self, offset, value):
        if offset == 0x18:
            self.eccr &= ~(value & 0xF0000000)
        elif offset in (0, 8, 0x10, 0x14):
            super().write({0: 0, 8: 4, 0x10: 0xC, 0x14: 0x10}[offset], value)
        else:
            self.chip.expect(False, f"0x{offset:X} of the flash was written, which is not modelled")

    def poll(self):
        """3.3: PER, STRT, and the number of the page in its bank."""
        if self.cr & 0x10002 != 0x10002:
            return
        self.expect_no_cache()
        page = self.cr >> 3 & 0x7F
        size = 0x800 if self.two_banks else 0x1000
        address = 0x08000000 + page * size + (0x40000 if self.two_banks and self.cr >> 11 & 1 else 0)
        self.broken = {word for word in self.broken if not address <= word < address + size}
        self.erase(address, size)
