# SPDX-License-Identifier: MIT
"""Plays seeds on emulated Cortex-M and requires the hashes of this machine: the same bytes sent, the same replies."""

import shutil
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
# The code for each CPU, optimised differently, and the machine that runs it (a machine with Cortex-M3 runs the code for Cortex-M0+ too).
BUILDS = {"cortex-m0plus -Os": "mps2-an385", "cortex-m3 -O0": "mps2-an385", "cortex-m4 -O2": "mps2-an386"}
TIMEOUT_S = 600


def sources():
    left_out = {"main.c", "campaign.c", "directed.c", "orders.c", "orders_world.c"}
    return [
        *sorted((ROOT / "core/src").glob("*.c")),
        *sorted((ROOT / "app/sim/model/src").glob("*.c")),
        *(path for path in sorted((ROOT / "test/sim").glob("*.c")) if path.name not in left_out),
        ROOT / "test/target/arm/semihost.c",
    ]


def build(folder, cpu, level, first, count):
    program = folder / f"{cpu}.elf"
    flags = [
        f"-mcpu={cpu}",
        "-mthumb",
        "-mfloat-abi=soft",
        level,
        "-std=gnu11",
        "-w",
        "-fno-tree-loop-distribute-patterns",
        "-ffunction-sections",
        "-Wl,--gc-sections",
        f"-DSEED_FIRST={first}U",
        f"-DSEED_COUNT={count}U",
    ]
    include = [f"-I{ROOT / path}" for path in ("core/include", "core/src", "app/sim/model/include", "test/sim")]
    subprocess.run(
        ["arm-none-eabi-gcc", *flags, *include, "--specs=rdimon.specs", "-nostartfiles", f"-T{ROOT / 'test/sim/large.ld'}", *sources(), "-o", program],
        check=True,
    )
    return program


def emulate(machine, program):
    done = subprocess.run(
        [
            "qemu-system-arm",
            "-M",
            machine,
            "-nographic",
            "-monitor",
            "none",
            "-serial",
            "null",
            "-semihosting-config",
            "enable=on,target=native",
            "-kernel",
            program,
        ],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=TIMEOUT_S,
        check=False,
    )
    return [line for line in (done.stdout + done.stderr).splitlines() if line]


def compare(program, first, count):
    """Prints how many seeds agree; returns the exit status."""
    missing = [tool for tool in ("arm-none-eabi-gcc", "qemu-system-arm") if shutil.which(tool) is None]
    if missing:
        print(f"skip: {', '.join(missing)} missing (scripts/install_tools check brings it)\n0 passed, 0 failed, 1 skipped")
        return 77
    wanted = subprocess.run([program, "--hashes", "--first", str(first), "--count", str(count)], capture_output=True, text=True, check=True).stdout.splitlines()
    passed = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, machine in BUILDS.items():
            got = emulate(machine, build(Path(folder), *name.split(), first, count))
            wrong = [f"{ours} here, {theirs} there" for ours, theirs in zip(wanted, got, strict=False) if ours != theirs]
            good = not wrong and len(got) == len(wanted) == count
            passed, failed = passed + good, failed + (not good)
            print(
                f"{'ok' if good else 'FAILED':7} {name}: {len(got)} of {count} seeds played, {len(wrong)} differ",
                *wrong[:3],
                sep="\n    " if wrong else "",
                flush=True,
            )
    print(f"{passed} passed, {failed} failed, 0 skipped")
    return 1 if failed or not passed else 0
