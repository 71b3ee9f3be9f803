# SPDX-License-Identifier: MIT
"""Counts the instructions of functions of a bare Cortex-M program, on an emulated CPU."""

import bisect
import subprocess
from collections import Counter
from pathlib import Path

from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn import arm_const as arm

BASE = 0x10000
MEMORY = 0x40000
STACK = BASE + MEMORY - 16
RETURN_ADDRESS = BASE + MEMORY - 4  # Return address of the outermost function.
MODELS = {"cortex-m0plus": arm.UC_CPU_ARM_CORTEX_M0, "cortex-m4": arm.UC_CPU_ARM_CORTEX_M4}
FLAGS = ["-mthumb", "-mfloat-abi=soft", "-Os", "-std=c99", "-ffunction-sections", "-fdata-sections", "-fno-common"]
FREESTANDING = ("-ffreestanding",)  # The options of the core.


def compile_clang(out, cpu, sources, includes, more):
    """Builds objects with clang and the C library's headers of the GNU compiler."""
    system = subprocess.run(["arm-none-eabi-gcc", "-print-sysroot"], capture_output=True, text=True, check=True).stdout.strip()
    objects = []
    for source in map(Path, sources):
        objects.append(out.with_name(f"{out.stem}-{source.stem}.o"))
        subprocess.run(
            [
                "clang",
                "--target=arm-none-eabi",
                f"-mcpu={cpu}",
                *FLAGS,
                *more,
                f"-isystem{system}/include",
                "-isystem/usr/include/newlib",
                *[f"-I{path}" for path in includes],
                "-c",
                str(source),
                "-o",
                str(objects[-1]),
            ],
            check=True,
        )
    return objects


def build(out, cpu, sources, includes, entries, more=FREESTANDING, compiler="gcc"):
    """Links a program without start-up code; `entries` are retained."""
    retain = [f"-Wl,-u,{entry}" for entry in entries]
    if compiler == "clang":
        sources = compile_clang(out, cpu, sources, includes, more)
    command = [
        "arm-none-eabi-gcc",
        f"-mcpu={cpu}",
        *FLAGS,
        *more,
        *[f"-I{path}" for path in includes],
        *map(str, sources),
        "-nostartfiles",
        "--specs=nano.specs",
        f"-Wl,-Ttext={BASE:#x}",
        "-Wl,-N",
        "-Wl,--gc-sections",
        f"-Wl,-e,{entries[0]}",
        *retain,
        "-o",
        str(out),
    ]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    return out


def text_size(elf, prefixes=("iw_", "read_", "bench_linked_", "left_ids", "lengths", "iwheel_")):
    """Bytes of code and constants of the linked functions whose names begin with this."""
    run = subprocess.run(["arm-none-eabi-nm", "-S", str(elf)], capture_output=True, text=True, check=True)
    rows = [line.split() for line in run.stdout.splitlines()]
    return sum(int(row[1], 16) for row in rows if len(row) == 4 and row[2] in "tTrR" and row[3].startswith(prefixes))


class Program:
    def __init__(self, elf, cpu):
        binary = elf.with_suffix(".bin")
        subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", str(elf), str(binary)], check=True)
        nm = subprocess.run(["arm-none-eabi-nm", str(elf)], capture_output=True, text=True, check=True)
        self.address = {line.split()[-1]: int(line.split()[0], 16) for line in nm.stdout.splitlines() if len(line.split()) == 3}
        self.cpu = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.cpu.ctl_set_cpu_model(MODELS[cpu])
        self.cpu.mem_map(BASE, MEMORY)
        self.cpu.mem_write(BASE, binary.read_bytes())
        self.functions = sorted((address & ~1, name) for name, address in self.address.items() if not name.startswith("$"))
        self.executed = 0
        self.at = Counter()  # instructions executed, by address
        self.cpu.hook_add(UC_HOOK_CODE, self._count)

    def _count(self, _, address, *__):
        self.executed += 1
        self.at[address] += 1

    def call(self, name, argument=0):
        """(its result, the number of instructions)"""
        self.cpu.reg_write(arm.UC_ARM_REG_SP, STACK)
        self.cpu.reg_write(arm.UC_ARM_REG_R0, argument)
        self.cpu.reg_write(arm.UC_ARM_REG_LR, RETURN_ADDRESS | 1)
        before = self.executed
        self.cpu.emu_start(self.address[name] | 1, RETURN_ADDRESS)
        return self.cpu.reg_read(arm.UC_ARM_REG_R0), self.executed - before

    def profile(self, name):
        """{function: its own instructions} of one call."""
        self.at.clear()
        self.call(name)
        own = Counter()
        for address, count in self.at.items():
            own[self.functions[bisect.bisect_right(self.functions, (address, "\x7f")) - 1][1]] += count
        return own
