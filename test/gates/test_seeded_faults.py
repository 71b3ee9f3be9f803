# SPDX-License-Identifier: MIT
"""Seeds a fault for every gate and requires that the gate finds it; and next to each fault a clean case that must pass. -k GATE: the cases of one gate."""

import argparse
import collections
import contextlib
import functools
import hashlib
import importlib.machinery
import importlib.util
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

pytestmark = [pytest.mark.exact, pytest.mark.limit(3000)]
ROOT = Path(__file__).resolve().parent.parent.parent
SCRIPTS = ROOT / "scripts"
os.environ["PATH"] = f"{ROOT}/.venv/bin:{os.environ['PATH']}"
ARM = [
    "arm-none-eabi-gcc",
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfloat-abi=soft",
    "-Os",
    "-std=c99",
    "-ffreestanding",
    "-ffunction-sections",
    "-fstack-usage",
    "-fcallgraph-info=su",
]
CLEAN = "// SPDX-License-Identifier: MIT\nint iw_f(int a);\nint iw_f(int a)\n{\n    return a + 1;\n}\n"


def run(*command, cwd=None):
    """(status, the whole output)"""
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def arm_library(folder, code):
    """Compiles code like the core, into a small build tree in the folder; returns the library."""
    objects = folder / "iwheel_core.dir"
    objects.mkdir()
    (folder / "core").mkdir()
    source = folder / "core" / "seeded.c"
    source.write_text(code)
    status, output = run(*ARM, "-c", source, "-o", objects / "seeded.c.o")
    if status != 0:
        raise RuntimeError(output)
    run("arm-none-eabi-ar", "rcs", folder / "libiwheel_core.a", objects / "seeded.c.o")
    return folder / "libiwheel_core.a"


def purity(folder, code):
    return run(SCRIPTS / "purity.py", arm_library(folder, code), folder / "core")


def stack(folder, code):
    arm_library(folder, code)
    return run(SCRIPTS / "stack_usage.py", folder, 256)


def frames(folder, code):
    (folder / "seeded.c").write_text(code)
    entry = {"directory": str(folder), "file": str(folder / "seeded.c"), "command": "gcc -O2 -c seeded.c -o seeded.o"}
    (folder / "compile_commands.json").write_text(json.dumps([entry]))
    return run(SCRIPTS / "stack_usage.py", "--frames", folder, 4096, folder)


def coverage(folder, calls):
    """Compiles a function with two branches and a main with these calls."""
    sources, objects = folder / "core" / "src", folder / "iwheel_core.dir"
    sources.mkdir(parents=True)
    objects.mkdir()
    (sources / "seeded.c").write_text("int f(int a, int b);\nint f(int a, int b)\n{\n    return (a && b) ? 1 : 2;\n}\n")
    (folder / "main.c").write_text(f"int f(int, int);\nint main(void) {{ {calls} return 0; }}\n")
    if calls is not None:
        run("gcc", "-O0", "--coverage", "-c", sources / "seeded.c", "-o", objects / "seeded.o")
        run("gcc", folder / "main.c", objects / "seeded.o", "--coverage", "-o", folder / "main", cwd=folder)
        run(folder / "main")
    shutil.copy(ROOT / "gcovr.cfg", folder)
    return run("gcovr", objects, cwd=folder)


def warnings(folder, code, compiler="gcc"):
    text = (ROOT / "cmake/iwheel_warnings.cmake").read_text()
    flags = " ".join(re.findall(r"target_compile_options\(iwheel_warnings INTERFACE\s+([^)]*)\)", text)).split()
    (folder / "seeded.c").write_text(code)
    return run(compiler, "-std=c99", *flags, "-c", folder / "seeded.c", "-o", folder / "seeded.o")


def analyzer(folder, code):
    """Compiles with the flags of the preset."""
    presets = json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]
    flags = next(preset["environment"]["CFLAGS"] for preset in presets if preset["name"] == "analyzer")
    (folder / "seeded.c").write_text(code)
    return run("gcc", "-std=c99", "-O2", *flags.split(), "-Werror", "-c", folder / "seeded.c", "-o", folder / "seeded.o")


def tidy(folder, code, part="app"):
    """Checks a file of a program with everything that .clang-tidy configures there."""
    for name in (".clang-tidy", "core/.clang-tidy", "lib/northbound/.clang-tidy"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    source = folder / part / "seeded.c"
    source.parent.mkdir(exist_ok=True)
    source.write_text(code)
    (folder / "compile_commands.json").write_text(json.dumps([{"directory": str(folder), "file": str(source), "command": f"clang -std=c99 -c {source}"}]))
    return run("run-clang-tidy", "-quiet", "-p", folder, cwd=folder)


def tidy_core(folder, code):
    return tidy(folder, code, "core/src")


def tidy_northbound(folder, code):
    return tidy(folder, code, "lib/northbound")


def cppcheck(folder, code, suppressions=""):
    """Checks a file like the core's."""
    if "2.10" not in run("cppcheck", "--version")[1]:
        return 77, "skip: the suppressions are written for cppcheck 2.10"
    for part in ("core/src", "core/include"):
        (folder / part).mkdir(parents=True)
    (folder / "core/src/seeded.c").write_text(code)
    (folder / ".cppcheck-suppressions").write_text(suppressions)
    return run("xargs", "-a", ROOT / ".cppcheck", "cppcheck", "core/src/seeded.c", cwd=folder)


def cppcheck_accepts(folder, what, begin="&a"):
    """Copies memory; the addon reports the discarded result (17.7)."""
    text = CLEAN.replace("    return", f"    int b;\n    memcpy(&b, {begin}, sizeof b);\n    return")
    return cppcheck(folder, "#include <string.h>\n" + text, f"misra-c2012-17.7:core/*\nmissingIncludeSystem\n{what}")


def cppcheck_behind(folder, begin):
    """The addon reports one finding per line: an accepted finding must not hide the next."""
    return cppcheck_accepts(folder, "", begin)


def deviations(folder, fault):
    """A tree whose page is correct, with one change: file, old text, new text."""
    for name, text in DEVIATING.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text.replace(*fault[1:]) if name == fault[0] else text)
    return run(SCRIPTS / "deviations.py", folder)


def northbound(folder, fault):
    """The description of the protocol and the files that must agree with it, with one change: file, old text, new text."""
    library = [f"include/iwheel_northbound/{name}.h" for name in ("json_in", "request", "request_fields", "words")]
    sources = [
        *(f"lib/northbound/protocol/{name}" for name in ("src/words.c", "src/states.c", *library)),
        "lib/northbound/server/src/observe.c",
        *(f"app/gateway/{name}.c" for name in ("answers/answers_events", "bus/bus_facts", "assumptions/assumptions_json")),
    ]
    for name in (
        "scripts/northbound.py",
        "test/northbound/described.py",
        "test/northbound/test_description.py",
        "share/northbound.json",
        "docs/user/northbound.md",
        "python/src/iwheel/_protocol.py",
        *sources,
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        text = (ROOT / name).read_text()
        if name == fault[0]:
            assert fault[1] in text, f"{name} no longer has {fault[1]}"
            text = text.replace(fault[1], fault[2], 1)
        (folder / name).write_text(text)
    written, output = run(sys.executable, folder / "scripts/northbound.py", "--check")
    described, more = run(sys.executable, folder / "test/northbound/test_description.py")
    # A failure prints a traceback as well; only an error means a broken gate.
    return written + described, output + (more if "errors=" in more else more.replace("Traceback", "at"))


def eva(folder, code):
    (folder / "seeded.c").write_text("#include <__fc_builtin.h>\n" + code)
    return run(ROOT / "test/eva/run", "--work", folder / "work", "--program", folder / "seeded.c")


@functools.cache
def eva_faults():
    with tempfile.TemporaryDirectory() as folder:
        return run(ROOT / "test/eva/run", "--work", folder, "--faults")


def eva_core(_, fault):
    """A fault in the core itself: the events of test/eva/main.c must reach it, and it must be an alarm. One analysis serves all cases."""
    status, output = eva_faults()
    return (status if status == 77 else int(f"ok: {fault}\n" in output)), output


def mcdc(folder, calls):
    """Compiles a function with a decision of two conditions and a main with these calls."""
    (folder / "core").mkdir()
    (folder / "build/mcdc/profiles").mkdir(parents=True)
    (folder / "core/seeded.c").write_text("int f(int a, int b);\nint f(int a, int b)\n{\n    return (a && b) ? 1 : 2;\n}\n")
    (folder / "main.c").write_text(f"int f(int, int);\nint main(void) {{ {calls} return 0; }}\n")
    run(
        "clang-19",
        "-fprofile-instr-generate",
        "-fcoverage-mapping",
        "-fcoverage-mcdc",
        folder / "main.c",
        folder / "core/seeded.c",
        "-o",
        folder / "build/mcdc/unit_seeded",
    )
    run("env", f"LLVM_PROFILE_FILE={folder}/build/mcdc/profiles/a.profraw", folder / "build/mcdc/unit_seeded")
    inner, outer = re.findall(r'^set\(conditions "(.*)"\)$', (ROOT / "test/all/steps.cmake").read_text(), re.M)
    command = outer.replace("${conditions}", inner).replace("\\$", "$").replace('\\"', '"')
    return run("sh", "-c", command, cwd=folder)


def ruff(folder, code):
    """Checks a script with that body."""
    (folder / "seeded").write_text(f'#!/usr/bin/env python3\n"""Seeded."""\n{code}')
    return run("ruff", "check", "--no-cache", "--config", ROOT / "ruff.toml", folder / "seeded")


def ruff_format(folder, code):
    """Checks a script with that body."""
    (folder / "seeded").write_text(f'#!/usr/bin/env python3\n"""Seeded."""\n{code}')
    return run("ruff", "format", "--check", "--no-cache", "--config", ROOT / "ruff.toml", folder / "seeded")


def shellcheck(folder, code):
    (folder / "seeded").write_text(f"#!/usr/bin/env bash\n{code}")
    return run("shellcheck", "-x", folder / "seeded")


def codespell(folder, text):
    shutil.copy(ROOT / ".codespellrc", folder)
    (folder / "page.md").write_text(text)
    return run("codespell", cwd=folder)


def style(folder, code):
    for part in ("core/src", "core/include", "lib/northbound/protocol/src", "lib/northbound/protocol/include", "port", "app", "test"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    (folder / "core/src/seeded.c").write_text(code)
    for part in ("core/src", "port"):
        (folder / part / "commented.c").write_text(CLEAN + ("// A reason.\n" + "int iw_x;\n" * 7) * 12)
    for part in ("lib/northbound/protocol/src", "app"):
        (folder / part / "clean.c").write_text(CLEAN)
    return run(sys.executable, SCRIPTS / "style.py", folder)


def style_header(folder, guard):
    (folder / "app").mkdir()
    (folder / "app/seeded.h").write_text(f"// SPDX-License-Identifier: MIT\n#ifndef IW_{guard}\n#define IW_{guard}\n#endif\n")
    return style(folder, CLEAN)


def put(folder, fault):
    """Makes one change in that copy of the tree: file, old text, new text."""
    file, old, new = fault
    text = (folder / file).read_text()
    assert old in text, f"{file} no longer has {old}"
    (folder / file).write_text(text.replace(old, new, 1))


def house(folder, fault):
    """The tree with one change. Only the changed program is compiled again."""
    for part in ("core", "port", "lib", "app", "docs"):
        shutil.copytree(ROOT / part, folder / part)
    put(folder, fault)
    flags = [f"-I{folder / part}" for part in ("core/include", "port/stm32_stub", "port/stm32_stub/access", "port/stm32_stub/boards/stm32f103")]
    lamp = str(folder / "port/stm32_stub/lamp.c")
    (folder / "build/default").mkdir(parents=True)
    (folder / "build/default/compile_commands.json").write_text(
        json.dumps([{"file": lamp, "directory": str(folder), "command": f"gcc -std=c99 {' '.join(flags)} -o a.o -c {lamp}"}])
    )
    return run(SCRIPTS / "house.py", "facts", folder)


def arch(folder, fault):
    """The tree with one change, compared with the table of permitted includes."""
    for part in ("core", "port", "lib", "app", "docs"):
        shutil.copytree(ROOT / part, folder / part)
    put(folder, fault)
    return run(SCRIPTS / "house.py", "layers", folder)


def arch_of_names(folder, more):
    """The same with one additional file."""
    for part in ("core", "port", "lib", "app", "docs"):
        shutil.copytree(ROOT / part, folder / part)
    (folder / more).write_text("// SPDX-License-Identifier: MIT\n")
    return run(SCRIPTS / "house.py", "layers", folder)


def faults(folder, fault):
    """The product and its table of seeded faults with one change: each fault must apply, and its noticers must exist."""
    for part in ("core", "port", "lib", "app", "python", "test/faults"):
        shutil.copytree(ROOT / part, folder / part)
    for part in ("target", "fuzz", "support"):
        (folder / "test" / part).symlink_to(ROOT / "test" / part)
    put(folder, fault[:3])
    if len(fault) > 3:
        (folder / fault[0]).rename(folder / fault[3])
    return run(sys.executable, folder / "test/faults/run", "--check", "--build", ROOT / "build/default")


def api(folder, fault):
    """The reference made of small copies of the headers' folders, one of them with `fault`."""
    for name in ("core", "lib/northbound/protocol", "lib/client", "port/linux"):
        (folder / name / "include").mkdir(parents=True)
    (folder / "docs/developer").mkdir(parents=True)
    shutil.copy(ROOT / "docs/developer/Doxyfile", folder / "docs/developer")
    (folder / "core/include/seeded.h").write_text(fault)
    command = re.search(r'^test\(idle api .* sh -c "(.*)"\)$', (ROOT / "test/all/steps.cmake").read_text(), re.M)[1]
    return run("sh", "-c", command.replace("\\$", "$"), cwd=folder)


def pages(folder, fault):
    """A page with one list, and indexes, about a small tree; the fault is (file, old, new), or an additional file."""
    tree = {
        "CHANGELOG.md": "# Changelog\n\n## [0.1.0] - 2026-11-20\n" + "\n- line\n" * 79,
        "app/a.c": "int follow_ms;\n",
        "app/b.c": "int other;\n",
        "test/README.md": "| `run` | x |\n",
        "test/run": "x\n",
        "scripts/README.md": "| `one.py` | x |\n",
        "scripts/one.py": "x\n",
        "docs/README.md": "| `developer/how-to-add.md` | x |\n",
        "docs/developer/how-to-add.md": "## A key\n\n<!-- pattern: follow_ms  in: app -->\n\n1. `app/a.c`: there.\n",
    }
    name, old, new = fault
    tree[name] = tree.get(name, "").replace(old, new) if name in tree else new
    for name, text in tree.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return run(SCRIPTS / "house.py", "pages", folder)


def man(folder, fault):
    """The manual pages of the build, one of them with one change: (page, old, new)."""
    build = ROOT / "build/default"
    if not (build / "man/iwheelctl.1.scd").exists():
        return 77, "build/default has no manual pages"
    shutil.copytree(build / "man", folder / "man")
    (folder / "app").symlink_to(build / "app")
    page, old, new = fault
    text = (folder / "man" / page).read_text()
    if old not in text:
        return 0, f"{old} is not in {page}"
    (folder / "man" / page).write_text(text.replace(old, new))
    status, output = run(sys.executable, ROOT / "test/man/test_pages.py", folder, "-k", "has_its_help", "-k", "has_the_help", "-k", "running_one")
    # A failure prints a traceback as well; only an error means a broken gate.
    return status, output if "errors=" in output else output.replace("Traceback", "at")


def python_pins(folder, fault):
    """The pinned PyPI packages with one change (file, old text, new text), and a program that installs them."""
    shutil.copytree(ROOT / "requirements", folder / "requirements")
    (folder / "tool").write_text('#!/bin/sh\n"$venv/bin/pip" install --require-hashes -r x\n')
    (folder / "tool").chmod(0o755)
    name, old, new = fault
    text = (folder / name).read_text()
    assert re.search(old, text, re.M), f"{name} no longer has {old}"
    (folder / name).write_text(re.sub(old, new, text, count=1, flags=re.M))
    return run(ROOT / ".venv/bin/python", SCRIPTS / "house.py", "pins", folder)


def python_wheels_there(folder, lines):
    """The same in an environment that exists, with the pip of .venv: to install pip takes six times as long as all else."""
    run(sys.executable, "-m", "venv", "--without-pip", folder / "venv")
    pip = folder / "venv/bin/pip"
    pip.write_text(f'#!/bin/sh\nexec "{ROOT}/.venv/bin/python" -m pip --python "{folder}/venv/bin/python" "$@"\n')
    pip.chmod(0o755)
    return python_wheels(folder, lines)


def python_wheels(folder, lines):
    """Two pinned wheels: only the one with its checksum may be installed."""
    sums = {}
    for name in ("one", "two"):
        with zipfile.ZipFile(folder / f"{name}-1-py3-none-any.whl", "w") as wheel:
            wheel.writestr(f"{name}.py", "")
            wheel.writestr(f"{name}-1.dist-info/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
            wheel.writestr(f"{name}-1.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
            wheel.writestr(f"{name}-1.dist-info/RECORD", "")
        sums[name] = hashlib.sha256((folder / f"{name}-1-py3-none-any.whl").read_bytes()).hexdigest()
    (folder / "list.txt").write_text(lines.format(**sums, other="0" * 64))
    status, output = run("env", "PIP_NO_INDEX=1", f"PIP_FIND_LINKS={folder}", SCRIPTS / "python_packages", folder / "venv", folder / "list.txt")
    there = sorted(path.stem for path in folder.glob("venv/lib/python*/site-packages/*.py") if path.stem in sums)
    if there != ([] if status else ["one", "two"]):
        raise RuntimeError(f"installed: {there}\n{output}")
    return status, output


def of_script(name):
    sys.path.insert(0, str(SCRIPTS))
    return importlib.import_module(name)


def sizes(_, new):
    found = [*of_script("sizes").differences({"permit": [2000], "core": [9000]}, new)]
    return len(found), "\n".join(found)


def sizes_of_use(_, more):
    """The size of the codec linked on a Cortex-M4, and of an additional module."""
    module, build = of_script("sizes"), ROOT / "build/arm"
    if not [*build.rglob("libiwheel_core.a")]:
        return 77, "build/arm has no library"
    module.CPUS = {"Cortex-M4": "cortex-m4"}
    module.USES = {"codec": ("codec.h observation.h", f"{module.CODEC} {more}", 10_000)}
    found = module.uses([build])[1]
    return len(found), "\n".join(found)


def sizes_of_image(_, used):
    found = [*of_script("sizes").crowded({"STM32F103 gateway": used, "gateway": [60000]})]
    return len(found), "\n".join(found)


def counting(folder, case):
    (folder / "junit.xml").write_text(f"<testsuite>{case}</testsuite>")
    status, output = run(ROOT / "test/all/count_tests.py", "--run", folder / "read.xml", "cp", folder / "junit.xml", folder / "read.xml")
    return status or int(output.split()[-4]), output


def of_mutation(name):
    sys.path[:0] = [str(ROOT / "test/mutation"), str(ROOT / "test/faults")]
    loader = importlib.machinery.SourceFileLoader(f"mutation_{name}", str(ROOT / "test/mutation" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def around(_, found):
    """The gate's verdict on semantic mutants: (verdict of one mutant, the known ones, whether the mutant still exists)"""
    word, known, there = found
    record = argparse.Namespace(files=["a.c"], mutants={"a.c | f | x; | y;": None} if there else {})
    with contextlib.redirect_stdout(io.StringIO()) as output:
        return of_mutation("around").verdict(record, known, {"a.c | f | x; | y;": word} if there else {}, True), output.getvalue()


def mutation(_, kind):
    """The gate's verdict on a mutant of the core with this judgement."""
    module, key = of_mutation("run"), "a.c | f | x; | y;"
    judge = argparse.Namespace(kills=collections.defaultdict(collections.Counter))
    campaign = module.Campaign(judge, {key: argparse.Namespace(file="a.c", function="f")}, {}, 1)
    with contextlib.redirect_stdout(io.StringIO()) as output:
        campaign.enter(key, module.Verdict(kind))
        return campaign.failures(["a.c"]), output.getvalue()


def proofs(folder, change):
    """Compares a changed table. All cases are one process: each of the ten lists of tests, which no case changes, is made once."""
    (folder / "proofs.csv").write_text(change((ROOT / "docs/developer/proofs.csv").read_text()))
    with contextlib.redirect_stdout(io.StringIO()) as output:
        return of_script("proofs").main([str(folder / "proofs.csv")]), output.getvalue()


def function(body, parameters="int a"):
    return CLEAN + f"int iw_g({parameters});\nint iw_g({parameters})\n{{\n{body}}}\n"


def nested(depth):
    """Nested conditions: cognitive complexity 1 + 2 + ... + depth."""
    return "".join(f"    if (a > {n}) {{\n" for n in range(depth)) + "    a++;\n" + "    }\n" * depth + "    return a;\n"


def null(folder, device):
    """Runs a test of ./check in a copy of the mounts in which /dev/null is this file."""
    (folder / "file").touch()
    mounts = ["unshare", "--map-root-user", "--mount", "sh", "-c", 'mount --bind "$0" /dev/null && exec "$@"', folder / device]
    if run(*mounts, "true")[0] != 0:
        return 77, "mount fails here"
    return run(*mounts, ROOT / "test/all/start", "idle", "lint", "seeded", "", "true", cwd=folder)


def junit(status, output):
    return f'<testcase name="t" status="{status}"><system-out>{output}</system-out></testcase>'


BIG = "void fill(char *);\nvoid iw_g(void);\nvoid iw_g(void) { char buffer[300]; fill(buffer); }\n"
VARIABLE = "void fill(char *);\nvoid iw_g(int n);\nvoid iw_g(int n) { char buffer[n]; fill(buffer); }\n"
RECURSION = "int fill(int);\nint iw_g(int n);\nint iw_g(int n) { return n > 1 ? fill(n) + iw_g(n - 1) * iw_g(n - 2) : 1; }\n"
SOME_INDEX = "int main(void) {{ int a[2] = {{1, 2}}; return a[Frama_C_interval(0, {})]; }}\n"
SOME_FOUR = "f(0, 0); f(1, 0); f(1, 1);"

PROTOCOL = "lib/northbound/protocol/include/iwheel_northbound"
REQUEST_FIELDS = f"{PROTOCOL}/request_fields.h"
USER_PAGES = "docs/user"  # A variable, because the step house checks names of pages in this file too.
DEVIATING = {
    "docs/developer/static.md": "| D1 | cppcheck | `zero` | `*` | for cppcheck to judge |\n| D2 | clang-tidy | `cert-x` | `.clang-tidy` | a reason |\n",
    ".clang-tidy": "Checks: >\n  -*,\n  cert-*,\n  -cert-x,\n",
    "core/a.c": CLEAN,
    ".cppcheck-suppressions": "# Words.\nzero:core/*\n",
    "ruff.toml": "[lint]\nignore = [\n]\n",
}

# The programs that gates need and a machine may not have.
TOOLS = {
    "arm-none-eabi-gcc": (purity, stack, sizes_of_use),
    "gcc": (frames, warnings, analyzer, house),
    "gcovr": (coverage,),
    "llvm-cov-19": (mcdc,),
    "frama-c": (eva, eva_core),
    "clang-tidy": (tidy, tidy_core, tidy_northbound),
    "cppcheck": (cppcheck, cppcheck_accepts, cppcheck_behind),
    "ruff": (ruff, ruff_format),
    "shellcheck": (shellcheck,),
    "codespell": (codespell,),
    "lizard": (style, style_header),
    "doxygen": (api,),
    "clang": (mutation, around),
    "unshare": (null,),
}

# gate, the seeded fault, argument, whether the gate must find it
CASES = [
    (purity, "clean", CLEAN, False),
    (purity, "counter at file scope", "int iw_count(void);\nstatic int n;\nint iw_count(void) { return ++n; }\n", True),
    (purity, "initialised variable", "int iw_n = 7;\n", True),
    (purity, "call of puts", 'int puts(const char *);\nint iw_g(void) { return puts(""); }\n', True),
    (purity, "floating point", "float iw_g(float a) { return a * 2; }\n", True),
    (purity, "constant folded floating point", "int iw_g(void) { return (int)(double)2; }\n", True),
    (purity, "header of libc", "#include <stdlib.h>\n" + CLEAN, True),
    (stack, "clean", CLEAN, False),
    (stack, "300 bytes", BIG, True),
    (stack, "variable length", VARIABLE, True),
    (stack, "recursion", RECURSION, True),
    (frames, "4000 bytes", BIG.replace("300", "4000"), False),
    (frames, "4200 bytes", BIG.replace("300", "4200"), True),
    (frames, "variable length", VARIABLE, True),
    (coverage, "clean", SOME_FOUR, False),
    (coverage, "a branch never executed", "f(0, 0); f(1, 1);", True),
    (coverage, "a function never called", "", True),
    (coverage, "nothing is measured", None, True),
    (warnings, "clean", CLEAN, False),
    (warnings, "lost bits", "short f(long a);\nshort f(long a) { return a; }\n", True),
    (warnings, "sign", "unsigned f(int a);\nunsigned f(int a) { return a; }\n", True),
    (analyzer, "clean", CLEAN, False),
    (analyzer, "second free", "#include <stdlib.h>\nvoid f(void *p);\nvoid f(void *p)\n{\n    free(p);\n    free(p);\n}\n", True),
    (mcdc, "clean", SOME_FOUR, False),
    (mcdc, "a decision that nothing runs", "", True),
    (mcdc, "a condition that never decides alone", "f(0, 0); f(1, 1);", True),
    (eva, "clean", SOME_INDEX.format(1), False),
    (eva, "index off by one", SOME_INDEX.format(2), True),
    (eva, "signed overflow", "int main(void) { int a = Frama_C_interval(0, 2147483647); return a + 1; }\n", True),
    (eva, "an assertion that does not hold", "int main(void) { int a = Frama_C_interval(0, 1);\n//@ assert a == 0;\nreturn a; }\n", True),
    (eva_core, "the core: ring index off by one", "eva-ring-index-off-by-one", True),
    (eva_core, "the core: a queue of three in space for two", "eva-queue-of-three-in-space-for-two", True),
    (eva_core, "the core: negation of any number", "eva-negation-of-any-number", True),
    (tidy, "clean", CLEAN, False),
    (tidy, "size of the pointer", "#include <string.h>\nvoid f(int *p);\nvoid f(int *p) { memset(p, 0, sizeof(p)); }\n", True),
    (
        tidy,
        "second free on one path",
        "#include <stdlib.h>\nvoid f(void *p, int a);\nvoid f(void *p, int a)\n{\n    if (a) {\n        free(p);\n    }\n    free(p);\n}\n",
        True,
    ),
    (tidy, "61 lines", function("    a++;\n" * 58 + "    return a;\n"), False),
    (tidy, "81 lines", function("    a++;\n" * 78 + "    return a;\n"), True),
    (tidy, "6 parameters", function("    return a;\n", "int a, int b, int c, int d, int e, int f"), True),
    (tidy, "cognitive complexity 28", function(nested(7)), True),
    (tidy_core, "60 lines", function("    a++;\n" * 57 + "    return a;\n"), False),
    (tidy_core, "61 lines", function("    a++;\n" * 58 + "    return a;\n"), True),
    (tidy_core, "cognitive complexity 15", function(nested(5)), False),
    (tidy_core, "cognitive complexity 21", function(nested(6)), True),
    (tidy_northbound, "cognitive complexity 21", function(nested(6)), True),
    (cppcheck, "clean", CLEAN, False),
    (cppcheck, "index out of bounds", "int f(void);\nint f(void)\n{\n    int a[2] = {1, 2};\n    return a[2];\n}\n", True),
    (cppcheck, "MISRA 15.1, goto", "int f(int a)\n{\n    if (a > 0) {\n        goto out;\n    }\nout:\n    return a;\n}\n", True),
    (cppcheck_accepts, "clean", "", False),
    (cppcheck_behind, "MISRA 18.4 in a line with an accepted finding", "&a + 0", True),
    (cppcheck_accepts, "a suppression that nothing needs", "misra-c2012-8.4:core/*\n", True),
    (deviations, "clean", ("", "", ""), False),
    (deviations, "a switch-off without a number", (".clang-tidy", "-cert-x,", "-cert-x,\n  -cert-y,"), True),
    (deviations, "a number without use", (".clang-tidy", "  -cert-x,\n", ""), True),
    (deviations, "a suppression without a number", (".cppcheck-suppressions", "zero:core/*\n", "zero:core/*\none:core/*\n"), True),
    (deviations, "a number that cppcheck does not need", (".cppcheck-suppressions", "zero:core/*\n", ""), True),
    (deviations, "a rule of ruff without a number", ("ruff.toml", "[\n]", '[\n    "E402",\n]'), True),
    (deviations, "a comment that silences ruff", ("core/a.c", "a + 1;", "a + 1; # noqa"), True),
    (deviations, "a comment that silences a tool", ("core/a.c", "a + 1;", "a + 1; // NOLINT"), True),
    (deviations, "a suppressed compiler warning", ("core/a.c", "int iw_f", '#pragma GCC diagnostic ignored "-Wall"\nint iw_f'), True),
    (deviations, "a number used twice", ("docs/developer/static.md", "D2", "D1"), True),
    (deviations, "no reason", ("docs/developer/static.md", "a reason", ""), True),
    (northbound, "clean", ("", "", ""), False),
    (northbound, "a word that only the gateway has", ("lib/northbound/protocol/src/states.c", '"active"', '"awake"'), True),
    (northbound, "a fault that is no cause", ("lib/northbound/server/src/observe.c", '"still_moving", true', '"still_rolling", true'), True),
    (northbound, "a state of the memory", ("app/gateway/assumptions/assumptions_json.c", '"ignored"', '"distrusted"'), True),
    (northbound, "a word that the gateway no longer has", ("app/gateway/bus/bus_facts.c", 'return "near";', 'return "confirmed";'), True),
    (northbound, "a field that the client does not know", ("python/src/iwheel/_protocol.py", "    heard: bool\n", ""), True),
    (northbound, "a field that the reader does not know", (REQUEST_FIELDS, "    ROW(reason, reason, TEXT, 200, false, BIT(ESTOP))", "    "), True),
    (northbound, "a request with the name of another", (REQUEST_FIELDS, "NAME(TARE, tare)", "NAME(WHY, tare)"), True),
    (northbound, "a limit of the reader's own", (f"{PROTOCOL}/request.h", "IWN_LINE_MAX        4096U", "IWN_LINE_MAX        8192U"), True),
    (northbound, "a field that is not documented", ("docs/user/northbound.md", "`heard`, `at_rest`", "`at_rest`"), True),
    (northbound, "a field that is only documented", ("docs/user/northbound.md", "`heard`, `at_rest`", "`heard`, `seen`, `at_rest`"), True),
    (northbound, "an example of another type", ("docs/user/northbound.md", '"rate_hz":20}', '"rate_hz":"20"}'), True),
    (northbound, "an error that means something else", ("docs/user/northbound.md", "a wheel turns |", "a wheel stands |"), True),
    (
        northbound,
        "an integer without a unit",
        ("share/northbound.json", '"reboots": {"type": "integer", "unit": "count"', '"reboots": {"type": "integer"'),
        True,
    ),
    (ruff, "clean", "import sys\n\nprint(sys.argv)\n", False),
    (ruff, "an unused import", "import sys\n", True),
    (ruff, "an undefined name", "print(gone)\n", True),
    (ruff, "a default that all calls share", "def f(a=[]):\n    a.append(1)\n    return a\n", True),
    (ruff, "a bare except that hides errors", "try:\n    print(1)\nexcept:\n    print(2)\n", True),
    (ruff, "a run without a check of its failure", "import subprocess\n\nsubprocess.run(['false'])\n", True),
    (ruff, "a zip of lists of unequal length", "print([a for a, b in zip('ab', 'a') if a == b])\n", True),
    (ruff, "complexity 17", "def f(a):\n" + "".join(f"    if a == {n}:\n        print({n})\n" for n in range(16)), True),
    (ruff_format, "formatted", "\nprint(1, [2, 3])\n", False),
    (ruff_format, "not formatted", "\nprint( 1,[2,3] )\n", True),
    (shellcheck, "clean", 'echo "$1"\n', False),
    (shellcheck, "words that are split", "rm -r $1\n", True),
    (shellcheck, "a folder that is not there", "cd build\nrm -r x\n", True),
    (shellcheck, "an undefined name", 'echo "$gone"\n', True),
    (shellcheck, "a status that is lost", 'f() { local a=$(false); echo "$a"; }\nf\n', True),
    (codespell, "clean", "The wheels obey its behaviour.\n", False),
    (codespell, "two swapped letters", "The wheels obey te" + "h gateway.\n", True),
    (style, "clean", CLEAN, False),
    (style, "a comment that names an existing function", CLEAN + "// As `iw_f` in seeded.c.\n", False),
    (style, "a comment that names a removed function", CLEAN + "// As `iw_g`.\n", True),
    (style, "a comment that names a removed macro of the board", CLEAN + "// As BRD_GONE.\n", True),
    (style, "a comment that names a removed file", CLEAN + "// See gone.h.\n", True),
    (style, "a comment that names a removed rule", CLEAN + "// By R99.\n", True),
    (style, "121 characters", CLEAN + "// " + "a" * 118 + "\n", True),
    (style, "no comment that explains", CLEAN + "int iw_h;\n" * 300, True),
    (style, "nothing but comments", CLEAN + "// A reason.\n" * 60, True),
    (style, "61 lines", function("    a++;\n" * 58 + "    return a;\n"), True),
    (style, "complexity 12", function("    if (a == 1) {\n        a++;\n    }\n" * 11 + "    return a;\n"), True),
    (style, "6 parameters", function("    return a;\n", "int a, int b, int c, int d, int e, int f"), True),
    (style, "401 lines that are no comments", CLEAN + "\n" * 396, True),
    (style, "no licence line", CLEAN.split("\n", 1)[1], True),
    (style, "unfinished", CLEAN + "// " + "TO" + "DO\n", True),
    (style, "a name with a replaced word", CLEAN + "int iw_told_mA;\n", True),
    (style, "a replaced word inside a longer one", CLEAN + "int iw_ftell_mA;\n", False),
    (style, "the form of the tree", function("    a++;\n    return (a > 1) ? a : 0;\n"), False),
    (style, "++ before a name", function("    ++a;\n    return a;\n"), True),
    (style, "a comparison that chooses", function("    return a > 1 ? a : 0;\n"), True),
    (style, "parentheses around an expression", function("    return (int)sizeof(a);\n"), True),
    (style_header, "clean", "SEEDED_H", False),
    (style_header, "an include guard of another name", "PLANTS_H", True),
    (faults, "clean", ("core/src/step.c", "#include", "#include"), False),
    (faults, "a function is renamed that no fault is in", ("lib/northbound/server/src/requests.c", "void carry_out(", "void carry_it_out("), False),
    (faults, "a function is renamed that faults are in", ("lib/northbound/server/src/drive.c", "void iwn_server_twist(", "void iwn_server_turn("), False),
    (faults, "a file has another name and place", ("app/gateway/loop.c", "#include", "#include", "app/cycle.c"), False),
    (faults, "the code of a fault of the core is gone", ("core/src/codec.c", "wheel->pose.x_mm, wheel->pose.y_mm", "pose->x_mm, pose->y_mm"), True),
    (
        faults,
        "the code of a fault occurs twice",
        (
            "core/src/sender.c",
            "const bool invert = config->invert[side];",
            "const bool invert = config->invert[side]; const bool invert = config->invert[side];",
        ),
        True,
    ),
    (
        faults,
        "the code of a fault of the daemon is gone",
        ("app/gateway/loop.c", "events[i].data.u64 == SOCK_TAG_ESTOP", "events[i].data.u32 == SOCK_TAG_ESTOP"),
        True,
    ),
    (faults, "the code of a fault of the board is gone", ("app/board/configure.c", "!brd_host_is_silent(self)", "!is_silent(self)"), True),
    (faults, "a noticer that is no test", ("test/faults/gateway.faults", "unit.daemon_watchers", "unit.daemon_watching"), True),
    (faults, "a fault of the core with one noticer", ("test/faults/core.faults", "| unit sim orders\n", "| unit\n"), True),
    (faults, "two faults of one name", ("test/faults/core.faults", "| disconnect-ignored |", "| lease-endless |"), True),
    (house, "clean", ("port/stm32_stub/lamp.c", "#include", "#include"), False),
    (
        house,
        "a program reads a part of the core",
        (
            "port/stm32_stub/lamp.c",
            '#include "lamp.h"',
            '#include "lamp.h"\n#include "iwheel/gateway.h"\n'
            "int iw_look(iw_gateway_t *g);\nint iw_look(iw_gateway_t *g) {\n    return (int)g->permit.phase;\n}",
        ),
        True,
    ),
    (
        house,
        "a program includes what is private",
        ("port/stm32_stub/lamp.c", '#include "lamp.h"', '#include "lamp.h"\n#include "iwheel/private/follow.h"'),
        True,
    ),
    (house, "a header includes one level more", ("core/src/arithmetic.h", '#include "iwheel/types.h"', '#include "iwheel/gateway.h"'), True),
    (house, "two folders need each other", ("app/gateway/process/child.c", '#include "child.h"', '#include "child.h"\n#include "disk/file_store.h"'), True),
    (house, "another folder's header by its bare name", ("app/gateway/answers/answers_refuse.c", '#include "wheels/wheels.h"', '#include "wheels.h"'), True),
    (
        house,
        "two arrows more",
        ("app/gateway/lock/bus_names.c", '#include "bus_names.h"', '#include "bus_names.h"\n#include "disk/file_store.h"\n#include "box/box.h"'),
        True,
    ),
    (arch, "clean", ("app/ctl/main.c", "#include", "#include"), False),
    (
        arch,
        "a tool includes a file of the daemon",
        ("app/ctl/main.c", '#include "begin/begin.h"', '#include "begin/begin.h"\n#include "assumptions/assumptions_file.h"'),
        True,
    ),
    (arch, "the same by its way", ("app/ctl/main.c", '#include "begin/begin.h"', '#include "begin/begin.h"\n#  include "../gateway/daemon.h"'), True),
    (arch, "a library includes a program", ("lib/config/value.c", "#include", '#include "talk/ctl.h"\n#include'), True),
    (arch, "a port includes the board's application", ("port/stm32_stub/report.c", '#include "report.h"', '#include "report.h"\n#include "host.h"'), True),
    (arch, "the board includes a file of the daemon", ("app/board/host.c", '#include "host.h"', '#include "host.h"\n#include "answers/answers.h"'), True),
    (arch, "an unused permission", ("docs/developer/architecture.md", "| `lib/client` | ", "| `lib/client` | `core`, "), True),
    (arch, "a library that is not in the table", ("docs/developer/architecture.md", "| `lib/begin` | none |\n", ""), True),
    (arch_of_names, "clean", "app/ctl/text/a_name_of_its_own.c", False),
    (arch_of_names, "a source of a program with the name of another's", "app/ctl/text/host.c", True),
    (arch_of_names, "a header of a library with the name of the port's", "lib/config/frame_ring.h", True),
    (house, "modules that take the whole daemon", ("app/gateway/daemon.h", "#endif", "void gw_take(gw_daemon_t *daemon);\n" * 30 + "#endif"), True),
    (api, "clean", "/// @file\n/// A header.\n\n/// Does nothing.\nvoid iw_f(void);\n", False),
    (api, "a function without a word", "/// @file\n/// A header.\n\nvoid iw_f(void);\n", True),
    (api, "a member without a word", "/// @file\n/// A header.\n\n/// A struct.\ntypedef struct {\n    int a;\n} iw_a_t;\n", True),
    (api, "a header that Doxygen would skip", "/// A header.\nvoid iw_f(void);\n", True),
    (pages, "clean", ("app/b.c", "other", "another"), False),
    (pages, "a version with one line more than permitted", ("CHANGELOG.md", "2026-11-20\n", "2026-11-20\n- one more\n"), True),
    (pages, "a changelog without versions", ("CHANGELOG.md", "## ", ""), True),
    (pages, "a file more has the example", ("app/b.c", "other", "follow_ms"), True),
    (pages, "a listed file no longer has it", ("app/a.c", "follow_ms", "other"), True),
    (pages, "a listed file is not there", ("docs/developer/how-to-add.md", "1. ", "1. `app/c.c`: gone.\n2. "), True),
    (pages, "a list without its pattern", ("docs/developer/how-to-add.md", "pattern", "patern"), True),
    (pages, "an entry that the index lacks", ("test/more", "", "x\n"), True),
    (pages, "a page for users that the index lacks", (f"{USER_PAGES}/more.md", "", "x\n"), True),
    (pages, "a source that names a missing page", ("app/b.c", "int other;", f"int other; // {USER_PAGES}/gone.md"), True),
    (pages, "a link without a target", ("docs/developer/how-to-add.md", "there.", "[there](../gone.md)."), True),
    (pages, "a link and a name with targets", ("docs/developer/how-to-add.md", "there.", "[docs/README.md](../README.md)."), False),
    (pages, "an indexed entry that is not there", ("scripts/README.md", "one.py", "two.py"), True),
    (python_pins, "clean", ("tool", "sh", "sh"), False),
    (python_pins, "a pin without a checksum", ("requirements/check.txt", r"^(pyte==[^\\\n]+) \\\n(?:    --hash.*\n)+", r"\1\n"), True),
    (python_pins, "a pin for one Python only", ("requirements/demo.txt", r"^(cyclonedds==\S+ ; )", r'\1python_version == "3.13" and '), True),
    (python_pins, "a requirement that is not pinned", ("requirements/pyproject.toml", r'^    "lizard==.*$', '    "lizard==9.9",'), True),
    (python_pins, "an unused pin", ("requirements/pyproject.toml", r'^    "lizard==.*$', ""), True),
    (python_pins, "a program that calls pip without checksums", ("tool", "--require-hashes ", ""), True),
    (python_wheels, "clean", "one==1 --hash=sha256:{one}\ntwo==1 --hash=sha256:{two}\n", False),
    (python_wheels_there, "clean", "one==1 --hash=sha256:{one}\ntwo==1 --hash=sha256:{two}\n", False),
    (python_wheels_there, "a wheel with another checksum", "one==1 --hash=sha256:{one}\ntwo==1 --hash=sha256:{other}\n", True),
    (python_wheels_there, "a wheel without checksum", "one==1 --hash=sha256:{one}\ntwo==1\n", True),
    (python_wheels_there, "a wheel that does not fit this Python", "one==1 --hash=sha256:{one}\ntwo==2 --hash=sha256:{two}\n", True),
    (sizes, "clean", {"permit": [2039], "core": [9100]}, False),
    (sizes, "3 % larger", {"permit": [2060], "core": [9060]}, True),
    (sizes, "a module more", {"permit": [2000], "core": [9000], "new": [1]}, True),
    (sizes_of_image, "clean", [60688, 17688, 1584], False),
    (sizes_of_image, "too little flash free", [60689, 17688, 1584], True),
    (sizes_of_image, "too little RAM free", [60688, 17689, 1584], True),
    (sizes_of_use, "clean", "", False),
    (sizes_of_use, "a module that nothing calls", "iw_observation_init", True),
    (mutation, "seen", "killed", False),
    (mutation, "lives", "lives", True),
    (around, "seen", ("daemon_motion", {}, True), False),
    (around, "lives, and its reason is known", ("!", {"a.c | f | x; | y;": "a reason"}, True), False),
    (around, "lives", ("!", {}, True), True),
    (around, "is known to live, and is killed", ("daemon_motion", {"a.c | f | x; | y;": "a reason"}, True), True),
    (around, "is known to live, and no longer exists", ("", {"a.c | f | x; | y;": "a reason"}, False), True),
    (proofs, "clean", str, False),
    (proofs, "a proof with fewer single tests", lambda table: re.sub(r"^(unit.functions,.*),\d+,check$", r"\1,9999,check", table, flags=re.M), True),
    (proofs, "a proof that is gone", lambda table: table + "unit.gone,x,./check unit,1,check\n", True),
    (man, "clean", ("iwheelctl.1.scd", "", ""), False),
    (man, "a verb whose page is not what it prints", ("iwheelctl.1.scd", "REASON appears", "REASON is shown"), True),
    (man, "an option that a program no longer has", ("iwheel-gateway.1.scd", "--listen-only ", "--listen "), True),
    (man, "a verb without a summary", ("iwheelctl.1.scd", "  disarm   the same as stop\n", ""), True),
    (man, "a command that the simulator does not have", ("iwheel-sim.1.scd", "unmute left", "unmuted left"), True),
    (proofs, "a step without a row", lambda table: re.sub(r"^demo,.*\n", "", table, flags=re.M), True),
    (proofs, "a proof that changes its list", lambda table: re.sub(r"^(kernel.check,.*),check$", r"\1,full", table, flags=re.M), True),
    (counting, "clean", junit("run", "3 Tests 0 Failures 0 Ignored"), False),
    (counting, "a failed test", junit("fail", "3 Tests 1 Failures 0 Ignored"), True),
    (counting, "a failed Python test", junit("fail", "Ran 5 tests in 0.1s\n\nFAILED (failures=1, skipped=1)"), True),
    (counting, "a crash before the sum", junit("fail", "test.c:1:test_a:PASS"), True),
    (null, "clean", "/dev/null", False),
    (null, "a file instead of /dev/null", "file", True),
    (counting, "a crash after the sum", junit("fail", "3 Tests 0 Failures 0 Ignored"), True),
]


def params():
    for case in CASES:
        yield pytest.param(*case, id=f"{case[0].__name__}: {case[1]}", marks=[pytest.mark.together(case[0].__name__)] if case[0] in (proofs, eva_core) else [])


@pytest.mark.parametrize(("gate", "name", "argument", "must_catch"), [*params()])
def test_gate(tmp_path, gate, name, argument, must_catch):
    tool = next((tool for tool, gates in TOOLS.items() if gate in gates), "python3")
    if not (importlib.util.find_spec(tool) if tool == "lizard" else shutil.which(tool)):
        pytest.skip(f"{tool} is missing")
    status, output = gate(tmp_path, argument)
    if status == 77:
        pytest.skip(output.strip().removeprefix("skip: "))
    assert "Traceback" not in output and (status != 0) == must_catch, f"{'not found' if must_catch else 'found although clean'}\n{output}"
