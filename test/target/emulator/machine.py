# SPDX-License-Identifier: MIT
"""The CPU and what is inside every Cortex-M (NVIC, SysTick, reset), in virtual time.

Time passes by executed code: two cycles for each 16 bits of it (block_hook.c), ACCESS_CYCLES for each access to a peripheral. Both
are on the slow side, so that a verdict about time is too. Interrupts all have one priority, as the image leaves them.
"""
import ctypes
import struct

from unicorn import UC_ARCH_ARM, UC_HOOK_BLOCK, UC_HOOK_INTR, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, UcError
from unicorn import arm_const as arm
from unicorn.unicorn_py3.unicorn import uclib

from .boards import BLOCK_SIZE
from .chip import SFTRSTF, IWDGRSTF

ACCESS_CYCLES = 12
EXC_RETURN = 0xFFFFFFF9
EXCEPTION_EXIT = 8 # Unicorn's number for a return from an exception.
NOWHERE = 0xFFFFFFFE
FRAME = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR,
         arm.UC_ARM_REG_PC, arm.UC_ARM_REG_XPSR)
IT_STATE = 0x0600FC00
NMI, SYSTICK, IRQ = 2, 15, 16


class BlockClock(ctypes.Structure):
    """As in block_hook.c."""
    _fields_ = [("left", ctypes.c_int64), ("spent", ctypes.c_int64), ("is_asked_to_stop", ctypes.c_int32),
                ("has_stopped", ctypes.c_int32), ("stop", ctypes.c_void_p)]


class Machine:
    library = None # Holds block_hook; set by the runner.
    POISON = 0xA5  # What RAM is full of after power-on: anything but zero.

    def __init__(self, board, image, seed=1):
        self.board, self.image, self.now_ns = board, image, 0
        self.violations, self.resets, self.alarms = [], [], []
        self.nmi, self.frozen = False, False
        self.busy_ns = 0
        self.build_cpu()
        board.build(self, seed)
        self.reset_cpu()

    def build_cpu(self):
        cpu = self.cpu = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        cpu.ctl_set_cpu_model(self.board.cpu_model)
        cpu.mem_map(0x08000000, 0x100000)
        cpu.mem_map(0x20000000, 0x20000)
        cpu.mem_write(0x08000000, self.image)
        cpu.mem_write(0x20000000, bytes([self.POISON]) * 0x20000)
        cpu.mmio_map(0x40000000, 0x30000, self.on_read, 0x40000000, self.on_write, 0x40000000)
        cpu.mmio_map(0xE000E000, 0x1000, self.on_read, 0xE000E000, self.on_write, 0xE000E000)
        self.clock = BlockClock(stop=ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p).value)
        hook, function = ctypes.c_size_t(), ctypes.cast(self.library.block_hook, ctypes.c_void_p)
        uclib.uc_hook_add(cpu._uch, ctypes.byref(hook), ctypes.c_int(UC_HOOK_BLOCK), function, ctypes.byref(self.clock),
                          ctypes.c_uint64(1), ctypes.c_uint64(0))
        cpu.hook_add(UC_HOOK_INTR, self.on_interrupt)

    def expect(self, condition, text):
        if not condition and text not in self.violations:
            self.violations.append(text)

    # ---- time and code --------------------------------------------------------------------------------------------

    def spend(self, cycles=0):
        """Brings `now_ns` up to date with the code that has run, and `cycles` more."""
        span_ns = (self.clock.spent + cycles) * 10**9 // self.clocks.core_hz
        self.clock.left -= cycles
        self.clock.spent = 0
        self.now_ns += span_ns
        self.busy_ns += span_ns

    def on_interrupt(self, cpu, number, _):
        self.trap = number
        cpu.emu_stop()

    def execute(self, until_ns):
        """Runs code until that time, a WFI, a trap, or something that may change which interrupts come."""
        clock, self.trap = self.clock, None
        clock.left = max((until_ns - self.now_ns) * self.clocks.core_hz // 10**9, 1)
        clock.is_asked_to_stop = clock.has_stopped = 0
        pc = self.cpu.reg_read(arm.UC_ARM_REG_PC)
        try:
            self.cpu.emu_start(pc | 1, NOWHERE)
        except UcError as error:
            raise RuntimeError(f"the CPU faulted at 0x{pc:08X}: {error}") from error
        self.spend()
        if self.trap == EXCEPTION_EXIT:
            self.leave_exception()
        elif self.trap is not None:
            raise RuntimeError(f"trap {self.trap} at 0x{self.cpu.reg_read(arm.UC_ARM_REG_PC):08X}")
        elif not clock.has_stopped:
            self.sleeping = True

    def at(self, time_ns, action):
        """Does something from outside at that time."""
        self.alarms.append((time_ns, action))
        self.alarms.sort(key=lambda alarm: alarm[0])

    def run(self, span_ns):
        end_ns = self.now_ns + span_ns
        while self.now_ns < end_ns:
            self.attend()
            next_ns = max(min(end_ns, self.next_event_ns()), self.now_ns + 1)
            if self.frozen or self.sleeping and not self.pending:
                self.now_ns = next_ns
                continue
            self.sleeping = False
            if self.enter_exception():
                continue
            self.execute(self.now_ns + 1 if self.pending else next_ns)

    def next_event_ns(self):
        times = [self.tick_ns, self.watchdog.deadline_ns, self.bus.next_event_ns(self.now_ns)]
        times += [self.alarms[0][0]] if self.alarms else []
        return min(time for time in times if time is not None)

    def attend(self):
        """Everything but the CPU, up to now."""
        while self.alarms and self.alarms[0][0] <= self.now_ns:
            self.alarms.pop(0)[1]()
        if not self.clocks.settled:
            self.clocks.update(self.now_ns)
        self.bus.advance(self.now_ns)
        if self.tick_ns is not None and self.now_ns >= self.tick_ns:
            self.pending.add(SYSTICK)
            self.tick_ns += self.tick_span_ns()
        if self.port_a.changed:
            self.look_at_pins()
        if self.watchdog.deadline_ns is not None and self.now_ns >= self.watchdog.deadline_ns:
            self.reset("watchdog", IWDGRSTF)
        if self.reset_requested:
            self.reset("software", SFTRSTF)
        if self.nmi:
            self.nmi = False
            self.pending.add(NMI)
        for irq in self.board.interrupts(self):
            if self.enabled >> irq & 1 and IRQ + irq != self.active:
                self.pending.add(IRQ + irq)

    def look_at_pins(self):
        self.port_a.changed = False
        self.exti.look(self.port_a.level(0))
        self.lamp.look(self)

    # ---- exceptions and reset -------------------------------------------------------------------------------------

    def enter_exception(self):
        if not self.pending or self.active or self.cpu.reg_read(arm.UC_ARM_REG_PRIMASK) and NMI not in self.pending:
            return False
        number = min(self.pending)
        self.pending.discard(number)
        self.active = number
        stack = self.cpu.reg_read(arm.UC_ARM_REG_SP)
        aligned = stack & 4
        stack -= 32 + aligned
        values = list(self.cpu.reg_read_batch(FRAME))
        values[7] = values[7] & ~0x200 | (0x200 if aligned else 0)
        self.cpu.mem_write(stack, struct.pack("<8I", *values))
        self.cpu.reg_write(arm.UC_ARM_REG_SP, stack)
        self.cpu.reg_write(arm.UC_ARM_REG_XPSR, values[7] & ~IT_STATE) # A handler does not begin within an IT block.
        self.cpu.reg_write(arm.UC_ARM_REG_LR, EXC_RETURN)
        vector = struct.unpack("<I", self.cpu.mem_read(0x08000000 + 4 * number, 4))[0]
        self.cpu.reg_write(arm.UC_ARM_REG_PC, vector)
        self.spend(12)
        return True

    def leave_exception(self):
        stack = self.cpu.reg_read(arm.UC_ARM_REG_SP)
        values = struct.unpack("<8I", self.cpu.mem_read(stack, 32))
        self.cpu.reg_write(arm.UC_ARM_REG_SP, stack + 32 + (4 if values[7] & 0x200 else 0))
        for register, value in zip(FRAME, values):
            self.cpu.reg_write(register, value & ~0x200 if register == arm.UC_ARM_REG_XPSR else value)
        self.active = None
        self.spend(12)

    def reset_cpu(self):
        stack, start = struct.unpack("<II", self.cpu.mem_read(0x08000000, 8))
        self.cpu.reg_write(arm.UC_ARM_REG_PRIMASK, 0)
        self.cpu.reg_write(arm.UC_ARM_REG_SP, stack)
        self.cpu.reg_write(arm.UC_ARM_REG_PC, start | 1)
        self.pending, self.active, self.enabled, self.sleeping, self.reset_requested = set(), None, 0, False, False
        self.look_at_pins()
        self.tick_ns, self.syst = None, {0x10: 0, 0x14: 0, 0x18: 0}

    def reset(self, cause, flag):
        """RAM keeps its contents; everything else begins anew."""
        self.resets.append((self.now_ns, cause))
        self.clocks.flags |= flag
        self.frozen = False
        self.board.reset(self)
        self.reset_cpu()

    # ---- registers ------------------------------------------------------------------------------------------------

    def on_read(self, _, offset, size, base):
        self.spend(ACCESS_CYCLES)
        address = base + offset
        self.expect(size == 4, f"0x{address:08X} was read with {size} bytes")
        if base == 0xE000E000:
            return self.read_system(offset)
        return self.board.read(self, address & ~(BLOCK_SIZE - 1), address & (BLOCK_SIZE - 1)) & 0xFFFFFFFF

    def on_write(self, _, offset, size, value, base):
        self.spend(ACCESS_CYCLES)
        address = base + offset
        self.expect(size == 4, f"0x{address:08X} was written with {size} bytes")
        if base == 0xE000E000:
            self.write_system(offset, value)
        else:
            self.board.write(self, address & ~(BLOCK_SIZE - 1), address & (BLOCK_SIZE - 1), value)

    def tick_span_ns(self):
        return (self.syst[0x14] + 1) * 10**9 // self.clocks.core_hz

    def read_system(self, offset):
        if offset == 0x18 and self.tick_ns is not None:
            left = (self.tick_ns - self.now_ns) * self.clocks.core_hz // 10**9
            if left < 0: # The tick is due; code has not been told yet.
                self.clock.is_asked_to_stop = 1
                self.pending.add(SYSTICK)
                self.tick_ns += self.tick_span_ns()
                left = self.syst[0x14]
            return min(left, self.syst[0x14])
        self.expect(offset in self.syst, f"0x{0xE000E000 + offset:08X} was read, which is not modelled")
        return self.syst.get(offset, 0)

    def write_system(self, offset, value):
        self.clock.is_asked_to_stop = 1
        if offset in self.syst:
            self.syst[offset] = value
            self.tick_ns = self.now_ns + self.tick_span_ns() if self.syst[0x10] & 1 else None
        elif offset == 0x100:
            self.enabled |= value
        elif offset == 0xD0C:
            self.reset_requested = value >> 16 == 0x05FA and bool(value & 4)
        else:
            self.expect(False, f"0x{0xE000E000 + offset:08X} was written, which is not modelled")
