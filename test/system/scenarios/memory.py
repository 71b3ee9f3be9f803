# SPDX-License-Identifier: MIT
"""Results about the wheels are stored over restarts; the gateway reports and ignores a file that it must not trust."""

import glob
import json
import os
import signal
import time
import zlib

from harness import children
from scenario import scenario

QUIET_S = 2.6  # A window of forty force frames and some.


def memory_file(rig):
    found = [name for name in glob.glob(os.path.join(rig.settings["record"]["directory"], "ledger-*")) if "." not in name[-9:]]
    return found[0] if found else None


def written(rig, needle, seconds=4.0):
    """Waits until the file holds that text."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        name = memory_file(rig)
        if name:
            with open(name, encoding="utf-8") as file:
                if needle in file.read():
                    return True
        time.sleep(0.05)
    return False


def restart(rig, number=signal.SIGTERM, **options):
    rig.kill_gateway(number)
    return rig.connect_to_new(**options)


def answered(rig, client):
    return rig.wait_status(client, lambda s: s["memory"]["state"] != "loading", 2)


def store_process(gateway):
    return children(gateway.child.pid)["iwheel-store"]


@scenario("a tare and the operator's confirmation survive kill -9, and nothing changes the zero afterwards", 16)
def memory_survives_a_crash(t):
    rig, client = t.running()
    time.sleep(QUIET_S)
    t.expect(client.request("confirm", item="wheel_radius", value=192))
    t.expect(client.request("confirm", item="mount_sign_left"))
    t.expect(client.request("tare"))
    before = client.request("status")
    t.check(before["left"]["offset_samples"] == 40 and before["left"]["offset_contaminated"] is False, "quality of the tare")
    t.check(written(rig, '"operator"') and written(rig, '"left"'), "it is on the disk")
    time.sleep(1.3)
    rig.sim.ask("load left 15")  # Light enough for an estimate to accept it as the offset.
    client = restart(rig, signal.SIGKILL)
    status = answered(rig, client)
    if not t.check(status, "the stored results are read"):
        return
    t.check(status["memory"]["state"] == "kept", f"memory {status['memory']}")
    for item in ("wheel_radius", "mount_sign_left"):
        entry = status["ledger"][item]
        t.check((entry["state"], entry["evidence"]) == ("confirmed", "operator"), f"{item}: {entry}")
    t.check(status["ledger"]["mount_sign_right"]["state"] == "assumed", "the other wheel is not confirmed")
    time.sleep(QUIET_S)
    left = client.request("status")["left"]
    t.check(left["force_offset_mN"] == before["left"]["force_offset_mN"], f"the zero did not move: {left['force_offset_mN']} mN")
    t.check((left["offset_provenance"], left["offset_origin"]) == ("stored", "operator"), "and its origin is reported")
    t.check(left["offset_age_ms"] is not None and 2000 < left["offset_age_ms"] < 60000, f"and how old it is: {left['offset_age_ms']}")
    t.check(12_000 < (left["force_net_mN"] or 0) < 18_000, f"15 N show as {left['force_net_mN']} mN")
    rig.sim.ask("reboot left")
    rig.wait_status(client, lambda s: s["left"]["reboots"] == 1 and s["left"]["at_rest"], 4)
    time.sleep(QUIET_S)
    left = client.request("status")["left"]
    t.check(left["force_offset_mN"] == before["left"]["force_offset_mN"], "nor when the wheel reboots under load")
    rig.sim.ask("load left 0")
    time.sleep(QUIET_S)
    client.request("watch", topics=["force"], rate_hz=1)
    t.expect(client.request("tare", side="left"))
    t.check(client.wait_event("offset", side="left", provenance="operator"), "a new tare is reported by an event")
    t.check("left force offset: " in rig.gateway.text() and "before: " in rig.gateway.text(), "and in the log")
    t.rule(not rig.bus.setpoints(), "none of these requests sends a setpoint")
    t.judge(rig, moves=False)


@scenario("results for another configuration are dropped, and this is reported", 14)
def memory_of_another_configuration(t):
    rig, client = t.running()
    time.sleep(QUIET_S)
    t.expect(client.request("confirm", item="wheel_radius"))
    t.expect(client.request("tare", side="left"))
    t.check(written(rig, '"wheel_radius"'), "written")
    time.sleep(1.3)
    rig.configure(wheels={"radius_mm": 180}, left={"force_unit": "dN"})
    client = restart(rig)
    status = answered(rig, client)
    t.check(status["ledger"]["wheel_radius"]["state"] == "assumed", "the radius is open again")
    t.check(status["left"]["offset_origin"] != "operator", "a tare in another unit is no zero")
    log = rig.gateway.text()
    t.check("wheel_radius: the stored result was for 192, and 180 is configured now: dropped" in log, "reported: radius")
    t.check("stored force offset was measured in another force_unit: dropped" in log, "reported: offset")
    t.judge(rig, moves=False)


@scenario("a contradiction stays over a restart, until the operator resolves it", 16)
def memory_of_a_contradiction(t):
    rig, client = t.running(sim=("unit left dN",))
    status = rig.wait_status(client, lambda s: s["left"]["force_validity"] == "unit_contradicted", 6)
    t.check(status and status["ledger"]["force_unit_left"]["disabled"], "the unit is contradicted")
    t.check(written(rig, '"contradicted"'), "written")
    rig.kill_gateway(signal.SIGTERM)
    rig.restart_sim(rig.bus.frames, ("--uptime", "100"))  # No offset frames any more, so the gateway cannot find it again.
    rig.sim.ask("unit left dN")
    client = rig.connect_to_new()
    time.sleep(QUIET_S)
    status = client.request("status")
    left = status["left"]
    t.check((left["force_validity"], left["force_net_mN"]) == ("unit_contradicted", None), f"still no net force: {left['force_validity']}")
    t.check("raw / offset is" in status["ledger"]["force_unit_left"]["reason"], "with the reason")
    t.check("force_unit_left = cN is contradicted by the bus" in rig.gateway.text(), "reported at start")
    t.expect(client.request("confirm", item="force_unit_left"))
    left = client.request("status")["left"]
    t.check(left["force_validity"] == "valid" and left["force_net_mN"] is not None, f"resolved: {left['force_validity']}")
    t.judge(rig, moves=False)


def damage(path):
    with open(path, "r+b") as file:
        data = bytearray(file.read())
        data[len(data) // 2] ^= 1
        file.seek(0)
        file.write(data)


def replace(path):
    with open(path, "w", encoding="utf-8") as file:
        file.write('{"format":"somebody else\'s"}\n')


def forge(path):
    """A zero of 912 N, with the right checksum."""
    with open(path, encoding="utf-8") as file:
        known = json.loads(file.readline())
    zero = {"from": "operator", "unit": "cN", "offset_mN": 912000, "drift_mN": 0, "deviation_mN": 0, "samples": 40, "wall_us": 1}
    known["offsets"]["left"] = zero
    line = json.dumps(known, separators=(",", ":")) + "\n"
    with open(path, "w", encoding="utf-8") as file:
        file.write(f"{line}{zlib.crc32(line.encode()):08x}\n")


def settled(path):
    """Waits for the process that writes the file: it ends after its last write, later than the gateway."""
    seen = None
    while seen != (seen := os.stat(path).st_mtime_ns):
        time.sleep(0.5)


@scenario("a damaged, foreign or forged file is reported, ignored and set aside", 24)
def memory_that_is_not_to_be_trusted(t):
    rig, client = t.running()
    for spoil, fault in ((damage, "it is damaged"), (replace, "it is damaged"), (forge, "it contains values that no gateway can have measured")):
        t.expect(client.request("confirm", item="wheel_radius"))
        t.check(written(rig, '"wheel_radius"'), "written")
        time.sleep(1.3)
        rig.kill_gateway(signal.SIGTERM)
        path = memory_file(rig)
        settled(path)
        spoil(path)
        with open(path, "rb") as file:
            spoilt = file.read()
        client = rig.connect_to_new()
        answered(rig, client)
        status = client.request("status")
        t.check(status["ledger"]["wheel_radius"]["state"] == "assumed", "nothing of it is used")
        t.check(f"{path} is ignored: {fault}" in rig.gateway.text(), "the log reports it")
        with open(path + ".damaged", "rb") as file:
            t.check(file.read() == spoilt, "the file is set aside as it was")
        t.expect(client.request("confirm", item="mount_sign_left"))
        t.check(written(rig, '"mount_sign_left"'), "and a new one is written")
        time.sleep(0.3)
        memory = client.request("status")["memory"]
        t.check(memory["state"] == "ignored" and fault in memory["reason"], f"and still reported then: {memory}")
    t.judge(rig, moves=False)


@scenario("no place to store it: reported once, stored when there is one; nothing waits for a writing process that was killed", 14)
def memory_without_a_place(t):
    rig = t.rig()
    place = rig.path("place")
    folder = os.path.join(place, "records")
    with open(place, "w", encoding="ascii"):
        pass  # A file in place of a directory, so the gateway cannot make its file in it.
    rig.configure(record={"directory": folder})
    client = rig.connect_to_new()
    status = answered(rig, client)
    t.check(status["memory"]["state"] == "failed" and status["memory"]["reason"], f"memory {status['memory']}")
    t.check("set [record] directory" in rig.gateway.text(), "the log has cause and fix")
    t.expect(client.request("confirm", item="wheel_radius"))
    os.remove(place)
    os.makedirs(folder)
    t.check(written(rig, '"wheel_radius"', 13), "stored as soon as there is a place")
    stream = t.start_driving(client, 300, 300, 0.5, 0.02)
    os.kill(store_process(rig.gateway), signal.SIGKILL)
    client.request("confirm", item="mount_sign_left")
    stream.stop(after=1.5)
    status = client.request("status")
    t.check(status["memory"]["state"] == "failed", f"the end of the writing process is reported: {status['memory']}")
    t.check(status["ledger"]["mount_sign_left"]["state"] == "confirmed", "stored results stay valid in this run")
    t.check(rig.gateway.text().count("are not stored in") == 2, "each once")
    client.request("stop")
    t.judge(rig)
