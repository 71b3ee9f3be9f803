# SPDX-License-Identifier: MIT
"""Bugs planted in copies of the core, each of which the swarm must catch. The tree itself is never changed."""
import concurrent.futures
import re
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
HOURS = 4
FLAGS = ["-std=gnu11", "-O2", "-w", "-I", ROOT / "core/include", "-I", ROOT / "core/src", "-I",
         ROOT / "app/sim/model/include", "-I", ROOT / "test/sim"]

# name, file of the core, what stands there, what is planted
BUGS = [
    ("lease-endless", "permit.c", "now_us >= self->lease_until_us) {\n        enter_stopping",
     "now_us >= self->lease_until_us + 5000000U) {\n        enter_stopping"),
    ("lease-fed-by-refused", "permit.c", "    if (refusal == IW_REFUSE_NONE) {\n        grant_lease(self,",
     "    {\n        grant_lease(self,"),
    ("disconnect-ignored", "permit.c", "    if (client != self->holder) {\n        return;\n    }\n    if (self->state == IW_STATE_ARMED) {",
     "    if (client != self->holder) {\n        return;\n    }\n    if (self->state == IW_STATE_LATCHED) {"),
    ("estop-only-stops", "permit.c", "(BIT(IW_CAUSE_ESTOP_LINE) | BIT(IW_CAUSE_ESTOP_SOFTWARE)",
     "(BIT(IW_CAUSE_ESTOP_SOFTWARE)"),
    ("estop-unreadable-released", "cycle.c", "if (pressed != 0) {", "if (pressed > 0) {"),
    ("estop-ramps", "permit.c", "return self->holding ? IW_DEMAND_ZERO : IW_DEMAND_SILENCE;",
     "return self->holding ? IW_DEMAND_BRAKE : IW_DEMAND_SILENCE;"),
    ("reset-arms", "permit.c", "    self->state = IW_STATE_LISTENING;\n    self->holding = false;\n    return IW_REFUSE_NONE;",
     "    self->state = IW_STATE_ARMED;\n    self->holding = false;\n    return IW_REFUSE_NONE;"),
    ("reset-while-moving", "permit.c", "    if (!self->view.at_rest) {\n        return IW_REFUSE_NOT_AT_REST;\n    }\n    if (stale",
     "    if (stale"),
    ("arm-with-stale-command", "permit.c", "if (stale_command(self, now_us)) {\n        return IW_REFUSE_STALE_COMMAND;\n    }\n    if (!self->view.at_rest ||",
     "if (!self->view.at_rest ||"),
    ("arm-without-echo", "permit.c", "if (self->view.proven && waited_us <= limit_us) {", "if (waited_us <= limit_us) {"),
    ("anybody-drives", "permit.c", "if (self->holder != client) {\n        return IW_REFUSE_NOT_HOLDER;\n    }",
     "if (client == IW_CLIENT_NONE) {\n        return IW_REFUSE_NOT_HOLDER;\n    }"),
    ("no-hold", "permit.c", "return held_us >= zero_hold_us && (", "return held_us >= 1000U && ("),
    ("hold-ignores-motion", "permit.c", "(self->view.settled || restarting(self));", "(true || restarting(self));"),
    ("hang-forgiven", "cycle.c", "if (late_us > IW_GATEWAY_HUNG_US) {", "if (late_us > 100U * IW_GATEWAY_HUNG_US) {"),
    ("late-ramps", "permit.c", "self->cut = cause == IW_CAUSE_LOOP_LATE;", "self->cut = false;"),
    ("foreign-ignored", "cycle.c", "    } else {\n            hear_foreign(self, now_us, frame->id);\n        }",
     "    }"),
    ("bus-off-ignored", "cycle.c", "if (self->bus < IW_BUS_PASSIVE) {\n        iw_outbox_clear",
     "if (self->bus < IW_BUS_OFF) {\n        iw_outbox_clear"),
    ("silence-of-left-ignored", "cycle.c", "if (iw_wheel_lost(wheel, now_us)) {", "if (side == IW_RIGHT && iw_wheel_lost(wheel, now_us)) {"),
    ("echo-never-missed", "cycle.c", "    if (waiting_us == IW_NEVER ||", "    if (waiting_us != IW_NEVER ||"),
    ("purge-forgotten", "sender.c", "    if (self->hal->purge(self->hal->context) <= 0) {", "    if (self != NULL) {"),
    ("queue-of-two", "outbox.c", "(zero ? 2U : 1U)", "(zero ? 3U : 2U)"),
    ("one-wheel-goes-on", "cycle.c", "    if (result == IW_SEND_LATER) {\n        iw_setpoint_collapse(&self->setpoint, now_us);\n    }",
     ""),
    ("ramp-by-calls", "setpoint.c", "const uint32_t towards = ramp_step(config->decel_mm_s2, elapsed_us);",
     "const uint32_t towards = ramp_step(config->decel_mm_s2, (elapsed_us < 8000U) ? elapsed_us : 8000U);"),
    ("steep", "setpoint.c", "const uint32_t away = ramp_step(config->accel_mm_s2, (elapsed_us < granted_us) ? elapsed_us : granted_us);",
     "const uint32_t away = ramp_step(2U * config->accel_mm_s2, elapsed_us);"),
    ("sign-not-through-zero", "setpoint.c", "const bool through_zero = *value != 0 && (target > 0) != (*value > 0);",
     "const bool through_zero = false;"),
    ("target-survives-stop", "setpoint.c", "    self->demand = demand;\n    self->target.wheel[IW_LEFT] = zero_command(self->config);\n    self->target.wheel[IW_RIGHT] = zero_command(self->config);",
     "    self->demand = demand;"),
    ("invert-forgotten-right", "sender.c", "const bool invert = config->invert[side];",
     "const bool invert = config->invert[side] && side == IW_LEFT;"),
    ("left-only", "sender.c", "    if (right && (taken || zero)) {", "    if (right && zero) {"),
    ("scaled-apart", "gateway.c", "    values[IW_RIGHT] = values[IW_RIGHT] * limit / largest;",
     "    values[IW_RIGHT] = (values[IW_RIGHT] > limit) ? limit : values[IW_RIGHT];"),
    ("refused-remembers", "gateway.c", "    if (refusal == IW_REFUSE_NONE) {\n        *out_applied", "    {\n        *out_applied"),
    ("sign-fault-ignored", "cycle.c", "        iw_permit_raise(&self->permit, now_us, IW_CAUSE_FEEDBACK_SIGN, side_bit(side), detail);\n", ""),
    ("overspeed-ignored", "cycle.c", "        iw_permit_raise(&self->permit, now_us, IW_CAUSE_OVERSPEED, side_bit(side), detail);\n", ""),
    ("blocked-ignored", "cycle.c", "        iw_permit_raise(&self->permit, now_us, IW_CAUSE_WHEEL_BLOCKED, side_bit(side), detail);\n", ""),
    ("reboot-ignored", "wheel.c", "            rebooted(self, now_us, IW_REBOOT_ODOMETRY);\n", "            self->ticks = 0;\n"),
]


def compile_objects(folder, sources):
    objects = []
    for source in sources:
        target = folder / (source.parent.parent.name + "_" + source.stem + ".o")
        subprocess.run(["gcc", *FLAGS, "-c", source, "-o", target], check=True)
        objects.append(target)
    return objects


def play(folder, name, objects):
    program = folder / name
    subprocess.run(["gcc", *objects, "-o", program], check=True)
    try:
        done = subprocess.run([program, "--hours", str(HOURS), "--first", "1"], capture_output=True, text=True,
                              timeout=300, errors="replace")
    except subprocess.TimeoutExpired:
        return True, "never ends"
    rules = sorted(set(re.findall(r"^FAILED seed (\d+) at .*?, rule (\d+): (.*)$", done.stdout, re.M)),
                   key=lambda found: int(found[0]))
    told = f"seed {rules[0][0]}, rule {rules[0][1]}: {rules[0][2]}" if rules else f"status {done.returncode}"
    return done.returncode != 0, told


def plant(folder, common, bug):
    name, file, before, after = bug
    text = (ROOT / "core/src" / file).read_text()
    if text.count(before) != 1:
        return False, f"{file} has changed: what is to be replaced stands there {text.count(before)} times"
    own = folder / name
    own.mkdir()
    planted = own / file
    planted.write_text(text.replace(before, after))
    target = own / "planted.o"
    subprocess.run(["gcc", *FLAGS, "-c", planted, "-o", target], check=True)
    others = [item for item in common if item.name != "core_" + planted.stem + ".o"]
    return play(own, "test_sim", others + [target])


def prove(names, jobs):
    chosen = [bug for bug in BUGS if not names or bug[0] in names]
    passed = failed = 0
    with tempfile.TemporaryDirectory() as temporary, concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        folder = Path(temporary)
        sources = [*sorted((ROOT / "core/src").glob("*.c")), *sorted((ROOT / "app/sim/model/src").glob("*.c")),
                   *sorted((ROOT / "test/sim").glob("*.c"))]
        common = compile_objects(folder, sources)
        clean = pool.submit(play, folder, "clean", common)
        results = [pool.submit(plant, folder, common, bug) for bug in chosen]
        caught, told = clean.result()
        passed, failed = (passed, failed + 1) if caught else (passed + 1, failed)
        print(f"{'FAILED' if caught else 'ok':7} {'the core as it is':26} {told if caught else 'passes'}")
        for bug, result in zip(chosen, results):
            caught, told = result.result()
            passed, failed = (passed + 1, failed) if caught else (passed, failed + 1)
            print(f"{'ok' if caught else 'FAILED':7} {bug[0]:26} {told if caught else 'not caught: ' + told}", flush=True)
    print(f"{passed} passed, {failed} failed, 0 skipped")
    return 1 if failed or not passed else 0
