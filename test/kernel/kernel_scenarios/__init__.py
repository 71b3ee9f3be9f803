# SPDX-License-Identifier: MIT
"""All tests on a real kernel; importing this package registers them in catalogue.ENTRIES."""

from . import plumbing  # noqa: F401
