# SPDX-License-Identifier: MIT
"""Written by scripts/version; the one place is CMakeLists.txt."""

__version__ = "0.3.0"
