# SPDX-License-Identifier: MIT
"""All scenarios; importing this package registers them. `rowNN` names a row of the fault catalogue."""

from . import (
    basic,
    clients,
    clients_many,
    bus_faults,
    estop,
    lifecycle,
    requests,
    arguments,
    tool,
    wheels,
)  # noqa: F401
