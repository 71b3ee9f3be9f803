# SPDX-License-Identifier: MIT
"""The groups of tests that share a boot, and how the kernel of each is started."""

from typing import NamedTuple


class Group(NamedTuple):
    """`limit_s`: limit of the whole boot, by the host's clock. `same_as`: it runs the tests of that group; with `gpiod`, another build;
    without --full only those whose name begins with one of `few`.
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
    gpiod: int = 0  # the major version of libgpiod; 0: that of --build
    long: bool = False  # of the part `long`, without being of a distribution
    distribution: str = ""  # a machine of distribution.py, on the distribution's kernel: no load makes its clock late, but its processor is not infinitely fast

    @property
    def part(self):
        """virtual, real (time), or long: hours, or a distribution's kernel under emulation."""
        return "long" if self.long or self.distribution else "virtual" if self.virtual else "real"

    def runs(self, name, groups, full):
        """Whether a test of that name and those groups belongs to this group."""
        return (self.same_as or self.name) in groups and (full or not self.few or name.startswith(self.few))


# The major versions of libgpiod differ in how a line is opened, read, lost and found again.
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
# On the distribution's kernel: a drive, an interface that disappears, a gateway that is killed.
SHORT = ("controller_nominal", "controller_row15", "controller_row25_killed")
# The longest come first, so that no processor waits for one of them at the end.
GROUPS = (
    Group("soak", "an hour of random faults, with --full a day", limit_s=3600, full_limit_s=24 * 3600, long=True),
    Group("realtime", "the same rules in real time", virtual=False),
    Group("starved", "a processor shared with other programs", virtual=False),
    Group("realtime-full", "more of them", virtual=False, full_only=True, full_limit_s=3 * 3600),
    Group("alike", "the scenarios of the local bus, on SocketCAN"),
    Group("estop", "the e-stop on a GPIO line"),
    Group("estop-gpiod2", "the same through libgpiod 2", same_as="estop", gpiod=2, few=READS_THE_LINE),
    Group("adapter", "a CAN adapter with states, stalls and unplugging"),
    Group("bus", "interfaces that disappear, foreign and invalid frames, a full bus"),
    Group("echo", "an interface with a proven echo, late or missing", kernel_arguments=("vcan.echo=1",)),
    Group("host", "clocks, processes, disks, a second gateway"),
    Group("controllers", "two SJA1000 on one bus, with the driver of the distribution's kernel", distribution="amd64", few=SHORT),
    Group("controllers-ctucan", "the same with CTU CAN FD", distribution="ctucan", same_as="controllers", few=SHORT, full_only=True),
    Group("controllers-arm64", "the same with the packages for arm64, on its kernel", distribution="arm64", same_as="controllers", few=SHORT, full_only=True),
    Group("plumbing", "the rig's own tests"),
    Group("plumbing-echo", "the rig's own tests, with a proven echo", kernel_arguments=("vcan.echo=1",)),
    Group("plumbing-realtime", "the rig's own tests in real time", virtual=False),
)
