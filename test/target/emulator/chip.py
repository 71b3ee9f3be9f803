# SPDX-License-Identifier: MIT
"""Peripherals of STM32F103 and STM32F405/407/446, as far as the port touches them: clocks, flash, ports, EXTI, watchdog.

What the reference manual forbids is written into `violations`: access to a block whose clock is off, a PLL changed while it runs,
a bus clock beyond its limit, too few wait states. What is not modelled cannot be accessed.
"""

US = 1000  # Times are nanoseconds.
MS = 1000 * US

HSION, HSIRDY, HSEON, HSERDY, HSEBYP, CSSON, PLLON, PLLRDY = (1 << bit for bit in (0, 1, 16, 17, 18, 19, 24, 25))
CANRST = 1 << 25
PORRSTF, PINRSTF, SFTRSTF, IWDGRSTF, RMVF = (1 << bit for bit in (27, 26, 28, 29, 24))


class Clocks:
    """RCC and FLASH_ACR. A crystal needs `start_ns` after HSEON, the PLL 200 us. `is_clock`: no crystal but a clock is on the
    oscillator's input, which asks for HSEBYP; a crystal does not run with it."""

    crystal_hz = 8_000_000
    start_ns = 2 * MS
    is_clock = False

    def __init__(self, chip):
        self.chip, self.flags, self.crystal_present = chip, PORRSTF | PINRSTF, True
        self.reset()

    def reset(self):
        self.cr, self.cfgr, self.acr = 0x83, 0, self.acr_reset
        self.pllcfgr = 0x24003010
        self.enable, self.acr_is_read = {}, False
        self.hse_ready_ns = self.pll_ready_ns = None
        self.crystal_failed, self.settled = False, False
        self.set_core_hz(self.internal_hz)

    def set_crystal(self, present):
        self.crystal_present, self.settled = present, False

    def update(self, now_ns):
        """What has become ready, and whether the crystal has failed (which the clock security system reports by NMI)."""
        crystal = self.crystal_present and self.is_clock == bool(self.cr & HSEBYP)
        if self.cr & HSEON and crystal and self.hse_ready_ns is None:
            self.hse_ready_ns = now_ns + self.start_ns
        if not self.cr & HSEON or not crystal:
            self.hse_ready_ns = None
        hse = self.hse_ready_ns is not None and now_ns >= self.hse_ready_ns
        if self.cr & HSERDY and not hse and self.cr & CSSON:
            self.chip.nmi = self.crystal_failed = True
            self.cr &= ~(HSEON | CSSON | PLLON)
        source_ready = hse if self.pll_from_hse() else True
        if self.cr & PLLON and source_ready and self.pll_ready_ns is None:
            self.pll_ready_ns = now_ns + 200 * US
        if not self.cr & PLLON or not source_ready:
            self.pll_ready_ns = None
        pll = self.pll_ready_ns is not None and now_ns >= self.pll_ready_ns
        self.cr = self.cr & ~(HSERDY | PLLRDY) | (HSERDY if hse else 0) | (PLLRDY if pll else 0)
        self.settled = all(ready_ns is None or now_ns >= ready_ns for ready_ns in (self.hse_ready_ns, self.pll_ready_ns))
        switched = self.cfgr & 3
        if (switched == 2 and not pll) or (switched == 1 and not hse):
            switched = 0
        self.cfgr = self.cfgr & ~0xC | switched << 2
        self.set_core_hz((self.internal_hz, self.crystal_hz, self.pll_hz() if switched == 2 else 0)[switched])

    def set_core_hz(self, core_hz):
        assert core_hz > 0, "the core has no clock"
        self.core_hz = self.chip.clock.core_hz = core_hz

    def runs_from_crystal(self):
        """The core runs on the PLL, and the PLL on the crystal."""
        return bool(self.cfgr >> 2 & 3) and self.pll_from_hse()

    def read(self, offset, now_ns):
        if not self.settled:
            self.update(now_ns)
        if offset == 0:
            return self.cr
        if offset == self.csr_offset:
            return self.flags
        if offset == self.cfgr_offset:
            return self.cfgr
        return self.pllcfgr if offset == self.pllcfgr_offset else self.enable.get(offset, 0)

    def write(self, offset, value, now_ns):
        if offset == 0:
            self.expect(not (value ^ self.cr) & HSEBYP or not self.cr & HSEON, "HSEBYP was changed while HSE is on")
            self.cr = self.cr & (HSERDY | PLLRDY | HSIRDY) | value & ~(HSERDY | PLLRDY)
        elif offset == self.csr_offset:
            self.flags = 0 if value & RMVF else self.flags
        elif offset == self.cfgr_offset:
            self.expect(self.acr_is_read or value & 3 != 2, "the wait states were not read back before the clock rises")
            self.write_cfgr(value)
        elif offset == self.pllcfgr_offset:
            self.expect(not self.cr & PLLON, "the PLL was changed while it runs")
            self.pllcfgr = value
        elif offset == self.apb1_reset_offset:
            self.expect(not value & ~CANRST, "another device than the bus controller was reset")
            self.enable[offset] = value
            if value & CANRST:
                self.chip.bus.chip_vanishes()
                self.chip.can.reset()
        else:
            self.enable[offset] = value
        self.update(now_ns)
        if self.cfgr & 3 == 2:
            self.check_limits()

    def write_acr(self, value):
        """FLASH_ACR. RM0008 3.3.3: prefetch changes only up to 24 MHz; RM0090 3.9.1: the data cache is reset only while it is off."""
        self.expect(not (value ^ self.acr) & self.prefetch or self.core_hz <= self.prefetch_max_hz, "prefetch was changed at a fast clock")
        self.expect(not value & self.cache_reset or not value & self.cache_on, "the data cache was reset while it is on")
        self.acr = value & ~self.acr_without
        self.acr_is_read = not self.must_read_acr
        self.check_limits()

    def read_acr(self):
        self.acr_is_read = True
        return self.acr

    def write_cfgr(self, value):
        if (value ^ self.cfgr) & self.pll_bits:
            self.expect(not self.cr & PLLON, "the PLL was changed while it runs")
        self.cfgr = self.cfgr & 0xC | value & ~0xC

    def expect(self, condition, text):
        self.chip.expect(condition, text)

    def is_enabled(self, offset, bit):
        return bool(self.enable.get(offset, 0) >> bit & 1)


class ClocksF1(Clocks):
    internal_hz, csr_offset, cfgr_offset, pllcfgr_offset, acr_reset = 8_000_000, 0x24, 0x04, None, 0x30
    apb1_reset_offset = 0x10
    pll_bits = 0x3F0000
    prefetch, prefetch_max_hz, cache_on, cache_reset, acr_without, must_read_acr = 1 << 4, 24_000_000, 0, 0, 1 << 5, False

    def pll_from_hse(self):
        return bool(self.cfgr >> 16 & 1)

    def pll_hz(self):
        source = self.crystal_hz // (2 if self.cfgr >> 17 & 1 else 1) if self.pll_from_hse() else self.internal_hz // 2
        return source * min((self.cfgr >> 18 & 0xF) + 2, 16)

    def apb1_hz(self):
        return self.core_hz // (1, 1, 1, 1, 2, 4, 8, 16)[self.cfgr >> 8 & 7]

    def check_limits(self):
        self.expect(self.core_hz <= 72_000_000, f"the core runs at {self.core_hz} Hz")
        self.expect(self.apb1_hz() <= 36_000_000, f"APB1 runs at {self.apb1_hz()} Hz")
        self.expect((self.acr & 7) >= (self.core_hz - 1) // 24_000_000, "too few wait states of the flash")


class ClocksF4(Clocks):
    internal_hz, csr_offset, cfgr_offset, pllcfgr_offset, acr_reset = 16_000_000, 0x74, 0x08, 0x04, 0
    apb1_reset_offset = 0x20
    pll_bits = 0
    core_max_hz, apb1_max_hz, apb2_max_hz = 168_000_000, 42_000_000, 84_000_000
    reserved, reserved_value = 0xF << 28, 2 << 28  # Reserved bits of PLLCFGR, unchanged since reset.
    prefetch, prefetch_max_hz, cache_on, cache_reset, acr_without = 1 << 8, 1 << 40, 1 << 10, 1 << 12, 0x1800
    must_read_acr = True  # RM0090 3.5.1
    may_prefetch = False  # ES0182: revision A does not support it, and its identifier is wrong too.

    def pll_from_hse(self):
        return bool(self.pllcfgr >> 22 & 1)

    def pll_hz(self):
        m, n, p = self.pllcfgr & 0x3F, self.pllcfgr >> 6 & 0x1FF, (self.pllcfgr >> 16 & 3) * 2 + 2
        source = self.crystal_hz if self.pll_from_hse() else self.internal_hz
        self.expect(1_000_000 <= source / m <= 2_000_000, "the PLL's input is not 1 to 2 MHz")
        self.expect(192_000_000 <= source / m * n <= 432_000_000, "the PLL runs outside its limits")
        self.expect(source / m * n / (self.pllcfgr >> 24 & 0xF) <= 48_000_000, "the PLL's 48 MHz output is too fast")
        self.expect(self.pllcfgr & self.reserved == self.reserved_value, "reserved bits of PLLCFGR were changed")
        self.expect((self.pllcfgr >> 28 & 7) >= 2, "PLLR below 2 is not allowed")
        return source * n // m // p

    def apb1_hz(self):
        return self.core_hz // (1, 1, 1, 1, 2, 4, 8, 16)[self.cfgr >> 10 & 7]

    def apb2_hz(self):
        return self.core_hz // (1, 1, 1, 1, 2, 4, 8, 16)[self.cfgr >> 13 & 7]

    def check_limits(self):
        self.expect(self.core_hz <= self.core_max_hz, f"the core runs at {self.core_hz} Hz")
        self.expect(self.apb1_hz() <= self.apb1_max_hz, f"APB1 runs at {self.apb1_hz()} Hz")
        self.expect(self.apb2_hz() <= self.apb2_max_hz, f"APB2 runs at {self.apb2_hz()} Hz")
        self.expect((self.acr & 0xF) >= (self.core_hz - 1) // 30_000_000, "too few wait states of the flash")
        self.expect(self.may_prefetch or not self.acr & self.prefetch, "prefetch is on, which revision A of an F407 cannot")


class ClocksF446(ClocksF4):
    """Without overdrive. PLLR is bits 28 to 30 here."""

    core_max_hz, apb1_max_hz, apb2_max_hz = 168_000_000, 45_000_000, 90_000_000
    reserved, reserved_value = 1 << 31, 0
    may_prefetch = True


class Port:
    """`outside` maps a pin to the level that drives it; a pin without is open. `cached`: the input register in block_hook.c."""

    def __init__(self, cached):
        self.outside, self.changed, self.cached = {}, True, cached
        self.reset()

    def drive(self, pin, level):
        self.outside[pin], self.changed = level, True
        self.forget()

    def release(self, pin):
        self.outside.pop(pin, None)
        self.changed = True
        self.forget()

    def forget(self):
        """A level may have changed."""
        self.levels, self.cached.is_known = None, 0

    def input(self):
        """The levels of all pins; cached until one changes."""
        if self.levels is None:
            self.levels = sum(self.level(pin) << pin for pin in range(16))
        return self.levels


class PortF1(Port):
    input_offset = 8

    def reset(self):
        self.changed = True
        self.forget()
        self.cr, self.odr = [0x44444444, 0x44444444], 0

    def field(self, pin):
        return self.cr[pin // 8] >> 4 * (pin % 8) & 0xF

    def level(self, pin):
        """An open pin without a pull-up is read as low: the worst for a contact to ground."""
        if self.field(pin) & 3:
            return self.odr >> pin & 1
        if pin in self.outside:
            return self.outside[pin]
        return self.odr >> pin & 1 if self.field(pin) == 8 else 0

    def is_output(self, pin):
        return self.field(pin) in (1, 2, 3)

    def is_pair(self, rx, tx, _):
        """Received and transmitted by a device; an output of 2 MHz is too slow for the bus, and enough for a serial port."""
        return self.field(rx) in (4, 8) and self.field(tx) in (9, 11)

    def read(self, offset):
        if offset in (0, 4):
            return self.cr[offset // 4]
        return self.input() if offset == self.input_offset else self.odr if offset == 0xC else 0

    def write(self, offset, value):
        """True if that may have changed a level."""
        if offset == 0x10 and (self.odr & ~(value >> 16) | value & 0xFFFF) == self.odr:
            return False
        self.forget()
        if offset in (0, 4):
            self.cr[offset // 4] = value
        elif offset == 0x10:
            self.odr = self.odr & ~(value >> 16) | value & 0xFFFF
        elif offset == 0xC:
            self.odr = value & 0xFFFF
        else:
            raise KeyError(offset)
        return True


class PortF4(Port):
    input_offset = 0x10

    def reset(self):
        self.changed = True
        self.forget()
        self.registers = dict.fromkeys(range(0, 0x28, 4), 0)
        self.registers[0] = 0xA8000000

    def two(self, offset, pin):
        return self.registers[offset] >> 2 * pin & 3

    def level(self, pin):
        if self.two(0, pin) == 1:
            return self.registers[0x14] >> pin & 1
        if pin in self.outside:
            return self.outside[pin]
        return 1 if self.two(0xC, pin) == 1 else 0

    def is_output(self, pin):
        return self.two(0, pin) == 1

    def is_pair(self, rx, tx, wanted):
        """Received and transmitted by a device with that alternate function, at more than the lowest output speed."""
        function = [self.registers[0x20 + 4 * (pin // 8)] >> 4 * (pin % 8) & 0xF for pin in (rx, tx)]
        return self.two(0, rx) == 2 and self.two(0, tx) == 2 and function == [wanted, wanted] and self.two(8, tx) != 0

    def read(self, offset):
        return self.input() if offset == self.input_offset else self.registers[offset]

    def write(self, offset, value):
        """True if that may have changed a level."""
        if offset == 0x18:
            offset, value = 0x14, self.registers[0x14] & ~(value >> 16) | value & 0xFFFF
        if self.registers[offset] == value:
            return False
        self.registers[offset] = value
        self.forget()
        return True


class Exti:
    """Line 0 only. The selection (AFIO or SYSCFG) names its port: port A after reset."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.registers = dict.fromkeys((0, 4, 8, 0xC, 0x10, 0x14), 0)
        self.selection, self.last = 0, None

    def poll(self, level):
        if self.last is not None and level != self.last and self.registers[0x8 if level else 0xC] & 1:
            self.registers[0x14] |= 1
        self.last = level

    def line(self):
        return bool(self.registers[0x14] & self.registers[0] & 1)

    def select(self, selection):
        self.selection, self.last = selection, None

    def write(self, offset, value):
        if offset == 0x14:
            self.registers[offset] &= ~value
        else:
            self.registers[offset] = value


class Uart:
    """USART2 with a peer. `sent`: the bytes from the chip; `send` passes bytes to the chip. Bytes pass one by one through DR, or through the DMA;
    what the DMA carries is brought up to date at each access.

    The transmitter has DR and a shift register: a byte that is written leaves DR when the one before it has left. TC is set when both are empty
    and stays set until code clears it (RM0008 27.6.1): the DMA does not. A reset cuts the bytes that are not whole on the line."""

    baud = 115200

    def __init__(self, chip):
        self.chip, self.sent, self.typed = chip, bytearray(), bytearray()
        self.reset()

    def reset(self):
        self.brr = self.cr1 = self.cr3 = 0
        whole_from = getattr(self, "free_ns", 0) - self.chip.now_ns
        if whole_from > 0:
            del self.sent[-whole_from // self.byte_ns() :]
        self.free_ns = self.came_ns = 0  # The transmitter is free; the next byte from outside is there.
        self.clear_ns = None  # TC was cleared then; None: it is set.
        self.is_full = False  # A received byte is in DR, because the DMA has not read it.
        self.idle_ns, self.flags, self.noisy, self.said_sr = None, 0, 0, False

    def send(self, text):
        if not self.typed:
            self.came_ns = max(self.came_ns, self.chip.now_ns + self.byte_ns())
        self.typed += text

    def disturb(self):
        """The next byte from outside is damaged, and the chip sees noise."""
        self.noisy += 1

    def byte_ns(self):
        return 10 * 10**9 // self.baud

    def is_complete(self, at_ns):
        """TC. The DMA must be up to date."""
        if self.clear_ns is not None and self.clear_ns < self.free_ns <= at_ns:
            self.clear_ns = None
        return self.clear_ns is None

    def transmit(self, bytes_, at_ns):
        """Bytes that go to DR one after another from that time on, each as soon as it is empty."""
        self.is_complete(at_ns)
        self.sent += bytes_
        self.free_ns = max(self.free_ns, at_ns) + len(bytes_) * self.byte_ns()

    def by_dma(self):
        return self.cr3 & 0x40 and self.cr1 & 0x2004 == 0x2004

    def check_line(self):
        rate = self.chip.clocks.apb1_hz() / max(self.brr, 1)
        self.chip.expect(abs(rate / self.baud - 1) < 0.02, f"the serial port runs at {rate:.0f} baud, not {self.baud}")
        self.chip.expect(self.brr >= 16, "the serial port's clock is below 16 times its rate")
        self.chip.expect(self.cr1 & 0x2008 == 0x2008, "the serial port's transmitter is off")
        self.chip.expect(self.chip.board.uart_is_connected(), "the serial port is not on its pins")

    def advance(self, now_ns):
        """Bytes from outside go to memory, and a pause after them is seen."""
        while self.typed and self.by_dma() and self.came_ns <= now_ns:
            byte = self.typed.pop(0)
            if self.noisy:
                self.noisy, byte, self.flags = self.noisy - 1, byte ^ 0x55, self.flags | 4
            if not self.chip.dma.receive.put(byte):
                self.flags, self.is_full = self.flags | 8 * self.is_full, True
            self.idle_ns = self.came_ns + self.byte_ns()
            self.came_ns += self.byte_ns()
        if self.idle_ns is not None and self.idle_ns <= now_ns and not self.typed:
            self.idle_ns, self.flags = None, self.flags | 0x10

    def next_event_ns(self):
        """When something comes that may raise an interrupt."""
        if self.typed and self.by_dma():
            return self.came_ns + (min(len(self.typed), self.chip.dma.receive.until_event()) - 1) * self.byte_ns()
        return self.idle_ns

    def line(self):
        return bool((self.flags & 0x10 and self.cr1 & 0x10) or (self.flags & 0xE and self.cr3 & 1))

    def read(self, offset):
        now_ns = self.chip.now_ns
        self.advance(now_ns)
        self.chip.dma.advance(now_ns)
        received = self.typed and self.cr1 & 4 and not self.by_dma() and now_ns >= self.came_ns
        if offset == 0:
            self.said_sr = True
            empty = now_ns >= self.free_ns - self.byte_ns()
            return self.flags | 0x80 * empty | 0x40 * self.is_complete(now_ns) | (0x20 if received else 0)
        if offset == 4 and received:
            self.came_ns = now_ns + self.byte_ns()
            return self.typed.pop(0)
        if offset == 4:
            self.flags = 0 if self.said_sr else self.flags
            self.said_sr = self.is_full = False
        return {8: self.brr, 0xC: self.cr1, 0x14: self.cr3}.get(offset, 0)

    def write(self, offset, value):
        now_ns = self.chip.now_ns
        if offset == 4:
            self.check_line()
            self.chip.expect(now_ns >= self.free_ns - self.byte_ns(), "a character was overwritten")
            self.transmit(bytes((value & 0xFF,)), now_ns)
            self.clear_ns = now_ns if self.said_sr else self.clear_ns
        elif offset == 0:
            if not value & 0x40:
                self.chip.dma.advance(now_ns)
                self.is_complete(now_ns)
                self.clear_ns = now_ns
        elif offset == 8:
            self.brr = value
        elif offset == 0xC:
            self.cr1 = value
        elif offset == 0x14:
            self.cr3 = value


class DmaChannel:
    """What both families have in common. Subclasses name their registers and bits."""

    def __init__(self, chip):
        self.chip = chip
        self.registers = dict.fromkeys(self.offsets, 0)
        self.left = self.length = 0
        self.half = self.end = self.error = False

    def control(self):
        return self.registers["control"]

    def is_on(self):
        return bool(self.control() & 1)

    def data_register(self):
        return 0x40004404

    def begin(self):
        self.left = self.length = self.registers["count"]
        self.begun_ns = self.chip.now_ns
        self.chip.expect(self.registers["peripheral"] == self.data_register(), "the DMA does not serve the USART's data register")
        self.chip.expect(
            self.registers["memory"] >= 0x20000000 and self.registers["memory"] + self.length <= 0x20000000 + self.chip.board.ram_size,
            "the DMA reaches where no RAM is",
        )

    def put(self, byte):
        if not self.is_on() or not self.left:
            return False  # The byte stays in the data register, and the next one is an overrun.
        self.chip.cpu.mem_write(self.registers["memory"] + self.length - self.left, bytes((byte,)))
        self.left -= 1
        self.half |= self.left == self.length // 2
        if self.left == 0:
            self.finish()
        if self.left == 0 and self.control() & self.CIRCULAR:  # RM0008 13.3.3, RM0090 10.3.9: else the channel serves no further request.
            self.left = self.length
        return True

    def until_event(self):
        return max(self.left - self.length // 2 if self.left > self.length // 2 else self.left, 1)

    def next_move_ns(self):
        """DR is empty."""
        return max(self.begun_ns, self.chip.uart.free_ns - self.chip.uart.byte_ns())

    def carry(self, now_ns):
        """From memory to DR."""
        uart = self.chip.uart
        while self.left and self.is_on():
            move_ns = self.next_move_ns()
            if move_ns > now_ns:
                break
            count = min(self.left, (now_ns - move_ns) // uart.byte_ns() + 1)
            uart.transmit(self.chip.cpu.mem_read(self.registers["memory"] + self.length - self.left, count), move_ns)
            self.left -= count
            if self.left == 0:
                self.finish()

    def fail(self):
        """A bus error: RM0008 13.3.4, RM0090 10.3.18: TEIF is set, and the hardware disables the channel."""
        self.error = True
        self.registers["control"] &= ~1
        self.chip.touch()

    def finish(self):
        self.end = True

    def next_event_ns(self):
        if not self.left or not self.is_on():
            return None
        return self.next_move_ns() + max(self.left - 2, 0) * self.chip.uart.byte_ns()

    def line(self):
        return bool((self.half and self.control() & self.HALF) or (self.end and self.control() & self.END) or (self.error and self.control() & self.ERROR))


class ChannelF1(DmaChannel):
    offsets = ("control", "count", "peripheral", "memory")
    HALF, END, ERROR, FROM_MEMORY, CIRCULAR, WANTED = 4, 2, 8, 0x10, 0x20, 0x80


class StreamF4(DmaChannel):
    offsets = ("control", "count", "peripheral", "memory", "memory1", "fifo")
    HALF, END, ERROR, FROM_MEMORY, CIRCULAR, WANTED = 8, 0x10, 4, 0x40, 0x100, 4 << 25 | 0x400

    def finish(self):
        self.end = True
        if not self.control() & self.CIRCULAR:
            self.registers["control"] &= ~1


class Dma:
    """DMA1, as far as the port touches it: one channel from the USART, one to it."""

    def __init__(self, chip):
        self.chip = chip
        self.reset()

    def reset(self):
        self.receive, self.transmit = channels = self.kind(self.chip), self.kind(self.chip)
        both = zip(channels, self.bases, strict=True)
        self.places = {base + 4 * index: (channel, name) for channel, base in both for index, name in enumerate(channel.offsets)}

    def advance(self, now_ns):
        if self.transmit.left:
            self.transmit.carry(now_ns)

    def next_event_ns(self):
        return self.transmit.next_event_ns() if self.transmit.left else None

    def find(self, offset):
        return self.places.get(offset & ~3, (None, None))

    def read(self, offset):
        self.chip.uart.advance(self.chip.now_ns)
        self.advance(self.chip.now_ns)
        channel, name = self.find(offset)
        if channel is None:
            self.chip.expect(False, f"0x{offset:X} of the DMA was read, which is not modelled")
            return 0
        return channel.left if name == "count" else channel.registers[name]

    def write(self, offset, value):
        if offset == self.clear_offset:
            for channel, bit in zip((self.receive, self.transmit), self.bits, strict=True):
                channel.half &= not value >> bit[0] & 1
                channel.end &= not value >> bit[1] & 1
                channel.error &= not value >> bit[2] & 1
            return
        channel, name = self.find(offset)
        if channel is None:
            self.chip.expect(False, f"0x{offset:X} of the DMA was written, which is not modelled")
            return
        was_on = channel.is_on()
        self.chip.expect(name == "control" or not was_on, "a channel of the DMA was changed while it runs")
        channel.registers[name] = value
        if name == "count":
            channel.left = value
        if name == "control" and value & 1 and not was_on:
            flags = channel.end or channel.half or channel.error
            self.chip.expect(not flags or self.kind is ChannelF1, "a stream was enabled with the flags of its last run")
            self.chip.expect(value & channel.WANTED == channel.WANTED, f"a channel of the DMA is not set up for a serial port: {value:#x}")
            self.chip.expect(bool(value & channel.FROM_MEMORY) == (channel is self.transmit), "a channel of the DMA works the wrong way round")
            channel.begin()
            if channel is self.transmit:
                self.chip.uart.check_line()
                self.chip.expect(self.chip.uart.cr3 & 0x80, "the serial port does not ask the DMA for bytes to send")


class DmaF1(Dma):
    kind, bases, clear_offset, bits = ChannelF1, (0x6C, 0x80), 4, ((22, 21, 23), (26, 25, 27))


class DmaF4(Dma):
    kind, bases, clear_offset, bits = StreamF4, (0x88, 0xA0), 0xC, ((10, 11, 9), (20, 21, 19))


class Flash:
    """Pages that the image may erase and program, by the registers of the flash interface. The CPU stops during an operation.

    `cut_after`: power fails during the operation of that number from now on, which gets half of its bits through; `next_cut` is the
    same for the time after the next power-on."""

    word_bytes = 4  # Size of a word of the store.

    def __init__(self, chip):
        self.chip, self.memory = chip, bytearray(b"\xff" * self.size)
        self.operations, self.erasures, self.cut_after, self.next_cut = 0, 0, None, None
        self.reset()

    def reset(self):
        self.sr, self.cr, self.ar, self.keys = 0, self.lock, 0, []

    def fetch(self, address, size):
        at = address - self.base
        return int.from_bytes(self.memory[at : at + size], "little")

    def spend_ns(self, span_ns):
        self.chip.spend(span_ns * self.chip.clocks.core_hz // 10**9)

    def is_cut(self):
        if self.cut_after is None:
            return False
        self.cut_after -= 1
        if self.cut_after < 0:
            self.chip.lose_power()
        return self.cut_after < 0

    def program(self, address, size, value):
        chip, at = self.chip, address - self.base
        if chip.power_lost:
            return
        chip.expect(self.cr & (self.lock | 1) == 1, "the flash was written without PG")
        chip.expect(size == self.unit, f"the flash was written with {size} bytes at a time")
        old = self.fetch(address, size)
        chip.expect(old == (1 << 8 * size) - 1, f"0x{address:08X} of the flash was programmed twice")
        self.operations += 1
        cut = self.is_cut()
        self.memory[at : at + size] = (old & (value | (0x5A5A5A5A if cut else 0)) & (1 << 8 * size) - 1).to_bytes(size, "little")
        self.spend_ns(self.program_ns)

    def erase(self, address, size):
        if self.chip.power_lost:
            return
        at = address - self.base
        self.chip.expect(0 <= at < self.size, f"0x{address:08X} of the flash was erased, which is outside the stored records")
        self.operations, self.erasures = self.operations + 1, self.erasures + 1
        deadline_ns = self.chip.watchdog.deadline_ns
        cut = self.is_cut() or (deadline_ns is not None and deadline_ns < self.chip.now_ns + self.erase_ns)
        self.memory[at : at + size] = bytes(old | 0xA5 for old in self.memory[at : at + size]) if cut else b"\xff" * size
        self.spend_ns(self.erase_ns)

    def read(self, offset):
        return self.chip.clocks.read_acr() if offset == 0 else {0xC: self.sr, 0x10: self.cr, 0x14: self.ar}.get(offset, 0)

    def write(self, offset, value):
        if offset == 0:
            self.chip.clocks.write_acr(value)
        elif offset == 4:
            self.keys = ([*self.keys, value])[-2:]
            self.cr &= ~self.lock if self.keys == [0x45670123, 0xCDEF89AB] else ~0
        elif offset == 0xC:
            self.sr &= ~value
        elif offset == 0x10 and not self.cr & self.lock:
            self.cr = value
            self.keys = []
            self.poll()
        elif offset == 0x14:
            self.ar = value


class FlashF1(Flash):
    """The last two KiB of 64. Slow at the most that the data sheet allows."""

    base, size, lock, unit, program_ns, erase_ns = 0x0800F800, 0x800, 1 << 7, 2, 70 * US, 40 * MS

    def poll(self):
        if self.cr & 0x42 == 0x42:
            self.erase(self.ar & ~0x3FF, 0x400)


class FlashF4(Flash):
    """Sectors 4 and 5."""

    base, size, lock, unit, program_ns, erase_ns = 0x08010000, 0x30000, 1 << 31, 4, 100 * US, 2000 * MS

    def read(self, offset):
        """OPTCR: as delivered; WDG_SW is 0 if the hardware starts the watchdog."""
        return 0x0FFFAAED & ~(0x20 * self.chip.watchdog.by_hardware) if offset == 0x14 else super().read(offset)

    def poll(self):
        sector = self.cr >> 3 & 0xF
        if self.cr & 0x10002 == 0x10002:
            self.chip.expect(self.cr >> 8 & 3 == 2, "the flash is not set to work with 32 bits")
            self.erase({4: 0x08010000, 5: 0x08020000}.get(sector, 0), 0x10000 * (sector - 3))


class Watchdog:
    """IWDG. Prescaler and reload take 5 cycles of its oscillator; SR shows it, and a write meanwhile is lost. `by_hardware`: an option byte starts it at
    each reset."""

    by_hardware = False

    def __init__(self, chip, lsi_hz):
        self.chip, self.lsi_hz = chip, lsi_hz
        self.reset()

    def reset(self):
        self.prescaler, self.reload, self.unlocked, self.deadline_ns, self.busy_until_ns = 0, 0xFFF, False, None, {4: 0, 8: 0}
        if self.by_hardware:
            self.deadline_ns = self.chip.now_ns + self.timeout_ns()

    def timeout_ns(self):
        return (self.reload + 1) * (4 << self.prescaler) * 10**9 // self.lsi_hz

    def read(self, offset, now_ns):
        status = (now_ns < self.busy_until_ns[4]) | (now_ns < self.busy_until_ns[8]) << 1
        return {4: self.prescaler, 8: self.reload, 0xC: status}.get(offset, 0)

    def write(self, offset, value, now_ns):
        if offset == 0:
            self.unlocked = value == 0x5555
            if value == 0xCCCC or (value == 0xAAAA and self.deadline_ns is not None):
                self.deadline_ns = now_ns + self.timeout_ns()
        elif self.unlocked and offset in self.busy_until_ns:
            self.chip.expect(now_ns >= self.busy_until_ns[offset], "a register of the watchdog was written during its update")
            self.busy_until_ns[offset] = now_ns + 5 * 10**9 // self.lsi_hz
            if offset == 4:
                self.prescaler = value & 7
            elif offset == 8:
                self.reload = value & 0xFFF
