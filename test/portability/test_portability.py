# SPDX-License-Identifier: MIT
"""The core behaves identically on other machines, with other compilers and with any optimisation.

  native   this machine: the reference for the others
  aarch64  64 bits, unsigned char
  armhf    32 bits, unsigned char
  s390x    64 bits, big-endian

On each machine the simulation (test/sim) plays the same seeds, compiled by gcc and by clang, with -O0 and with -Os: the hash of all bytes
sent and all answers must be identical. On each machine but this one the core's unit tests must pass too. test/target and
test/sim/run --arm cover Cortex-M0+, M3 and M4. qemu-user emulates the foreign machines. -k MACHINE: only this machine.
"""

import fcntl
import functools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest
from core_tests import SUPPORT, WARNINGS, core_tests, count_unity, unity_folder

ROOT = Path(__file__).resolve().parent.parent.parent
WORK = ROOT / "build/portability"
# Triplet of the cross compiler, and qemu's name of the machine. The first is native.
MACHINES = {"native": (None, None), "aarch64": ("aarch64-linux-gnu", "aarch64"), "armhf": ("arm-linux-gnueabihf", "arm"), "s390x": ("s390x-linux-gnu", "s390x")}
SEED_FIRST, SEED_COUNT = 1, 8
FULL = os.environ.get("IWHEEL_FULL") == "1"
SLOW = ("gateway_core_walk", "bit_timing", "codec_sweep", "gate_scheduler")  # These run with gcc only.
pytestmark = [pytest.mark.exact, pytest.mark.limit(3000)]
TIMEOUT_S = 3000  # In real time: the process may get little processor time.
CACHE = [shutil.which("ccache")] if shutil.which("ccache") else []


def run(command, **options):
    return subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, **options, check=False)


def must(command):
    done = run(command)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{(done.stdout + done.stderr)[-2000:]}")


class Build:
    """The core and its tests, for one machine, by one compiler, with one optimisation level."""

    def __init__(self, machine, compiler, level, work=WORK, core=ROOT / "core"):
        self.level, self.source = level, core
        self.folder, self.compiled = work / f"{machine}-{compiler}{level}", set()
        self.folder.mkdir(parents=True, exist_ok=True)
        triplet, qemu = MACHINES[machine]
        if compiler == "clang":
            self.command = ["clang", *([f"--target={triplet}"] if triplet else [])]
        else:
            self.command = [f"{triplet}-gcc" if triplet else "gcc"]
        self.emulator = [f"qemu-{qemu}-static"] if qemu else []
        tools = [self.command[0], *self.emulator, *([f"{triplet}-gcc"] if triplet else [])]  # clang needs the cross libraries too.
        self.missing = [tool for tool in dict.fromkeys(tools) if shutil.which(tool) is None]

    def compile(self, path, *flags):
        """Returns the object file. Several tests share it."""
        out = self.folder / f"{'-'.join(path.parts[-4:])}.o"  # Several files have the same name.
        if out in self.compiled:
            return out
        self.compiled.add(out)
        must([*CACHE, *self.command, self.level, "-ffunction-sections", f"-I{self.source / 'include'}", *flags, "-c", path, "-o", out])
        return out

    @functools.cached_property
    def core(self):
        return [self.compile(path, "-std=c99", "-ffreestanding", *WARNINGS) for path in sorted((self.source / "src").glob("*.c"))]

    def link(self, name, objects):
        out = self.folder / name
        must([*self.command, "-static", "-Wl,--gc-sections", *objects, "-o", out])
        return out

    def hashes(self):
        """Returns the hash of each seed's simulation."""
        model = sorted((ROOT / "app/sim/model/src").glob("*.c"))
        simulation = [
            path for path in sorted((ROOT / "test/sim").glob("*.c")) if path.name not in ("main.c", "campaign.c", "directed.c", "orders.c", "orders_world.c")
        ]
        include = [f"-I{path}" for path in (self.source / "src", ROOT / "app/sim/model/include", ROOT / "test/sim")]
        seeds = [f"-DSEED_FIRST={SEED_FIRST}U", f"-DSEED_COUNT={SEED_COUNT}U"]
        objects = [self.compile(path, "-std=gnu11", "-w", *include, *seeds) for path in (*model, *simulation)]
        done = run([*self.emulator, self.link("hashes", [*self.core, *objects])], timeout=TIMEOUT_S)
        return done.stdout.split("\n")[:-1] if done.returncode == 0 else [f"status {done.returncode}", done.stderr[-500:]]

    def unit_test(self, name, unity):
        """Returns the number of single tests that passed."""
        flags = [f"-I{SUPPORT}", f"-I{unity}", "-DUNITY_SUPPORT_64"]
        objects = [self.compile(path, "-std=gnu11", "-w", *flags) for path in core_tests()[name]]
        common = [*self.core, self.compile(Path(unity) / "unity.c", "-w", "-DUNITY_SUPPORT_64")]
        return count_unity(run([*self.emulator, self.link(name, [*common, *objects])], timeout=TIMEOUT_S))


def seeded_core(work):
    """Returns a core that reads words in the native byte order of the machine; the comparison must detect it."""
    core = work / "core"
    shutil.copytree(ROOT / "core", core)
    text = (core / "src/be.h").read_text()
    right = "((uint32_t)bytes[0] << 24) | ((uint32_t)bytes[1] << 16) | ((uint32_t)bytes[2] << 8) | bytes[3]"
    wrong = "__extension__({ uint32_t word; __builtin_memcpy(&word, bytes, 4); __builtin_bswap32(word); })"
    assert right in text, f"be.h has no text {right!r} any more: update the seeded fault"
    (core / "src/be.h").write_text(text.replace(right, wrong))
    return core


@functools.cache
def built(*names):
    """Returns the one build that all tests of a group share."""
    build = Build(*names)
    if build.missing:
        pytest.skip(f"{', '.join(build.missing)} missing (scripts/install_tools check brings it)")
    return build


@pytest.fixture(scope="module")
def reference():
    """Returns the hashes of this machine; the first process that needs them calculates them for all."""
    with open(Path(tempfile.gettempdir()) / "iwheel-reference", "a+", encoding="ascii") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        hashes = file.read().splitlines() or built("native", "gcc", "-O0").hashes()
        if file.tell() == 0:
            file.writelines(f"{line}\n" for line in hashes)
    assert len(hashes) == SEED_COUNT and "hash" in hashes[0], hashes
    return hashes


BUILDS = [(machine, compiler, level) for machine in MACHINES for compiler in ("gcc", "clang") for level in ("-O0", "-Os")]


def together(several):
    return [pytest.param(*one, marks=pytest.mark.together(" ".join(one[:3]))) for one in several]


def unit_tests():
    """Two builds of each foreign machine; without IWHEEL_FULL four of these six."""
    for machine, compiler, level in BUILDS[4:]:
        if (compiler, level) == ("gcc", "-Os") or ((compiler, level) == ("clang", "-O0") and (FULL or machine == "s390x")):
            yield from ((machine, compiler, level, name) for name in sorted(core_tests()) if name not in SLOW or compiler == "gcc")


@pytest.mark.parametrize(("machine", "compiler", "level"), together(BUILDS))
def test_same_bytes(machine, compiler, level, reference):
    assert built(machine, compiler, level).hashes() == reference


@pytest.mark.parametrize(("machine", "compiler", "level", "name"), together(unit_tests()))
def test_unit(machine, compiler, level, name, record_property):
    record_property("tests", built(machine, compiler, level).unit_test(name, unity_folder()))


def test_seeded_core_with_native_byte_order_is_detected(tmp_path, reference):
    build = Build("s390x", "gcc", "-Os", tmp_path, seeded_core(tmp_path))
    if build.missing:
        pytest.skip(f"{', '.join(build.missing)} missing (scripts/install_tools check brings it)")
    hashes = build.hashes()
    assert "hash" in hashes[0] and hashes != reference
