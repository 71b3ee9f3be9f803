# SPDX-License-Identifier: MIT
"""Two controllers under a distribution's own kernel: bit timing over netlink, a driver's own echo, a queue and restart-ms."""

import time

import netdev
from can_bus import CanBus
from catalogue import add, kernel_test
from distribution import CONTROLLERS
from harness import Rig
from kernel_rig import remove_marker
from scenario import REGISTRY
from scenarios.bus_states import judge_repaired

from .alike import row_of
from .interface import lose_interface, row17_no_buffers

AS_DOCUMENTED = {"bitrate": 1_000_000, "sample-point": 0.625}


def set_up(name, **timing):
    """The interface as in docs/user/deploy.md, but with that bit timing."""
    netdev.down(name)
    words = [word for key, value in {**AS_DOCUMENTED, **timing}.items() for word in (key, str(value))]
    netdev.command("ip", "link", "set", name, "type", "can", *words, "restart-ms", "100")
    netdev.up(name)


class ControllerRig(Rig):
    """Gateway on one controller; wheels and recorder on the other: what is recorded was on the bus."""

    exit_clears = False
    interface, wheels = CONTROLLERS
    presses = ()  # of a GPIO line

    def prepare(self):
        for name in CONTROLLERS:
            set_up(name)

    def listen(self, frames=None):
        return CanBus(self.wheels, frames)

    def wheels_bus(self):
        return self.wheels

    def gateway_bus(self):
        return self.interface

    def close(self, keep=False):
        super().close(keep)
        for name in CONTROLLERS:
            netdev.down(name)
        remove_marker(self.interface)


def controller_test(title, row):
    return kernel_test(title, "controllers", row, ControllerRig, pace=1)


@controller_test("bit timing over netlink is confirmed, the echo proven; it drives", 0)
def controller_nominal(t):
    rig, client, stream = t.driving(speed=400)
    bus = client.request("status")["bus"]
    wanted = {"name": rig.interface, "state": "active", "timing": "confirmed", "echo": "proven", "bitrate": 1_000_000}
    t.check({key: bus[key] for key in wanted} == wanted, f"bus {bus}")
    t.check(abs(bus["sample_point_permille"] - 625) <= 5, f"the nearest that the controller's clock allows: {bus['sample_point_permille']}")
    status = client.request("status")
    t.check(abs(status["left"]["speed_mm_s"] - 400) < 40, f"left {status['left']['speed_mm_s']} mm/s")
    t.check(stream.stop() is None, "the stream was not refused")
    t.stop_until_silent(rig, client)
    t.judge(rig)


@controller_test("interface down in motion, and up again: stop, no backlog", 15)
def controller_row15_down_and_up(t):
    rig, client, stream = t.driving()
    lose_interface(t, rig, client, stream, lambda: netdev.down(rig.interface))
    time.sleep(1.0)
    judge_repaired(t, rig, client, lambda: set_up(rig.interface))


@controller_test("a queue that accepts nothing for 300 ms in motion: stop, no old frame afterwards", 17)
def controller_row17_no_buffers(t):
    row17_no_buffers(t)


@controller_test("another sample point than the document's: reported, and no arm", 0)
def controller_sample_point(t):
    wrong_timing(t, **{"sample-point": 0.875})


@controller_test("another bit rate than the document's on both: reported, and no arm", 0)
def controller_bit_rate(t):
    wrong_timing(t, bitrate=500_000)


def wrong_timing(t, **timing):
    rig = t.rig()
    rig.sim.end()
    for name in CONTROLLERS:
        set_up(name, **timing)
    rig.relisten()
    rig.sim = type(rig.sim)(rig)
    client = rig.connect_to_new(wheels=False)
    time.sleep(1.2)
    status = client.request("status")
    t.check(status["bus"]["timing"] == "contradicted", f"bus {status['bus']}")
    t.check(any("sample-point 0.625" in warning for warning in status["warnings"]), f"a warning with the fix: {status['warnings']}")
    reply = client.arm()
    t.check(not reply["ok"], f"no arm: {reply}")
    t.figure(f"{reply.get('error')}")
    t.rule(not rig.bus.setpoints(), "nothing was sent")


ALIKE = (
    "row01_client_killed",
    "row07_stale_command",
    "software_estop",
    "row19_second_master_driving",
    "row22_left_silent",
    "row22_both_silent",
    "row24_stopped_250_ms",
    "row25_killed",
    "row25_sigterm",
    "row25_restart_beside_other_master",
)
for there in ALIKE:  # scenarios of the local bus
    title, _, function = REGISTRY[there]
    add(f"controller_{there}", title, function, groups="controllers", row=row_of(there), rig=ControllerRig, pace=1)
