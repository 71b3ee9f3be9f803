# SPDX-License-Identifier: MIT
"""The bridge to ROS 2, judged from the bus log like the system tests, and by the messages that another DDS participant receives.

Needs PyPI's cyclonedds and rosbags, and a build with CycloneDDS.
"""

from harness import SERVICE_NICE


def pytest_configure(config):
    config.witness_nice = SERVICE_NICE
