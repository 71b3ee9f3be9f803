# SPDX-License-Identifier: MIT
"""Runs the core's unit tests on emulated Cortex-M0+, M3 and M4 (qemu-system-arm, semihosting).

Runs the tests of test/unit/CMakeLists.txt that need nothing but the core, Unity and test/support. qemu has no Cortex-M0+; its
Cortex-M0 runs the same instruction set. A test that does not fit the 16 KiB of RAM of that machine is listed, and runs elsewhere.
The few slowest, which sweep every value, run on Cortex-M0+ only, the least of the three, unless IWHEEL_FULL is 1 (./check --full).
"""

import functools
import shutil
from pathlib import Path

import pytest
from core_tests import SUPPORT, WARNINGS, core_tests, count_unity, unity_folder
from images import ROOT, WORK, must, run

CPUS = {"cortex-m0plus": "microbit", "cortex-m3": "mps2-an385", "cortex-m4": "mps2-an386"}
QEMU = "qemu-system-arm -nographic -monitor none -serial null -semihosting-config enable=on,target=native -M"
CACHE = [shutil.which("ccache")] if shutil.which("ccache") else []
SLOWEST = ("gateway_core_walk", "bit_timing", "codec_sweep", "envelope_scheduler")  # 5 to 20 s each; all others together need less.


class Builder:
    def __init__(self, cpu, unity):
        self.flags = [
            f"-mcpu={cpu}",
            "-mthumb",
            "-mfloat-abi=soft",
            "-O2",
            "-ffunction-sections",
            "-fdata-sections",
            f"-I{ROOT / 'core/include'}",
            f"-I{SUPPORT}",
            f"-I{unity}",
            "-DUNITY_SUPPORT_64",
        ]
        self.folder, self.compiled = WORK / "unit" / cpu, {}
        self.folder.mkdir(parents=True, exist_ok=True)
        self.common = [self.compile(path, ["-std=c99", "-ffreestanding"]) for path in sorted((ROOT / "core/src").glob("*.c"))]
        self.common.append(self.compile(Path(unity) / "unity.c", ["-w"]))
        self.common.append(self.compile(ROOT / "test/target/arm/semihost.c", ["-std=c11", "-fno-tree-loop-distribute-patterns"]))

    def compile(self, path, more=("-std=gnu11",)):
        """The object, which several tests may share."""
        if path not in self.compiled:
            self.compiled[path] = self.folder / f"{path.stem}.o"
            must([*CACHE, "arm-none-eabi-gcc", *self.flags, *WARNINGS, *more, "-c", path, "-o", self.compiled[path]])
        return self.compiled[path]

    def link(self, name, sources):
        """The program, or None if it does not fit."""
        out, flags = self.folder / f"{name}.elf", [*self.flags, "--specs=rdimon.specs", "-nostartfiles", "-Wl,--gc-sections"]
        objects = [self.compile(path) for path in sources]
        done = run(["arm-none-eabi-gcc", *flags, f"-T{ROOT / 'test/target/arm/semihost.ld'}", *objects, *self.common, "-o", out])
        small = "overflowed" in done.stderr or "less than 4 KiB" in done.stderr
        assert done.returncode == 0 or small, done.stderr
        return out if done.returncode == 0 else None


builder = functools.cache(Builder)


def cases():
    for cpu in CPUS:
        for name in sorted(core_tests(), key=lambda name: name not in SLOWEST):
            marks = [pytest.mark.together(cpu), *([pytest.mark.full] if name in SLOWEST and cpu != "cortex-m0plus" else [])]
            yield pytest.param(cpu, name, marks=marks)


@pytest.mark.exact
@pytest.mark.skipif(shutil.which("qemu-system-arm") is None, reason="qemu-system-arm is missing (scripts/install_tools check brings it)")
@pytest.mark.parametrize(("cpu", "name"), [*cases()])
def test_unit(cpu, name, record_property):
    program = builder(cpu, unity_folder()).link(name, core_tests()[name])
    if program is None:
        print("does not fit 16 KiB of RAM")  # Nothing is missing here: it runs on other machines.
    record_property("tests", count_unity(run([*QEMU.split(), CPUS[cpu], "-kernel", program], timeout=3000)) if program else 0)
