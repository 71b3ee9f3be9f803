# SPDX-License-Identifier: MIT
"""The MQTT bridge on simulated wheels, with a real broker: what it tells, what it carries out and what it drops, and that no stop is lost.

Brokers are Debian's mosquitto and nats-server, the client from outside is PyPI's paho-mqtt. What is missing is skipped, and said so. figures.py puts what
was sent, arrived and doubled into docs/user/mqtt.md.
"""

import pytest
from mqtt_rig import MqttRig


@pytest.fixture
def rig(make_rig):
    return make_rig(MqttRig)
