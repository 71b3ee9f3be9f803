# SPDX-License-Identifier: MIT
"""The MQTT bridge on simulated wheels, with a real broker: what it publishes, carries out and drops, and that no stop is lost.

Brokers are Debian's mosquitto and nats-server, the outside client is PyPI's paho-mqtt. Tests without their programs are skipped, with the reason. figures.py
writes the numbers of events sent, arrived and doubled into docs/user/mqtt.md.
"""

import pytest
from mqtt_rig import MqttRig


@pytest.fixture
def rig(make_rig):
    return make_rig(MqttRig)
