# SPDX-License-Identifier: MIT
"""A DDS domain for one test. free_domain.h chooses one in the same way."""

import socket

HELD = []


def reserve(name):
    """Returns whether this process has the name on this machine from now on, until it ends."""
    held = socket.socket(socket.AF_UNIX)
    try:
        held.bind(f"\0iwheel-test-{name}")
    except OSError:
        held.close()
        return False
    HELD.append(held)
    return True


def free_domain():
    """A domain that no other test on this machine uses while this process runs. Above 100, its ports are those that the kernel assigns to any socket."""
    for domain in range(1, 101):
        if reserve(f"domain-{domain}"):
            return domain
    raise RuntimeError("each of the domains 1 to 100 is in use by a test")
