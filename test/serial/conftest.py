# SPDX-License-Identifier: MIT
"""The relay to a board, judged from the bus log like the system tests, during faults of cable, relay, board and clients.

test_wires.py: the board is the image's own code on this machine (board.c). test_image.py: only shipped code, the real image on an emulated CPU with
its UART on a pseudo terminal; IWHEEL_BOARD=stm32f407 or stm32f446 selects another board's image. Needs arm-none-eabi-gcc and the Python package unicorn.
"""

import importlib.machinery
import os
from pathlib import Path

import pytest
from harness import SERVICE_NICE
from rig import SerialRig

ROOT = Path(__file__).resolve().parent.parent.parent


def pytest_configure(config):
    config.witness_nice = SERVICE_NICE


@pytest.fixture
def rig_type():
    return SerialRig


def pytest_collection_finish(session):
    """Builds the image as for flashing; environment variables pass it to the tests."""
    if session.config.option.collectonly or not any(item.path.name == "test_image.py" for item in session.items):
        return
    emulate = importlib.machinery.SourceFileLoader("emulate", str(ROOT / "app/demo/emulate")).load_module()
    folder, board = ROOT / "build/serial_image", os.environ.setdefault("IWHEEL_BOARD", "stm32f103")
    folder.mkdir(parents=True, exist_ok=True)
    emulate.build(board, "gateway", folder)
    os.environ["IWHEEL_IMAGE"] = str(folder / f"{board}-gateway/port/stm32_stub/iwheel_{board}.bin")
    os.environ["IWHEEL_MODEL"] = str(folder / "libmodel.so")
