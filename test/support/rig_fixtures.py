# SPDX-License-Identifier: MIT
"""Fixtures for tests of whole programs. Functions with @scenario are tests too: each receives `t`, which makes rigs of `rig_type` (the folder's) and
collects the findings."""

import pytest
import scenario
from harness import Rig


@pytest.fixture
def build(pytestconfig):
    return pytestconfig.option.build


@pytest.fixture
def rig_type():
    return Rig


@pytest.fixture
def t(build, rig_type, pytestconfig):
    test = scenario.Test(build, rig_type)
    yield test
    for rig in test.rigs:
        rig.close(pytestconfig.option.keep)


@pytest.fixture
def make_rig(build, request, pytestconfig):
    """Makes the one rig of a bridge's test, with the arguments of @pytest.mark.rig(...)."""
    made = []

    def make(rig_type):
        mark = request.node.get_closest_marker("rig")
        made.append(rig_type(build, **(mark.kwargs if mark else {})))
        return made[0]

    yield make
    for one in made:
        one.close(keep=pytestconfig.option.keep)


def pytest_configure(config):
    config.addinivalue_line("markers", "rig(...): arguments of the test's rig")


def pytest_pycollect_makeitem(collector, name, obj):
    """Collects scenarios of any name."""
    if not (hasattr(obj, "scenario") and callable(obj)):
        return None
    items = list(collector._genfunctions(name, obj))
    for item in items if obj.native else ():
        item.add_marker(pytest.mark.native(obj.native))
    return items


def pytest_collection_modifyitems(items):
    """The longest tests begin first."""
    items.sort(key=lambda item: -getattr(getattr(item, "obj", None), "scenario", ("", 0))[1])
