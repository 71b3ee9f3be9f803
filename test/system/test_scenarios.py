# SPDX-License-Identifier: MIT
"""The scenarios of the package `scenarios`, by their names: the real gateway and simulator, judged from the bus log. test/kernel runs them too."""

import scenarios  # noqa: F401  (registers them)
from scenario import REGISTRY

globals().update({name: play for name, (_, _, play) in REGISTRY.items()})
