# SPDX-License-Identifier: MIT
"""A TCP port for one test."""

import socket

from free_domain import reserve


def free_port():
    """A port of the loopback that no other test on this machine gets while this process runs."""
    while True:
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            port = one.getsockname()[1]
        if reserve(f"port-{port}"):
            return port
