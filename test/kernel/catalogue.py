# SPDX-License-Identifier: MIT
"""The list of tests on a real kernel: title, rig and boots of each."""

from typing import NamedTuple
from collections.abc import Callable

from kernel_rig import VcanRig

ENTRIES = {}


class Entry(NamedTuple):
    """`groups`: the boots that run it. `row` is the row of the fault catalogue, 0 for the rig's own tests.

    In virtual time the interval of telemetry is `pace` times the documented one: each frame costs such a kernel half a millisecond, and a
    gateway that frames wake rarely has the harder task. In real time the interval is the documented one.
    """

    name: str
    title: str
    function: Callable
    groups: tuple
    row: int
    rig_type: type
    pace: int


PACE = 4  # a wheel's speed every 16 ms; it counts as lost after 50 ms


def kernel_test(title, groups, row, rig=VcanRig, pace=PACE):
    """Registers a function test(t) under its name."""

    def register(function):
        name = function.__name__
        ENTRIES[name] = Entry(name, title, function, tuple(groups.split()), row, rig, pace)
        return function

    return register


def add(name, title, function, **fields):
    """Registers a function under another name, as the same test on another rig."""
    groups = tuple(fields["groups"].split())
    ENTRIES[name] = Entry(name, title, function, groups, fields["row"], fields["rig"], fields.get("pace", PACE))
