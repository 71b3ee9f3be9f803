# SPDX-License-Identifier: MIT
"""What the gateway answers, as this package hands it out. The other types are in _protocol.py; docs/user/northbound.md tells more."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, SupportsIndex
from collections.abc import Callable

from ._protocol import Status

Event = dict[str, Any]
"""An event as it came: `event` is its name. Names and fields that are not known must be ignored."""

Whole = SupportsIndex | float
"""A whole number of any type: 200, 200.0, numpy.int64(200). 200.5, True, NaN are refused when it is used."""

OnStatus = Callable[[Status], object]
"""What `drive_for` calls with each snapshot. If it returns True the drive ends; whatever else it returns means nothing."""


@dataclass(frozen=True)
class Applied:
    """The target after limits; ramps come on top."""

    left_mm_s: int
    right_mm_s: int
    left_mA: int
    right_mA: int
    limited: bool
    """It differs from what was asked: both wheels were scaled by one factor."""


@dataclass(frozen=True)
class Terms:
    """What `arm` was answered with."""

    lease_ms: int
    """Each accepted command holds this long."""
    first_lease_ms: int
    """The first command must come this soon."""
    stop_budget_ms: int
    """How long the machine goes on at most after the last command ..."""
    stop_budget_mm: int
    """... and how far."""
    warnings: tuple[str, ...]
    key: str | None = field(default=None, repr=False)
    """The secret of this lease; None: a microcontroller gives none."""
