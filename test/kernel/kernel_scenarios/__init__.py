# SPDX-License-Identifier: MIT
"""All tests on a real kernel; importing this package registers them in catalogue.ENTRIES."""

from . import adapter, alike, controllers, doctor, estop_line, frames, host, interface, native_inside, plumbing, soak, witness  # noqa: F401
