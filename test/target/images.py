# SPDX-License-Identifier: MIT
"""The images of every board, and how they are built."""

import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
WORK = ROOT / "build/target"
STM32 = ROOT / "port/stm32_stub"
MODELS = ("bxcan_model.c", "bxcan_model_receive.c", "fdcan_model.c", "block_hook.c")
CPUS = {"stm32f103": "cortex-m3", "stm32f407": "cortex-m4", "stm32f446": "cortex-m4", "stm32g474": "cortex-m4"}
CONFIGURED = ["-DIWHEEL_SETPOINT_TYPE=1", "-DIWHEEL_CURRENT_ROLE=limit", "-DIWHEEL_TRACK_MM=540"]
OPTIONS = {
    "listen": [],
    "zero": CONFIGURED,
    "demo": [*CONFIGURED, "-DIWHEEL_DEMO=ON"],
    "clock": [*CONFIGURED, "-DIWHEEL_CLOCK_INPUT=ON"],
    "usb": [*CONFIGURED, "-DIWHEEL_CAN_PINS=PA11"],
    "crystal": [*CONFIGURED, "-DIWHEEL_CRYSTAL_HZ=25000000"],
    "crystal12": [*CONFIGURED, "-DIWHEEL_CRYSTAL_HZ=12000000"],
    "gateway": [*CONFIGURED, "-DIWHEEL_GATEWAY=ON"],
    "gateway_slow": [*CONFIGURED, "-DIWHEEL_GATEWAY=ON", "-DIWHEEL_BAUD=115200"],
    "gateway_fast": [*CONFIGURED, "-DIWHEEL_GATEWAY=ON", "-DIWHEEL_BAUD=2000000"],
    "setpoint": ["-DIWHEEL_SETPOINT_TYPE=255", "-DIWHEEL_CURRENT_ROLE=setpoint", "-DIWHEEL_TRACK_MM=540"],
}
IMAGES = {
    "stm32f103": ("listen", "zero", "setpoint", "demo", "usb", "crystal12", "gateway", "gateway_slow", "gateway_fast"),
    "stm32f407": ("listen", "zero", "setpoint", "demo", "crystal", "gateway"),
    "stm32f446": ("zero", "clock", "demo", "gateway"),
    "stm32g474": ("listen", "zero", "setpoint", "demo", "crystal", "gateway"),
}


def missing():
    return [tool for tool in ("arm-none-eabi-gcc", "cmake", "gcc") if shutil.which(tool) is None]


def run(command, **options):
    return subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, **options, check=False)


def must(command):
    done = run(command)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{(done.stdout + done.stderr)[-3000:]}")
    return done.stdout


def configure(folder, cpu, options):
    toolchain = [f"-DCMAKE_TOOLCHAIN_FILE={ROOT / 'cmake/arm-none-eabi.cmake'}", "-DCMAKE_BUILD_TYPE=MinSizeRel", f"-DIWHEEL_ARM_CPU={cpu}"]
    return run(["cmake", "-S", ROOT, "-B", folder, "-UIWHEEL_*", *toolchain, *options])


def build_images():
    """BOARD-IMAGE.elf of all in WORK/images, the last of each board as it is flashed in WORK/BOARD, and the models of their bus controllers."""
    (WORK / "images").mkdir(parents=True, exist_ok=True)
    for board, several in IMAGES.items():
        for image in several:
            folder = WORK / board  # One after another: the libraries are the same, the options of the previous image are removed.
            done = configure(folder, CPUS[board], [f"-DIWHEEL_BOARD={board}", *OPTIONS[image]])
            if done.returncode != 0:
                raise RuntimeError(done.stderr)
            must(["cmake", "--build", folder, "-j2", "--target", f"iwheel_{board}"])
            shutil.copy(folder / f"port/stm32_stub/iwheel_{board}.elf", WORK / f"images/{board}-{image}.elf")
    # Without sanitizers: it is loaded into a Python that has none.
    must(["gcc", "-std=c11", "-O2", "-shared", "-fPIC", "-o", WORK / "libmodel.so", *(HERE / name for name in MODELS)])
