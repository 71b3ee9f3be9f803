# SPDX-License-Identifier: MIT
"""All scenarios; importing this package registers them. `rowNN` names a row of the fault catalogue."""

from . import (  # noqa: F401
    basic,
    clients,
    clients_many,
    bus_faults,
    bus_states,
    estop,
    lifecycle,
    process,
    requests,
    arguments,
    tool,
    wheels,
    ledger,
    frames_together,
    memory,
)
