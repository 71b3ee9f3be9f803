# SPDX-License-Identifier: MIT
"""What the gateway passed on the local bus, again on SocketCAN: both must behave alike.

The functions are those of test/system; only the rig differs. Left out: what needs the simulator to be the bus (power that is
cut, stalls), and floods that never wait, which would stop virtual time.
"""

import scenarios  # noqa: F401  (fills REGISTRY)
from catalogue import add
from kernel_rig import SlcanRig, VcanRig
from scenario import REGISTRY

ON_VCAN = (
    "nominal_drive_and_turn",
    "arm_moves_nothing",
    "limits_and_twist",
    "other_configuration",
    "force_offset_and_tare",
    "row01_client_killed",
    "row02_client_frozen",
    "row04_two_clients",
    "takeover_at_rest",
    "row06_reconnect_moves_nothing",
    "row07_stale_command",
    "lease_is_exact",
    "row10_out_of_range",
    "software_estop",
    "reset_refusals",
    "row19_second_master_driving",
    "row19_second_master_stopping",
    "row19_second_master_listening",
    "row20_odd_frames",
    "row22_left_silent",
    "row22_both_silent",
    "row22_sign_swapped",
    "row22_overspeed",
    "row22_blocked",
    "row23_wrong_unit",
    "trap07_reboot_while_driving",
    "row25_killed",
    "row25_aborted",
    "row25_restart_beside_other_master",
    "row25_sigterm",
    "row25_sigint",
    "listen_only",
)
ON_ADAPTER = ("nominal_drive_and_turn", "row01_client_killed", "row22_left_silent", "row25_killed", "row25_sigterm")
REAL_TIME = ("nominal_drive_and_turn", "row01_client_killed", "row02_client_frozen", "row25_killed", "row25_sigterm")


def row_of(name):
    return int(name[3:5]) if name.startswith("row") else 0


def register():
    for name in ON_VCAN:
        title, _, function = REGISTRY[name]
        groups = "alike realtime" if name in REAL_TIME else "alike"
        add(f"vcan_{name}", title, function, groups=groups, row=row_of(name), rig=VcanRig)
    for name in ON_ADAPTER:
        title, _, function = REGISTRY[name]
        add(f"slcan_{name}", f"{title}, through an adapter", function, groups="alike", row=row_of(name), rig=SlcanRig)


register()
