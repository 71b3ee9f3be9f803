# SPDX-License-Identifier: MIT
"""The judge detects every seeded fault."""

import selftest
from verdict import hold


def test_judge_selftest():
    count, failures = selftest.run()
    hold(count and not failures, "\n".join(failures))
