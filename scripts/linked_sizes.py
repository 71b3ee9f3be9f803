# SPDX-License-Identifier: MIT
"""What a program that uses a part of the core pays for it: code and constants of the core after the linker has left out the rest."""
import re
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CPU_FLAGS = {"Cortex-M0+": "cortex-m0plus", "Cortex-M3": "cortex-m3", "Cortex-M4": "cortex-m4"}
CODEC = "iw_codec_decode iw_codec_encode_setpoint"
SETPOINT = "iw_setpoint_init iw_setpoint_demand iw_setpoint_command iw_setpoint_due iw_setpoint_take iw_setpoint_next_us"
FORCE = "iw_force_init iw_force_reopen iw_force_receive iw_force_receive_offset iw_force_validity iw_force_net_mN"
GATEWAY = ("iw_config_default iw_gateway_init iw_gateway_step iw_gateway_suspended iw_gateway_bus_facts iw_gateway_arm iw_gateway_drive "
           "iw_gateway_stop iw_gateway_estop iw_gateway_reset iw_gateway_disconnect iw_gateway_tare iw_gateway_state iw_gateway_arming")
KNOWN = "iw_gateway_set_assumption iw_gateway_restore_offset iw_config_stop_budget"
EVIDENCE = "iw_observation_init iw_observation_step"
# What is used: its headers, its functions, and the most that it may cost on a Cortex-M4.
USES = {
    "codec": ("codec.h", CODEC, 350),
    "codec, setpoints, force": ("codec.h force_offset.h private/setpoint.h", f"{CODEC} {SETPOINT} {FORCE}", 2900),
    "gateway": ("gateway.h", GATEWAY, 13000),
    "gateway, snapshot": ("gateway.h", f"{GATEWAY} iw_gateway_snapshot", None),
    "all": ("gateway.h observation.h", f"{GATEWAY} {KNOWN} iw_gateway_snapshot {EVIDENCE}", None),
}
SECTION = re.compile(r"^ \.(?:text|rodata)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+) \S*libiwheel_core\.a\((\w+)\.c\S*\)$", re.MULTILINE)


def linked(library, cpu, headers, functions):
    """{module: bytes} of what is linked."""
    with tempfile.TemporaryDirectory() as folder:
        source, memory_map = Path(folder) / "use.c", Path(folder) / "map"
        source.write_text("".join(f'#include "iwheel/{header}"\n' for header in headers.split()) + "void *volatile sink;\nvoid use(void) {\n"
                          + "".join(f"    sink = (void *){function};\n" for function in functions.split()) + "}\n")
        subprocess.run(["arm-none-eabi-gcc", f"-mcpu={CPU_FLAGS[cpu]}", "-mthumb", "-mfloat-abi=soft", "-Os", f"-I{ROOT / 'core/include'}",
                        "-nostartfiles", "-specs=nosys.specs", f"-Wl,--gc-sections,-e,use,-Map={memory_map}", source, library, "-o",
                        Path(folder) / "used"], check=True, stderr=subprocess.DEVNULL)
        text = memory_map.read_text().split("Linker script and memory map", 1)[1]
    sizes = {}
    for size, module in SECTION.findall(re.sub(r"\n (\.\S+)\n +0x", r"\n \1 0x", text)):
        sizes[module] = sizes.get(module, 0) + int(size, 16)
    return {module: size for module, size in sizes.items() if size > 0}


def table(builds):
    """[(use, [bytes on each CPU])], [what is wrong], the share of each module in the gateway on a Cortex-M4."""
    rows, findings, shares = [], [], {}
    for use, (headers, functions, limit) in USES.items():
        sizes = [linked(next(Path(build).rglob("libiwheel_core.a")), cpu, headers, functions) for build, cpu in zip(builds, CPU_FLAGS, strict=False)]
        rows.append((use, [sum(size.values()) for size in sizes]))
        if limit is not None and rows[-1][1][-1] > limit:
            findings.append(f"{use} on Cortex-M4: {rows[-1][1][-1]} B are linked, allowed {limit} B")
        if "evidence" in sizes[-1] and use != "all":
            findings.append(f"{use}: evidence is linked, and nobody calls it")
        shares = sizes[-1] if use == "gateway" else shares
    return rows, findings, shares
