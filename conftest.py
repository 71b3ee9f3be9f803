# SPDX-License-Identifier: MIT
"""For every folder of tests: the rules of verdicts, and what the folders share."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent / "test" / folder) for folder in ("support", "system")]
sys.dont_write_bytecode = True
pytest_plugins = ("pytest_verdict", "rig_fixtures")
