# SPDX-License-Identifier: MIT
"""The bridge to ROS 2: judged from the bus log, as the system tests, and by what another DDS participant hears.

Needs PyPI's cyclonedds and rosbags, and a build with CycloneDDS.
"""

from harness import SERVICE_NICE


def pytest_configure(config):
    config.witness_nice = SERVICE_NICE
