# SPDX-License-Identifier: MIT
"""A TCP port for one test."""

import socket

HELD = []


def free_port():
    """A port of the loopback that no other test on this machine gets while this process runs."""
    while True:
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            port = one.getsockname()[1]
        held = socket.socket(socket.AF_UNIX)
        try:
            held.bind(f"\0iwheel-test-port-{port}")
        except OSError:
            held.close()
            continue
        HELD.append(held)  # The name is free again when the process has ended.
        return port
