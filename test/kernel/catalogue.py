# SPDX-License-Identifier: MIT
"""The list of tests on a real kernel: what each is, on which rig it runs, and in which boot."""

from typing import Callable, NamedTuple

from kernel_rig import VcanRig

ENTRIES = {}


class Entry(NamedTuple):
    """`groups`: the boots that run it. `row` is the row of the fault catalogue, 0 for the rig's own tests."""

    name: str
    title: str
    function: Callable
    groups: tuple
    row: int
    rig_type: type
    full_only: bool


def kernel_test(title, groups, row, rig=VcanRig, full_only=False):
    """Registers a function test(t) under its name."""

    def register(function):
        name = function.__name__
        ENTRIES[name] = Entry(name, title, function, tuple(groups.split()), row, rig, full_only)
        return function

    return register


def add(name, title, function, **fields):
    """Registers a function under another name, as the same test on another rig."""
    ENTRIES[name] = Entry(name, title, function, tuple(fields["groups"].split()), fields["row"], fields["rig"], False)
