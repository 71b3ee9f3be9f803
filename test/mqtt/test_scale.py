# SPDX-License-Identifier: MIT
"""Many machines at a broker and a console: each stop of each reaches the console."""

import pytest
from scale import run_load


def test_20_machines_at_10_hz_each_stop_reaches_console(rig):
    run_load(rig, 4, kind="mosquitto", machines=20, every_ms=100)


@pytest.mark.full
def test_300_machines_at_3_servers_each_stop_reaches_console(rig):
    run_load(rig, 20, kind="nats3", machines=300, every_ms=5000)
