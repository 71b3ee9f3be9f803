# SPDX-License-Identifier: MIT
"""The tests detect the seeded faults that only a running image shows (test/faults)."""

import re
import sys

import pytest
from images import ROOT, WORK, must

pytest.importorskip("unicorn", reason="the Python package unicorn is missing in .venv (scripts/python_packages .venv requirements/check.txt)")


@pytest.mark.exact
@pytest.mark.full
def test_faults_of_the_image_are_noticed(record_property):
    said = must([sys.executable, ROOT / "test/faults/run", "--jobs", "2", "--image", WORK])
    record_property("tests", int(re.search(r"^(\d+) passed, 0 failed", said, re.MULTILINE)[1]))
