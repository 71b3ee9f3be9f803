# SPDX-License-Identifier: MIT
"""Which tests share a boot, and how that kernel is started."""

from typing import NamedTuple


class Group(NamedTuple):
    """`limit_s`: of the whole boot, by the host's clock."""

    name: str
    what: str
    virtual: bool = True
    kernel_arguments: tuple = ()
    limit_s: int = 600
    full_limit_s: int = 1200


GROUPS = (
    Group("soak", "an hour of random faults", limit_s=900, full_limit_s=4 * 3600),
    Group("realtime", "the same rules by the clock on the wall", virtual=False, full_limit_s=1800),
    Group("estop", "the e-stop on a GPIO line", full_limit_s=1800),
    Group("adapter", "a CAN adapter with states, stalls and a plug", full_limit_s=1200),
    Group("bus", "interfaces that go, foreign and odd frames, a full bus"),
    Group("echo", "an interface with a proven echo, late or missing", kernel_arguments=("vcan.echo=1",)),
    Group("host", "clocks, processes, disks, a second gateway"),
    Group("alike", "what the local bus passed, on SocketCAN"),
    Group("plumbing", "the rig's own tests"),
    Group("plumbing-echo", "the rig's own tests, with a proven echo", kernel_arguments=("vcan.echo=1",)),
    Group("plumbing-realtime", "the rig's own tests in real time", virtual=False),
)
