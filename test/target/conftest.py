# SPDX-License-Identifier: MIT
"""The STM32 port: the build options that it refuses (test_options.py), its images on an emulated CPU with two wheels on the bus (test_images.py,
test_emulate.py), its UART code on QEMU's STM32 (test_uart.py), and the core's unit tests on Cortex-M (test_unit.py). Its driver against a model of the
bus controller is among the unit tests (CMakeLists.txt). test_registers.py checks the emulator's reads in C. All that is built stays in build/target.
"""

import pytest
from images import build_images, missing


def pytest_collection_finish(session):
    """The images, for the tests that run them."""
    if not session.config.option.collectonly and not missing() and any(item.path.name in ("test_images.py", "test_faults.py") for item in session.items):
        build_images()


@pytest.fixture(autouse=True)
def tools():
    if missing():
        pytest.skip(f"{', '.join(missing())} missing (scripts/install_tools check brings it)")
