# SPDX-License-Identifier: MIT
"""The CPU and what is inside every Cortex-M (NVIC, SysTick, reset), in virtual time.

Time passes by executed code: two cycles for each 16 bits of it (block_hook.c), ACCESS_CYCLES for each access to a peripheral. Both
are on the slow side, so that a verdict about time is too. Interrupts all have one priority, as the image leaves them.
"""

import ctypes
import struct

from unicorn import (
    UC_ARCH_ARM,
    UC_ERR_FETCH_PROT,
    UC_ERR_FETCH_UNMAPPED,
    UC_ERR_OK,
    UC_ERR_READ_UNMAPPED,
    UC_ERR_WRITE_PROT,
    UC_ERR_WRITE_UNMAPPED,
    UC_HOOK_BLOCK,
    UC_HOOK_INTR,
    UC_MODE_MCLASS,
    UC_MODE_THUMB,
    UC_PROT_READ,
    Uc,
    UcError,
)
from unicorn import arm_const as arm
from unicorn.unicorn_py3.unicorn import MMIO_READ_CFUNC, MMIO_WRITE_CFUNC, uclib

from .block_clock import ENTERED, MASKED, READ_CFUNC, WRITE_CFUNC, BlockClock, Space, declare
from .boards import BLOCK_SIZE
from .chip import IWDGRSTF, PINRSTF, PORRSTF, SFTRSTF, US
from .registers import Registers

ACCESS_CYCLES = 12
EXC_RETURN = 0xFFFFFFF9
EXCEPTION_EXIT = 8  # Unicorn's number for a return from an exception.
ABORTS = (3, 4)  # And those for code and data where the memory map allows none.
NOWHERE = 0xFFFFFFFE
BACK, ENDLESS = 0x080F0000, 0x080F0100  # In the flash, beyond every image; ENDLESS is an instruction that jumps to itself.
SP, LR, PC, XPSR, PRIMASK = (getattr(arm, f"UC_ARM_REG_{name}") for name in ("SP", "LR", "PC", "XPSR", "PRIMASK"))
FRAME = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, LR, PC, XPSR)
IT_STATE = 0x0600FC00
NMI, HARD_FAULT, SYSTICK, IRQ = 2, 3, 15, 16
FLASH, SYSTEM = 0x08000000, 0xE000E000
IBUSERR, PRECISERR, STKERR = 1 << 8, 1 << 9 | 1 << 15, 1 << 12  # Bits of CFSR.
NO_MEMORY = (UC_ERR_READ_UNMAPPED, UC_ERR_WRITE_UNMAPPED, UC_ERR_WRITE_PROT, UC_ERR_FETCH_UNMAPPED, UC_ERR_FETCH_PROT)


class Machine:
    library = None  # Holds block_hook; set by the runner.
    SP, PC = SP, PC
    POISON = 0xA5  # Contents of RAM after power-on: anything but zero.

    def __init__(self, board, image, seed=1):
        self.board, self.image, self.now_ns = board, image, 0
        self.violations, self.resets, self.alarms = [], [], []
        self.nmi, self.frozen, self.power_lost = False, False, False
        self.faults = 0
        self.due_ns = self.quiet_until_ns = 0  # See run.
        self.build_cpu()
        board.build(self, seed)
        self.reset_cpu()

    def build_cpu(self):
        cpu = self.cpu = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        cpu.ctl_set_cpu_model(self.board.cpu_model)
        records = range(self.board.flash.base & ~0xFFF, self.board.flash.base + self.board.flash.size)  # map_flash has these.
        assert 0x08000000 + len(self.image) <= self.board.flash.base, "the image reaches into the stored records"
        cpu.mem_map(0x08000000, records.start - 0x08000000)
        cpu.mem_map(records.stop, 0x08100000 - records.stop)
        cpu.mem_map(0x20000000, self.board.ram_size)
        cpu.mem_write(0x08000000, self.image[: records.start - 0x08000000])  # Its end, texts and no code, may share a page with the records: map_flash.
        cpu.mem_write(ENDLESS, bytes((0xFE, 0xE7)))
        cpu.mem_write(0x20000000, bytes([self.POISON]) * self.board.ram_size)
        cpu.mem_map(self.board.unique_id_address & ~0xFFF, 0x1000, UC_PROT_READ)  # The manufacturer wrote it: the chip's own number.
        cpu.mem_write(self.board.unique_id_address, bytes(range(0x41, 0x4D)))
        self.frame, self.after_entry = Registers(cpu, *FRAME, SP, PRIMASK), Registers(cpu, SP, XPSR, LR, PC)
        self.pc, self.result = Registers(cpu, PC), Registers(cpu, *FRAME[:2])
        self.error, self.callbacks, self.until = None, [], NOWHERE
        declare(self.library)
        self.clock = BlockClock(ACCESS_CYCLES, self.board.ram_size, cpu, (*FRAME, SP, PRIMASK), (READ_CFUNC(self.on_read), WRITE_CFUNC(self.on_write)))
        self.clock_reference = ctypes.byref(self.clock)
        for base, size in (*self.board.spaces, (SYSTEM, 0x1000)):
            self.map_registers(base, size)
        for kind, function in ((UC_HOOK_BLOCK, self.library.block_hook), (UC_HOOK_INTR, self.library.trap_hook)):
            uclib.uc_hook_add(
                cpu._uch,
                ctypes.byref(ctypes.c_size_t()),
                ctypes.c_int(kind),
                ctypes.cast(function, ctypes.c_void_p),
                ctypes.byref(self.clock),
                ctypes.c_uint64(1),
                ctypes.c_uint64(0),
            )

    def expect(self, condition, text):
        if not condition and text not in self.violations:
            self.violations.append(text)

    # ---- time and code --------------------------------------------------------------------------------------------

    @property
    def busy_ns(self):
        """The time in which code ran."""
        return self.clock.busy_ns

    def spend(self, cycles):
        """Brings `now_ns` up to date with the code that has run, and `cycles` more."""
        self.library.block_clock_spend(self.clock_reference, cycles)
        self.now_ns = self.clock.now_ns

    def execute(self, until_ns):
        """Runs code until that time, a WFI, a trap, or something that may change which interrupts come."""
        clock = self.clock
        status = self.library.block_clock_execute(self.clock_reference, until_ns, self.until, self.icsr())
        self.now_ns = clock.now_ns
        if status in NO_MEMORY and self.error is None:
            self.hard_fault(IBUSERR if status in (UC_ERR_FETCH_UNMAPPED, UC_ERR_FETCH_PROT) else PRECISERR)
            return
        if status != UC_ERR_OK or self.error is not None:
            raise RuntimeError(f"the CPU faulted at 0x{clock.begun_at:08X}: {self.error or UcError(status)}") from self.error
        trap = clock.trap
        if trap == EXCEPTION_EXIT:
            self.leave_exception()
        elif trap in ABORTS:
            self.hard_fault(IBUSERR if trap == ABORTS[0] else PRECISERR)
        elif trap >= 0:
            raise RuntimeError(f"trap {trap} at 0x{self.pc.read()[0]:08X}")
        elif not clock.has_stopped:
            self.sleeping = True

    def hard_fault(self, cause):
        """An access where no memory is. Only the HardFault handler handles it. Without a stack the registers cannot be saved, and the handler begins
        nevertheless."""
        self.faults += 1
        self.cfsr |= cause
        self.active, self.sleeping = HARD_FAULT, False
        *values, stack, _ = self.frame.read()
        stack -= 32
        if self.is_stack(stack):
            self.cpu.mem_write(stack, struct.pack("<8I", *values))
        self.expect_vectors()
        self.after_entry.write(stack, values[7] & ~IT_STATE, EXC_RETURN, self.vector(HARD_FAULT))

    def at(self, time_ns, action):
        """Does something from outside at that time."""
        self.alarms.append((time_ns, action))
        self.alarms.sort(key=lambda alarm: alarm[0])

    def run(self, span_ns):
        """Everything but the CPU is attended to when something is due, and when code has touched it (`touch`): until then nothing about it
        can change."""
        end_ns = self.now_ns + span_ns
        self.touch()  # So may have who called this.
        while self.now_ns < end_ns:
            if self.now_ns >= self.quiet_until_ns:
                self.attend()
            next_ns = self.due_ns if self.due_ns < end_ns else end_ns
            if next_ns <= self.now_ns:
                next_ns = self.now_ns + 1
            if self.frozen or (self.sleeping and not self.pending):
                self.now_ns = self.clock.now_ns = next_ns
                continue
            self.sleeping = False
            if self.pending and not self.active and self.enter_exception():
                continue
            self.execute(self.now_ns + 1 if self.pending and not self.active else next_ns)

    def divert(self):
        """The main loop goes round on one spot from now on, while interrupts come and are served."""
        while self.active:
            self.run(US)
        self.cpu.reg_write(PRIMASK, 0)
        self.cpu.reg_write(PC, ENDLESS | 1)
        self.sleeping = False

    def call(self, address):
        """The 64-bit result of a function of the image without arguments, called now, with interrupts as in the main loop."""
        while self.active:  # Within a handler no interrupt would come, and what waits for one would wait for ever.
            self.run(US // 20)
        saved, asleep = self.cpu.context_save(), self.sleeping
        self.cpu.reg_write(PRIMASK, 0)
        self.cpu.reg_write(LR, BACK | 1)
        self.cpu.reg_write(PC, address | 1)
        self.until = BACK
        while self.pc.read()[0] != BACK:
            self.attend()
            if not self.enter_exception():
                self.execute(self.now_ns + 1 if self.pending and not self.active else self.due_ns)
        low, high = self.result.read()
        self.cpu.context_restore(saved)
        self.sleeping, self.until = asleep, NOWHERE
        return high << 32 | low

    def touch(self):
        """Something may have changed before its time."""
        self.quiet_until_ns = 0

    def look_ahead(self):
        """When the next event is due, and whether nothing can happen before. Not so while bytes pass between memory and line, which
        goes on with every cycle, nor while the bus or the clocks come to rest."""
        uart, due_ns = self.uart, self.bus.next_event_ns(self.now_ns)
        sent_ns = self.dma.next_event_ns()
        calm = self.clocks.settled and self.bus.calm and sent_ns is None
        came_ns = None
        if uart.typed or uart.idle_ns is not None:
            came_ns, calm = uart.next_event_ns(), False
        for time_ns in (self.tick_ns, self.watchdog.deadline_ns, came_ns, sent_ns):
            if time_ns is not None and time_ns < due_ns:
                due_ns = time_ns
        if self.alarms and self.alarms[0][0] < due_ns:
            due_ns = self.alarms[0][0]
        self.due_ns, self.quiet_until_ns = due_ns, due_ns if calm else 0

    def attend(self):
        """Everything but the CPU, up to now."""
        while self.alarms and self.alarms[0][0] <= self.now_ns:
            self.alarms.pop(0)[1]()
        if not self.clocks.settled:
            self.clocks.update(self.now_ns)
        self.bus.advance(self.now_ns)
        if self.uart.typed or self.uart.idle_ns is not None:
            self.uart.advance(self.now_ns)
        self.dma.advance(self.now_ns)
        if self.tick_ns is not None and self.now_ns >= self.tick_ns:
            self.count_tick()
        if self.port_a.changed or self.port_b.changed:
            self.look_at_pins()
        if self.watchdog.deadline_ns is not None and self.now_ns >= self.watchdog.deadline_ns:
            self.reset("watchdog", IWDGRSTF)
        if self.power_lost:
            if not self.ram_survives:
                self.cpu.mem_write(0x20000000, bytes([self.POISON]) * self.board.ram_size)
            self.flash.cut_after, self.flash.next_cut, self.power_lost = self.flash.next_cut, None, False
            self.reset("power", PORRSTF)
        if self.reset_requested:
            self.reset("software", SFTRSTF)
        if self.nmi:
            self.nmi = False
            self.pending.add(NMI)
        lines = self.board.interrupts(self) & self.enabled if self.enabled else 0
        while lines:
            irq = lines.bit_length() - 1
            lines ^= 1 << irq
            if IRQ + irq != self.active:
                self.pending.add(IRQ + irq)
        self.look_ahead()

    def look_at_pins(self):
        for name in self.board.ports:
            getattr(self, name).changed = False
        self.exti.poll(self.board.estop_level())
        self.lamp.watch(self)

    # ---- exceptions and reset -------------------------------------------------------------------------------------

    def enter_exception(self):
        if not self.pending or self.active:
            return False
        number = min(self.pending)
        entered = self.library.block_clock_enter(self.clock_reference, self.vector(number), number != NMI)
        if entered == MASKED:
            return False
        self.expect_vectors()
        self.pending.discard(number)
        self.active = number
        if entered == ENTERED:
            self.now_ns = self.clock.now_ns
        else:
            self.hard_fault(STKERR)
        return True

    def is_stack(self, address):
        """There is RAM for the eight registers."""
        return 0 <= address - 0x20000000 <= self.board.ram_size - 32

    def vector(self, number):
        """From the table that VTOR selects. Address 0 shows the image, or the boot loader that has started it."""
        return struct.unpack_from("<I", self.image, (self.vtor or FLASH) - FLASH + 4 * number)[0]

    def expect_vectors(self):
        self.expect(self.vtor or not self.is_started_by_boot_loader, "an exception went to the boot loader's handler")

    def leave_exception(self):
        status = self.library.block_clock_leave(self.clock_reference)
        if status != UC_ERR_OK:
            raise UcError(status)
        self.now_ns = self.clock.now_ns
        if self.active != SYSTICK:
            self.touch()  # Its line may still be up.
        self.active = None

    def reset_cpu(self):
        stack, start = struct.unpack_from("<II", self.image)
        self.cpu.reg_write(PRIMASK, 0)
        self.cpu.reg_write(SP, stack)
        self.cpu.reg_write(PC, start | 1)
        self.cpu.reg_write(XPSR, 0x01000000)
        self.pending, self.active, self.enabled, self.sleeping, self.reset_requested = set(), None, 0, False, False
        self.vtor = self.cfsr = 0
        self.is_started_by_boot_loader = False
        self.look_at_pins()
        self.syst = {0x10: 0, 0x14: 0, 0x18: 0}
        self.set_tick(None)

    def start_by_boot_loader(self):
        """As the chip's own one in its system memory does after "Go": its vectors stay at address 0, and it may leave interrupts masked."""
        self.reset("boot loader", PINRSTF)
        self.is_started_by_boot_loader = True
        self.cpu.reg_write(PRIMASK, 1)

    def reset(self, cause, flag):
        """RAM retains its contents; everything else restarts."""
        self.resets.append((self.now_ns, cause))
        self.clocks.flags |= flag
        self.frozen = False
        self.board.reset(self)
        self.reset_cpu()

    # ---- registers ------------------------------------------------------------------------------------------------

    def map_registers(self, base, size):
        """Reads that change nothing but the time are done by block_hook.c, which calls `on_read` for all others."""
        space = ctypes.pointer(Space(ctypes.pointer(self.clock), base))
        self.callbacks.append(space)
        read, write = (ctypes.cast(function, ctypes.c_void_p) for function in (self.library.block_clock_read, self.library.block_clock_write))
        status = uclib.uc_mmio_map(self.cpu._uch, base, size, read, space, write, space)
        if status != UC_ERR_OK:
            raise UcError(status)

    def on_read(self, now_ns, address, size):
        """What it raises ends the emulation."""
        self.now_ns = now_ns
        try:
            if size != 4:
                self.expect(False, f"0x{address:08X} was accessed with {size} bytes")
            read = self.read_system if address >= SYSTEM else self.board.read
            return read(address & -BLOCK_SIZE, address & BLOCK_SIZE - 1) & 0xFFFFFFFF
        except Exception as error:  # noqa: BLE001
            return self.fail(error)

    def on_write(self, now_ns, address, size, value):
        self.now_ns = now_ns
        try:
            if size != 4:
                self.expect(False, f"0x{address:08X} was accessed with {size} bytes")
            write = self.write_system if address >= SYSTEM else self.board.write
            write(address & -BLOCK_SIZE, address & BLOCK_SIZE - 1, value)
        except Exception as error:  # noqa: BLE001
            self.fail(error)

    def fail(self, error):
        self.error = self.error or error
        uclib.uc_emu_stop(self.cpu._uch)
        return 0

    def map_flash(self, flash):
        """The pages of the flash that the image writes. The rest of the first one's page of the emulator's has the end of the image, if it is
        that long: it can be read, but not executed."""
        base = flash.base & ~0xFFF
        before = self.image[base - 0x08000000 :].ljust(flash.base - base, b"\xff")

        def fetch(address, size):
            if address >= flash.base:
                return flash.fetch(address, size)
            return int.from_bytes(before[address - base : address - base + size], "little")

        def guard(function, *arguments):
            self.now_ns = self.clock.now_ns
            try:
                return function(*arguments)
            except Exception as error:  # noqa: BLE001
                return self.fail(error)

        callbacks = (
            MMIO_READ_CFUNC(lambda _, offset, size, __: guard(fetch, base + offset, size)),
            MMIO_WRITE_CFUNC(lambda _, offset, size, value, __: guard(flash.program, base + offset, size, value) or 0),
        )
        self.callbacks += callbacks
        status = uclib.uc_mmio_map(
            self.cpu._uch, base, flash.base + flash.size - base, *(pair for function in callbacks for pair in (ctypes.cast(function, ctypes.c_void_p), 0))
        )
        if status != UC_ERR_OK:
            raise UcError(status)

    def lose_power(self, ram_survives=False):
        """From the next instruction on; then it comes back. In a short brown-out RAM often survives."""
        self.power_lost, self.ram_survives = True, ram_survives
        self.clock.is_asked_to_stop = 1
        self.touch()

    def tick_span_ns(self):
        return (self.syst[0x14] + 1) * 10**9 // self.clocks.core_hz

    def set_tick(self, tick_ns):
        self.tick_ns = tick_ns
        self.clock.tick_ns, self.clock.tick_load = -1 if tick_ns is None else tick_ns, self.syst[0x14]

    def count_tick(self):
        """The tick that is due, before its interrupt."""
        if self.tick_ns is not None and self.now_ns >= self.tick_ns:
            self.clock.is_asked_to_stop = 1
            self.pending.add(SYSTICK)
            self.clock.icsr = self.icsr()
            self.set_tick(self.tick_ns + self.tick_span_ns())

    def icsr(self):
        """PENDSTSET, VECTACTIVE."""
        return (SYSTICK in self.pending) << 26 | (self.active or 0)

    def read_system(self, block, offset):
        offset += block - SYSTEM
        self.count_tick()
        if offset == 0x18 and self.tick_ns is not None:
            return min((self.tick_ns - self.now_ns) * self.clocks.core_hz // 10**9, self.syst[0x14])
        if offset == 0xD04:
            return self.icsr()
        if offset == 0xD28:
            return self.cfsr
        self.expect(offset in self.syst, f"0x{SYSTEM + offset:08X} was read, which is not modelled")
        return self.syst.get(offset, 0)

    def write_system(self, block, offset, value):
        offset += block - SYSTEM
        self.clock.is_asked_to_stop = 1
        self.touch()
        if offset in self.syst:
            self.syst[offset] = value
            self.set_tick(self.now_ns + self.tick_span_ns() if self.syst[0x10] & 1 else None)
        elif offset in (0x100, 0x104):
            self.enabled |= value << 8 * (offset - 0x100)
        elif offset == 0xD08:
            self.expect(not value & 0xFF, "VTOR is not aligned to the size of the table")
            self.vtor = value
        elif offset == 0xD0C:
            self.reset_requested = value >> 16 == 0x05FA and bool(value & 4)
        else:
            self.expect(False, f"0x{SYSTEM + offset:08X} was written, which is not modelled")
