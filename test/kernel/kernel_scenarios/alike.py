# SPDX-License-Identifier: MIT
"""The scenarios of the local bus, again on SocketCAN: both must behave in the same way.

The functions are those of test/system; only the rig differs. Left out: what needs the simulator to be the bus (power that is
cut, stalls), and floods that never wait, which would stop virtual time.
"""

import scenarios  # noqa: F401  (fills REGISTRY)
from catalogue import add
from kernel_rig import SlcanRig, VcanRig
from scenario import REGISTRY, as_documented

ON_VCAN = (
    "nominal_drive_and_turn",
    "arm_moves_nothing",
    "limits_and_twist",
    "other_configuration",
    "force_offset_and_tare",
    "row01_client_killed",
    "row02_client_frozen",
    "row03_client_never_reads",
    "row04_two_clients",
    "takeover_at_rest",
    "row06_reconnect_moves_nothing",
    "row07_stale_command",
    "lease_is_exact",
    "row08_endless_lines",
    "row09_odd_json",
    "row10_out_of_range",
    "software_estop",
    "reset_refusals",
    "row19_second_master_driving",
    "row19_second_master_stopping",
    "row19_second_master_listening",
    "row19_foreign_zero",
    "row19_forged_error_frames",
    "row20_odd_frames",
    "row20_odd_setpoints",
    "row22_left_silent",
    "row22_both_silent",
    "row22_sign_swapped",
    "row22_overspeed",
    "row22_blocked",
    "row23_wrong_unit",
    "row23_extremes",
    "row23_late_start",
    "row23_loaded_start",
    "row23_loaded_start_unseen",
    "row24_stopped_70_ms",
    "row24_stopped_150_ms",
    "row24_stopped_250_ms",
    "row24_stopped_450_ms",
    "row24_stopped_700_ms",
    "row24_stopped_1500_ms",
    "row24_stopped_3000_ms",
    "row24_suspended",
    "trap12_odometry_jump",
    "trap07_reboot_while_driving",
    "row25_killed",
    "row25_aborted",
    "row25_restart_beside_other_master",
    "row25_sigterm",
    "row25_sigint",
    "row26_stuck_clients",
    "row26_stuck_frames",
    "row27_stderr_blocked",
    "row28_socket_path",
    "row29_type_not_set",
    "row30_two_gateways",
    "no_estop_line",
    "listen_only",
)
ON_ADAPTER = ("nominal_drive_and_turn", "row01_client_killed", "row22_left_silent", "row25_killed", "row25_sigterm", "row30_two_gateways")
REAL_TIME = ("nominal_drive_and_turn", "row01_client_killed", "row25_killed")
REAL_TIME_FULL = ("row02_client_frozen", "row19_second_master_driving", "row24_stopped_250_ms", "row24_stopped_700_ms", "row25_sigterm", "row27_stderr_blocked")
NEVER_WAIT = ("row05_many_observers", "row05_out_of_descriptors")  # these would never end in virtual time


def row_of(name):
    return int(name[3:5]) if name.startswith("row") else 0


def register_one(prefix, name, groups, rig, more=""):
    title, _, function = REGISTRY[name]
    fields = {"pace": 1} if as_documented(name) else {}
    add(prefix + name, title + more, function, groups=groups, row=row_of(name), rig=rig, **fields)


def register():
    for name in ON_VCAN:
        extra = " realtime" if name in REAL_TIME else " realtime-full" if name in REAL_TIME_FULL else ""
        register_one("vcan_", name, "alike" + extra, VcanRig)
    for name in NEVER_WAIT:
        register_one("vcan_", name, "realtime", VcanRig)
    for name in ON_ADAPTER:
        register_one("slcan_", name, "alike", SlcanRig, ", through an adapter")


register()
