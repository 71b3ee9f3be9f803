# SPDX-License-Identifier: MIT
"""The images of the four boards on an emulated Cortex-M: scenarios.py, gateway_scenarios.py. Long scenarios that are the same on all families run on the first
board only, unless IWHEEL_FULL is 1. It also checks the files next to each image, which flashing tools need.
"""

import functools
import gc
import re

import pytest
import verdict
from images import CPUS, WORK, must

pytest.importorskip("unicorn", reason="the Python package unicorn is missing in .venv (scripts/python_packages .venv requirements/check.txt)")
import beginnings
import emulate
import scenarios

pytestmark = [pytest.mark.exact, pytest.mark.limit(3000)]


def cases():
    """Scenarios with the same beginning are together, the largest group is first."""
    groups = {}
    for board, images in scenarios.BY_BOARD.items():
        for image, several in images.items():
            for scenario in several:
                groups.setdefault((board, image, scenarios.OSCILLATOR.get(scenario), beginnings.of(scenario)), []).append(scenario)
    for (board, image, *begins), several in sorted(groups.items(), key=lambda group: -len(group[1])):
        for scenario in several:
            long = [pytest.mark.full] if scenario in scenarios.LONG_ON.get(board, ()) else []
            marks = [pytest.mark.together(f"{board}-{image}.{several[0].__name__}"), *long]
            yield pytest.param(board, image, *begins, scenario, id=f"{board}-{image}.{scenario.__name__}", marks=marks)


@functools.cache
def begun(board, image, oscillator, beginning):
    """The rig after the common beginning of several scenarios."""
    emulate.load(WORK / "libmodel.so")
    gc.disable()  # Garbage collection costs a twentieth of the time, and finds little before the end.
    rig = emulate.Rig(WORK / f"images/{board}-{image}.elf", oscillator)
    beginnings.run(rig, beginning)
    return rig


@pytest.fixture
def findings():
    return verdict.Findings()


@pytest.mark.parametrize(("board", "image", "oscillator", "beginning", "scenario"), [*cases()])
def test_scenario(board, image, oscillator, beginning, scenario, findings):
    error, notes = beginnings.apart(emulate.judge, begun(board, image, oscillator, beginning), scenario) or ("it ended without a verdict", [])
    findings.figures += notes
    assert not error, error


@pytest.mark.parametrize("board", [*CPUS])
def test_elf_bin_and_hex_hold_the_same(board, tmp_path):
    elf = WORK / f"{board}/port/stm32_stub/iwheel_{board}.elf"
    binary, text = (elf.with_suffix(ending) for ending in (".bin", ".hex"))
    assert all(path.stat().st_mtime >= elf.stat().st_mtime for path in (binary, text))
    must(["arm-none-eabi-objcopy", "-I", "ihex", "-O", "binary", text, tmp_path / "back"])
    assert (tmp_path / "back").read_bytes() == binary.read_bytes()
    assert re.search(r"^:02000004(\w{4})", text.read_text(), re.MULTILINE)[1] == "0800", "the flash's first address"
    assert int.from_bytes(binary.read_bytes()[:4], "little") == 0x20000700, "the top of the stack"


@pytest.mark.parametrize("board", [*CPUS])
def test_handlers_wait_for_their_writes(board):
    """ES0430 2.1.3: a barrier in each interrupt handler, or in the function in which it ends. No emulator shows the fault that it prevents."""
    code = must(["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", WORK / f"images/{board}-gateway.elf"])
    functions = dict(re.findall(r"^\w{8} <(\w+)>:\n(.*?)(?=\n\n|\Z)", code, re.MULTILINE | re.DOTALL))

    def waits(name):
        ends_in = re.findall(r"\tb(?:\.[nw])?\t\w+ <(brd_\w+)>", functions[name])
        return "\tdsb" in functions[name] or any(waits(other) for other in ends_in if other != name)

    handlers = {name for name in functions if re.fullmatch(r"brd_\w+_handler", name)} - {"brd_reset_handler", "brd_nmi_handler"}
    assert len(handlers) >= 6, handlers
    assert all(map(waits, handlers)), [name for name in sorted(handlers) if not waits(name)]
