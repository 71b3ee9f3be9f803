# SPDX-License-Identifier: MIT
"""Which tests share a boot, and how that kernel is started."""

from typing import NamedTuple


class Group(NamedTuple):
    """`limit_s`: of the whole boot, by the host's clock. `same_as`: it runs the tests of that group, with `gpiod` another build;
    without --full only those whose name begins as one of `few`.
    """

    name: str
    what: str
    virtual: bool = True
    kernel_arguments: tuple = ()
    limit_s: int = 1800
    full_limit_s: int = 3600
    full_only: bool = False
    same_as: str = ""
    few: tuple = ()
    gpiod: int = 0  # the generation of libgpiod; 0: that of --build
    distribution: str = (
        ""  # a machine of distribution.py, on the distribution's kernel, whose clock no load makes late, though its processor is not infinitely fast
    )

    def runs(self, name, groups, full):
        """Whether a test of that name and those groups is one of this group's."""
        return (self.same_as or self.name) in groups and (full or not self.few or name.startswith(self.few))


# The generations of libgpiod differ in how a line is opened, read, lost and found again.
READS_THE_LINE = (
    "row11_presses_low",
    "row11_two_lines",
    "row13_line_shorted",
    "row29_line_twice",
    "row12_pulses_low",
    "row12_glitch",
    "row13_pressed",
    "row14_",
)
# On the distribution's kernel: a drive, an interface that goes, a gateway that is killed.
SHORT = ("controller_nominal", "controller_row15", "controller_row25_killed")
# The longest come first, so that no processor waits for one of them at the end.
GROUPS = (
    Group("soak", "an hour of random faults, with --full a day", limit_s=3600, full_limit_s=24 * 3600),
    Group("realtime", "the same rules by the clock on the wall", virtual=False),
    Group("starved", "a processor that is fought over", virtual=False),
    Group("realtime-full", "more of them", virtual=False, full_only=True, full_limit_s=3 * 3600),
    Group("alike", "what the local bus passed, on SocketCAN"),
    Group("estop", "the e-stop on a GPIO line"),
    Group("estop-gpiod2", "the same through libgpiod 2", same_as="estop", gpiod=2, few=READS_THE_LINE),
    Group("adapter", "a CAN adapter with states, stalls and a plug"),
    Group("bus", "interfaces that go, foreign and odd frames, a full bus"),
    Group("echo", "an interface with a proven echo, late or missing", kernel_arguments=("vcan.echo=1",)),
    Group("host", "clocks, processes, disks, a second gateway"),
    Group("controllers", "two SJA1000 on one bus, by the driver of a kernel that nobody here configured", distribution="amd64", few=SHORT),
    Group("controllers-ctucan", "the same with CTU CAN FD", distribution="ctucan", same_as="controllers", few=SHORT, full_only=True),
    Group("controllers-arm64", "the same with the packages for arm64, on its kernel", distribution="arm64", same_as="controllers", few=SHORT, full_only=True),
    Group("plumbing", "the rig's own tests"),
    Group("plumbing-echo", "the rig's own tests, with a proven echo", kernel_arguments=("vcan.echo=1",)),
    Group("plumbing-realtime", "the rig's own tests in real time", virtual=False),
)
