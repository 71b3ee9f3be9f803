# SPDX-License-Identifier: MIT
"""Figures that are counted and not timed: instructions and bytes. They are the same on every machine with the same compiler."""

import collections
import re
import subprocess
import sys
from pathlib import Path

import count_arm

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
CORE = ROOT / "core"
INCLUDES = [CORE / "include", HERE / "codec"]
FRAMES = 617
COMPILERS = ("gcc", "clang")
ARM_CPUS = ("cortex-m4", "cortex-m0plus")
# Instructions for a line.
READ_LIMITS = {
    "libiwheel-client, an event `state`": 17000,
    "the same, and its fields": 62000,
    "iwheelctl decode": 4300,
    "iwheelctl decode --csv": 4600,
    "iwheelctl --json decode": 4700,
}
PROFILE_FROM = 40  # instructions of a function in a step


def codecs(work):
    """{name: (sources, include folders)}; cantools' C source is generated here from the DBC file."""
    generated = work / "cantools"
    generated.mkdir(parents=True, exist_ok=True)
    subprocess.run(
        [sys.executable, "-m", "cantools", "generate_c_source", "--no-floating-point-numbers", "--no-strict", str(ROOT / "share/iwheel.dbc")],
        cwd=generated,
        check=True,
        capture_output=True,
    )
    return {
        "loop": ([HERE / "codec/loop.c"], INCLUDES),
        "floor": ([HERE / "codec/floor.c"], INCLUDES),
        "iwheel": ([HERE / "codec/iwheel.c", CORE / "src/codec.c"], INCLUDES),
        "cantools": ([HERE / "codec/cantools.c", generated / "iwheel.c"], [*INCLUDES, generated]),
    }


def host_instructions(program, *arguments):
    run = subprocess.run(
        ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", str(program), *map(str, arguments)], capture_output=True, text=True, check=True
    )
    return int(re.search(r"Collected : (\d+)", run.stderr)[1])


def host_codec(work, name, sources, includes, compiler):
    """Instructions per frame on this machine: (decode, encode). The difference of two runs excludes start and end."""
    program = work / f"codec-{name}-{compiler}"
    subprocess.run(
        [
            compiler,
            "-O2",
            "-std=c99",
            *[f"-I{path}" for path in includes],
            *map(str, sources),
            str(HERE / "codec/mix.c"),
            str(HERE / "codec/main.c"),
            "-o",
            str(program),
        ],
        check=True,
    )
    per_frame = []
    for what, frames in (("decode", FRAMES), ("encode", 1)):
        few, many = (20, 120) if what == "decode" else (1000, 11000)
        spent = host_instructions(program, what, many) - host_instructions(program, what, few)
        per_frame.append(spent / ((many - few) * frames))
    return per_frame


def arm_codec(work, name, cpu, sources, includes, compiler):
    """cantools' user has a C library whose memset is not compiled into a loop of bytes."""
    more = () if name == "cantools" else count_arm.FREESTANDING
    elf = count_arm.build(
        work / f"codec-{name}-{cpu}-{compiler}.elf",
        cpu,
        [*sources, HERE / "codec/mix.c"],
        includes,
        ["bench_decode", "bench_encode", "bench_fill"],
        more,
        compiler,
    )
    program = count_arm.Program(elf, cpu)
    program.call("bench_fill")
    per_frame = []
    for function, few, many, frames in (("bench_decode", 1, 3, FRAMES), ("bench_encode", 100, 300, 1)):
        counts = [program.call(function, rounds) for rounds in (few, many)]
        if any(refused for refused, _ in counts):
            raise SystemExit(f"{name} on {cpu}: a frame was refused")
        per_frame.append((counts[1][1] - counts[0][1]) / ((many - few) * frames))
    return per_frame


def arm_linked(work, cpu):
    elf = count_arm.build(
        work / f"linked-{cpu}.elf", cpu, [HERE / "codec/linked.c", CORE / "src/codec.c"], INCLUDES, ["bench_linked_decode", "bench_linked_encode"]
    )
    return count_arm.text_size(elf)


def driving(work, cpu, more=()):
    """The program of test/bench/step, with its gateway driving."""
    elf = count_arm.build(
        work / f"step-{cpu}{''.join(more)}.elf",
        cpu,
        [HERE / "step/step.c", *sorted((CORE / "src").glob("*.c"))],
        INCLUDES,
        ["bench_prepare", "bench_idle", "bench_frame_in", "bench_pair", "bench_faster", "bench_snapshot", "bench_seen"],
        (*count_arm.FREESTANDING, *more),
    )
    program = count_arm.Program(elf, cpu)
    if program.call("bench_prepare")[0] != 1:
        raise SystemExit("the gateway of test/bench/step does not drive")
    return program


def arm_profile(work, cpu):
    """Rows of (function, its own instructions with nothing due, the same with a pair due), the most expensive first, and the rest in one row."""
    program = driving(work, cpu)
    idle, pair = program.profile("bench_idle"), program.profile("bench_pair")
    shown = sorted({name for name, count in [*idle.items(), *pair.items()] if count >= PROFILE_FROM}, key=lambda name: (-idle[name], -pair[name]))
    rest = [sum(count for name, count in of.items() if name not in shown) for of in (idle, pair)]
    return [*[(name, idle[name], pair[name]) for name in shown], ("all others together", *rest)]


# The purpose of each source of the core; a source that is not listed appears under its own name.
RULES = {
    "setpoint": "R1, R4: ramps, periods, the zero hold",
    "envelope": "R8: the last check",
    "sender": "R5: both or none",
    "confirmation": "R6: no queue of old setpoints",
    "follow": "R13: a wheel is too fast, blocked or turns backwards",
    "diverge": "R14: the pair diverges",
    "watch_pair": "R14: the pair diverges",
    "yaw": "R17: limits of turning",
    "current": "R14: current limits",
    "permit": "R2, R3: permission, causes and states",
    "cause": "R2, R3: permission, causes and states",
    "codec": "frames",
    "wheel": "frames",
    "rolling": "R13: the machine rolls without setpoints",
    "age": "ages of all messages",
    "step": "the step itself",
    "gateway": "the step itself",
}


def sources_of_core():
    """{function: source without its ending}"""
    return {
        name: path.stem
        for path in sorted((ROOT / "core/src").glob("*.c"))
        for name in re.findall(r"^(?!static const|typedef)[\w \*]*?\b(\w+)\([^;{}]*\) \{$", path.read_text(), re.M)
    }


def arm_rules(work, cpu):
    """Rows of (rule, instructions with nothing due, the same with a pair due), the most expensive first."""
    program, source = driving(work, cpu), sources_of_core()
    costs = collections.defaultdict(lambda: [0, 0])
    for column, profile in enumerate((program.profile("bench_idle"), program.profile("bench_pair"))):
        for name, count in profile.items():
            stem = source.get(name, "HAL of the benchmark, runtime library")
            costs[RULES.get(stem, stem)][column] += count
    return sorted(((rule, *cost) for rule, cost in costs.items()), key=lambda row: -row[2])


def arm_steps(work, cpu, more=()):
    """{work of one step: instructions}, with additional options of the compiler."""
    program = driving(work, cpu, more)
    idle_sent, idle = program.call("bench_idle")
    received, frame = program.call("bench_frame_in")
    observe = sum(count for name, count in program.profile("bench_snapshot").items() if name != "bench_snapshot")
    seen, _ = program.call("bench_seen")
    pair_sent, pair = program.call("bench_pair")
    faster, _ = program.call("bench_faster")
    ramp_sent, ramp = program.call("bench_pair")
    did = (idle_sent, received, seen, pair_sent, faster, ramp_sent)
    if did != (0, 1, 1, 1, 1, 1):
        raise SystemExit(f"the steps of test/bench/step did other work: {did}")
    return {"nothing due": idle, "a frame in": frame, "a pair due": pair, "a pair due, of a ramp": ramp, "a snapshot": observe}


def status_events(build):
    """{which part is cached: instructions of one event `state` on this machine}, for the gateway of that build."""
    program, few, many = Path(build) / "test/bench_status", 20, 120
    return {what: round((host_instructions(program, what, many) - host_instructions(program, what, few)) / (many - few)) for what in ("same", "changed")}


def client_reads(work, build, *fields):
    """Instructions of libiwheel-client from the socket to one event `state`, or to its fields, system calls not counted."""
    line = work / "state.jsonl"
    output = subprocess.run([Path(build) / "test/bench_status", "line"], capture_output=True, check=True).stdout
    line.write_bytes(next(row for row in output.splitlines(keepends=True) if row.startswith(b'{"event":"state"')))
    program, few, many = Path(build) / "test/bench_client", 20, 120
    return round((host_instructions(program, line, many, *fields) - host_instructions(program, line, few, *fields)) / (many - few))


def decode_writes(work, build, form):
    """Instructions of `iwheelctl decode` for a line of a recording."""
    lines = [line for line in (ROOT / "test/recordings/estop.log").read_text().splitlines(keepends=True) if line.startswith("(")]
    counts = []
    for count in (500, 2000):
        recording = work / f"recording-{count}.log"
        recording.write_text("".join(lines[:count]))
        counts.append(host_instructions(Path(build) / "app/ctl/iwheelctl", *form.split(), recording))
    return round((counts[1] - counts[0]) / 1500)


def read_lines(work, build):
    """Rows of (work, instructions per line, limit)."""
    figures = {"libiwheel-client, an event `state`": client_reads(work, build), "the same, and its fields": client_reads(work, build, "fields")}
    figures |= {f"iwheelctl {form}": decode_writes(work, build, form) for form in ("decode", "decode --csv", "--json decode")}
    return [[what, str(figure), f"≤ {READ_LIMITS[what]}"] for what, figure in figures.items()]


def everything(work, compiler):
    """Rows of (codec, {count: instructions per frame, without those of the loop around it})."""
    rows, loop = [], {}
    for name, (sources, includes) in codecs(work).items():
        figures = dict(zip(("x86-64 decode", "x86-64 encode"), host_codec(work, name, sources, includes, compiler), strict=True))
        for cpu in ARM_CPUS:
            decode, encode = arm_codec(work, name, cpu, sources, includes, compiler)
            figures |= {f"{cpu} decode": decode, f"{cpu} encode": encode}
        if name == "loop":
            loop = figures
        else:
            rows.append((name, {what: figure - loop[what] for what, figure in figures.items()}))
    return rows


if __name__ == "__main__":
    work = Path(sys.argv[1])
    work.mkdir(parents=True, exist_ok=True)
    for compiler in COMPILERS:
        for name, figures in everything(work, compiler):
            print(compiler, name, {key: round(value, 1) for key, value in figures.items()})
    for cpu in ARM_CPUS:
        print(cpu, arm_linked(work, cpu), arm_steps(work, cpu))
    print("state", status_events(ROOT / "build/default"))
