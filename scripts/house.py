#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Checks the structure of the sources against docs/developer/architecture.md, docs/developer/how-to-add.md and the indexes. Fails if one of them is wrong.

usage: house.py facts|layers|pages|pins [ROOT]

facts    the table of facts in docs/developer/architecture.md, each with its limit. The sources outside core/ and test/ in the compilation databases of BUILDS are
         compiled once more, with the members of `iw_gateway_t` renamed: a source that uses a member does not compile.
layers   permitted includes: every include from one library or program into another must be in the table of docs/developer/architecture.md. And the name
         of a source or header file belongs to one file of core, lib, port and app.
pages    the indexes of test/, scripts/ and docs/; links of Markdown, and names of pages in every file: each must exist; and the lists of
         docs/developer/how-to-add.md. A list follows a comment `<!-- pattern: REGEX  in: PLACE... -->`: it must contain exactly the files in those places
         that have the pattern, each after its number. The list may also contain files of test/ that have the pattern. And a version in CHANGELOG.md
         has at most CHANGES lines.
pins     the lists of requirements/: every package that pyproject.toml requires is pinned for each Python and machine, with checksums, and no program
         of the tree calls pip without checksums.

No tool does it: clang-tidy has no check of includes between folders, and include-what-you-use judges one file; `uv lock --check` compares with uv.lock, not with lists for pip.
"""

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(sys.argv[2] if len(sys.argv) > 2 else Path(__file__).resolve().parent.parent).resolve()
BUILDS = ("default", "arm", "arm-m3")
HEADERS = ROOT / "core/include"
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*["<]([^">]+)[">]', re.MULTILINE)
TELEMETRY = ("SPEED", "STATUS", "FORCE", "OFFSET", "POSE")
PRODUCTION = ("core", "lib", "port", "app")
DEPTH = {"core": 4, "app/bridge/ros2": 6}  # All others: 5.
OUTSIDE = ("lib", "port", "app", "examples", "zephyr")
# Names that several files may have. CMakeLists.txt, help.txt and README.md are neither source nor header, and their folder identifies them.
SEVERAL = {"main.c": "one for each program", "board.h": "one for each board; the build chooses the folder"}


def sources(*folders):
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.[ch]"))


def name(path):
    return str(path.relative_to(ROOT))


def files_of_a_message():
    """Returns the production files that name every telemetry message: a new message changes all of them."""
    texts = {path: path.read_text() for path in sources(*PRODUCTION)}
    of = [
        {path for path, text in texts.items() if re.search(rf"\bIW_(CODEC|ID_LEFT|ID_RIGHT|DLC)_{kind}\b|\biw_codec_{kind.lower()}_t\b", text)}
        for kind in TELEMETRY
    ]
    return sorted(name(path) for path in set.intersection(*of))


def public_headers():
    return sorted(path.name for path in (HEADERS / "iwheel").glob("*.h"))


def depth(path, folders, known):
    """Returns the depth of the includes below this file, through headers in these folders and in its own folder."""
    if path not in known:
        known[path] = 0  # Ends the recursion in a circle.
        for included in INCLUDE.findall(path.read_text()):
            found = next((folder / included for folder in (path.parent, *folders) if (folder / included).is_file()), None)
            if found:
                known[path] = max(known[path], 1 + depth(found.resolve(), folders, known))
    return known[path]


def deepest(component):
    """Returns (levels, name) of the file with the deepest includes within its own library or program."""
    known, folders = {}, [ROOT / component / folder for folder in ("include", "src", ".")]
    return max(((depth(path.resolve(), folders, known), name(path)) for path in sources(component)), default=(0, component))


def private_includes():
    return sorted(
        f"{name(path)} includes {included}" for path in sources(*OUTSIDE) for included in INCLUDE.findall(path.read_text()) if "iwheel/private/" in included
    )


def members_renamed(folder):
    """Writes a copy of the core's headers in which the members of `iw_gateway_t` have other names."""
    subprocess.run(["cp", "-r", str(HEADERS / "iwheel"), folder], check=True)
    path = Path(folder) / "iwheel/gateway.h"
    head, body, tail = re.fullmatch(r"(.*typedef struct iw_gateway \{\n)(.*?)(\n\} iw_gateway_t;.*)", path.read_text(), re.DOTALL).groups()
    path.write_text(head + re.sub(r"(\w+)((?:\[\w+\])?;)", r"\1_of_the_core\2", body) + tail)


def compiled_anew(job):
    entry, folder = job
    command = [word for word in shlex.split(entry["command"]) if word not in ("ccache", "-c")]
    command[command.index("-o") : command.index("-o") + 2] = ["-fsyntax-only"]
    command = [word.replace(str(HEADERS), folder) for word in command]
    run = subprocess.run(command, cwd=entry["directory"], capture_output=True, text=True, check=False)
    return [line for line in run.stderr.splitlines() if "error:" in line]


def uses_of_parts(builds):
    entries = {}
    for build in builds:
        for entry in json.loads((build / "compile_commands.json").read_text()):
            file = os.path.relpath(entry["file"], ROOT)
            if file.startswith(tuple(f"{folder}/" for folder in OUTSIDE)) and file.endswith(".c"):
                entries.setdefault(file, entry)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as pool:
        members_renamed(folder)
        found = [line for lines in pool.map(compiled_anew, ((entry, folder) for entry in entries.values())) for line in lines]
    return len(entries), found


def arrows(program):
    """Returns the includes between the folders of a program: {(from, to)}, the folders ("." is the program's own), and headers
    that are included without their folder."""
    files = {path.relative_to(program) for path in program.rglob("*.[ch]")}
    names = {path.name: path for path in files}
    used, bare = set(), []
    for path in files:
        for included in INCLUDE.findall((program / path).read_text()):
            if path.parent / included in files:
                there = path.parent / included
            elif Path(included) in files:
                there = Path(included)
            else:
                bare += [f"{name(program / path)} includes {included} without its folder"] if included in names and "/" not in included else []
                continue
            if there.parent != path.parent:
                used.add((str(path.parent), str(there.parent)))
    return used, sorted({str(path.parent) for path in files}), bare


def needing_each_other(used):
    """Returns the folders that lie on a circle of includes."""
    ways = set(used)
    for middle in {way[0] for way in used}:
        ways |= {(a, d) for a, b in ways for c, d in ways if b == middle == c}
    return sorted({a for a, b in ways if a == b})


def fact_of_arrows(program, limit):
    """Prints the number of includes between the folders of a program as a share of the possible ones. Returns the findings."""
    used, folders, bare = arrows(ROOT / program)
    possible = len(folders) * (len(folders) - 1) // 2
    circle = needing_each_other(used)
    percent = 100 * len(used) / possible
    print(f"includes between the folders of {program}, its own among them: {len(used)} of {possible} pairs ({percent:.1f} %, limit {limit} %)")
    return [
        *bare,
        *([f"{program}: these include each other: {', '.join(circle)}"] if circle else []),
        *([f"{len(used)} includes between the folders of {program}"] if percent > limit else []),
    ]


def facts():
    builds = [ROOT / "build" / build for build in BUILDS if (ROOT / "build" / build / "compile_commands.json").is_file()]
    compiled, parts = uses_of_parts(builds)
    counted = [
        ("files that name every telemetry message", files_of_a_message(), 8),
        ("public headers of the core", public_headers(), 11),
        ("private headers included outside the core", private_includes(), 0),
        (f"parts of iw_gateway_t named outside the core, in {compiled} files compiled", parts, 0),
        (
            "lines of app/gateway that name gw_daemon_t",
            [line.strip() for path in sources("app/gateway") for line in path.read_text().splitlines() if "gw_daemon_t" in line],
            60,
        ),
    ]
    findings = ["nothing was compiled: cmake --preset default first"] if compiled == 0 else []
    for what, found, limit in counted:
        print(f"{what}: {len(found)} (limit {limit})")
        findings += [f"{what}: {one}" for one in found] if len(found) > limit else []
    levels = {component: deepest(component) for component in permitted()}
    for component, (count, where) in sorted(levels.items()):
        limit = DEPTH.get(component, 5)
        print(f"include depth of {component}: {count} (limit {limit}), at {where}")
        findings += [f"{where} includes {count} levels deep"] if count > limit else []
    return [*findings, *fact_of_arrows("app/gateway", 42), *fact_of_arrows("app/ctl", 40)]


# ---- layers ---------------------------------------------------------------------------------------------------------

ARCHITECTURE = "docs/developer/architecture.md"
ROW = re.compile(r"^\| `([\w/]+)` \| ((?:`[\w/]+`(?:, )?)+|none) \|$", re.MULTILINE)


def permitted():
    """Returns {library or program: those that it may include}, from the table under its heading."""
    table = (ROOT / ARCHITECTURE).read_text().partition("\n## Permitted includes\n")[2].partition("\n## ")[0]
    return {who: set(re.findall(r"`([\w/]+)`", whom)) for who, whom in ROW.findall(table)}


def owner(path, names):
    """Returns the longest name in the table whose folder contains the file."""
    return max((name for name in names if path.as_posix().startswith(f"{name}/")), key=len, default=path.parts[0])


def layers():
    table = permitted()
    files = [path.relative_to(ROOT) for path in sources(*PRODUCTION)]
    owners = {path: owner(path, table) for path in files}
    named = {}
    for path in files:
        named.setdefault(path.name, []).append(path)
    wrong, used = [], set()
    for path in files:
        for included in INCLUDE.findall((ROOT / path).read_text()):
            plain = re.sub(r"^(?:.*/)?\.\./", "", included)  # A path with ../ also ends in the name of a file.
            there = {owners[other] for other in named.get(Path(plain).name, ()) if f"/{other.as_posix()}".endswith(f"/{plain}")}
            if there and owners[path] not in there:
                there = there & table.get(owners[path], set()) or there  # If several files have that name, the permitted one is meant.
                used |= {(owners[path], other) for other in there}
                wrong += [f"{path} includes {included} of {other}" for other in sorted(there - table.get(owners[path], set()))]
    unused = sorted(f"{who} -> {whom}" for who, all_of in table.items() for whom in all_of if (who, whom) not in used)
    strangers = sorted(set(owners.values()) - set(table))
    wrong += [f"rename one of these: {', '.join(map(str, same))}" for one, same in named.items() if len(same) > 1 and one not in SEVERAL]
    wrong += [f"remove {one} from SEVERAL: no two files have this name" for one in SEVERAL if len(named.get(one, ())) < 2]
    wrong += [f"{stranger} is not in the table of {ARCHITECTURE}" for stranger in strangers] + [
        f"{ARCHITECTURE} permits {pair}, which no file needs" for pair in unused
    ]
    print(f"{len(files)} files of {len(table)} libraries and programs, {len(used)} permitted includes")
    return wrong or ([] if table else [f"{ARCHITECTURE} has no table"])


# ---- pages ----------------------------------------------------------------------------------------------------------

PAGE = "docs/developer/how-to-add.md"
CHANGES = 80
MARK = re.compile(r"<!-- pattern: (.+?)  in: (.+?) -->\n")


def files(*places):
    """Returns the files that git tracks or would add; without git all files."""
    run = subprocess.run(["git", "-C", ROOT, "ls-files", "-co", "--exclude-standard", "--", *places], capture_output=True, text=True, check=False)
    names = (
        run.stdout.split("\n")
        if run.returncode == 0
        else [str(path.relative_to(ROOT)) for place in places for path in ([ROOT / place] if (ROOT / place).is_file() else (ROOT / place).rglob("*"))]
    )
    return sorted(name for name in set(names) if name and (ROOT / name).is_file())


def line_of(name, pattern):
    """Returns the number of the first line with the pattern, or None."""
    text = (ROOT / name).read_text(errors="replace") if (ROOT / name).is_file() else ""
    found = re.search(pattern, text)
    return text.count("\n", 0, found.start()) + 1 if found else None


def judge_list(title, section):
    mark = MARK.search(section)
    if not mark:
        return [f'{PAGE}, "{title}": the list has no comment `<!-- pattern: REGEX  in: PLACE... -->`']
    pattern, places = mark[1], mark[2].split()
    listed = [name for line in re.findall(r"^\d+\. .*$", section, re.MULTILINE) for name in re.findall(r"^\d+\. `([^`]+)`", line)]
    there = {name: line for name in files(*places) if (line := line_of(name, pattern))}
    where = f'{PAGE}, "{title}"'
    wrong = [f"{where}: add a numbered line for `{name}`, which has the pattern in line {line}" for name, line in there.items() if name not in listed]
    for name in listed:
        if not (ROOT / name).is_file():
            wrong.append(f"{where}: `{name}` does not exist: remove its line, or name the file that replaces it")
        elif not line_of(name, pattern):
            wrong.append(f"{where}: remove the line of `{name}`: it does not contain {pattern} any more")
    wrong += [f"{where}: `{name}` is listed twice" for name in set(listed) if listed.count(name) > 1]
    others = [name for name in re.findall(r"`([\w./-]+/[\w.-]+\.\w+)`", MARK.sub("", section)) if not (ROOT / name).exists()]
    return wrong + [f"{where}: `{name}` does not exist" for name in sorted(set(others) - set(listed))]


def judge_how_to_add():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    sections = re.findall(r"^## (.+)\n((?:(?!^## ).*\n)*)", text, re.MULTILINE)
    found = [line for title, section in sections for line in judge_list(title, section)]
    return found if sections else [f"{PAGE}: it has no list"], len(sections)


def entry(parts, deep):
    """Returns the entry of an index for a path below its folder: the file or its top folder. The folders in `deep` have one entry per file."""
    depth = 2 if parts[0] in deep else 1
    return "/".join(parts[:depth]) + ("/" if len(parts) > depth else "")


def judge_index(folder, deep=()):
    page = f"{folder}/README.md"
    indexed = re.findall(r"^\| `([^`]+)` \|", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    entries = {entry(name.split("/")[1:], deep) for name in files(folder)} - {"README.md"}
    wrong = [f"{page}: add a line `| \\`{name}\\` | its purpose |`" for name in sorted(entries - set(indexed))]
    return wrong + [f"{page}: remove the line of `{name}`: it does not exist" for name in sorted(set(indexed) - entries)], len(entries)


PAGE_NAMED = re.compile(r"(?<![\w/.-])docs/[\w./-]+\.(?:md|csv|png)\b")
LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]+)")


def judge_names():
    """Returns the pages and links that do not exist: pages are named from the root, links of Markdown are relative to their page."""
    wrong, count = [], 0
    for file in files("."):
        text = (ROOT / file).read_text(errors="replace")
        named = [(found, ROOT / found[0]) for found in PAGE_NAMED.finditer(text)]
        if file.endswith(".md"):
            named += [(found, (ROOT / file).parent / found[1]) for found in LINK.finditer(text)]
        count += len(named)
        wrong += [f"{file}:{text.count(chr(10), 0, found.start()) + 1}: {there} does not exist" for found, there in named if not there.exists()]
    return [line.replace(f"{ROOT}/", "") for line in wrong], count


def judge_changelog():
    versions = re.findall(r"^## (.+)\n((?:(?!^## ).*\n)*)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    lengths = {version: sum(bool(line.strip()) for line in text.splitlines()) + 1 for version, text in versions}
    wrong = [f"CHANGELOG.md: {version} has {lines} lines: shorten it to {CHANGES}" for version, lines in lengths.items() if lines > CHANGES]
    return wrong if lengths else ["CHANGELOG.md: it has no version"]


def pages():
    findings, lists = judge_how_to_add()
    findings += judge_changelog()
    more, names = judge_names()
    findings += more
    print(f"{names} names of pages and links")
    for folder, deep in {"test": (), "scripts": (), "docs": ("user", "developer")}.items():
        more, entries = judge_index(folder, deep)
        findings += more
        print(f"index of {folder}/: {entries} entries")
    print(f"{PAGE}: {lists} lists")
    return findings


# ---- pins -----------------------------------------------------------------------------------------------------------

PYTHONS, MACHINES = ("3.11", "3.12", "3.13"), ("x86_64", "aarch64")
PIN = re.compile(r"^([\w.-]+)==([^\s;]+)(?: ; ([^\\\n]+?))?((?: *\\\n? *--hash=sha256:[0-9a-f]{64})*)\n((?:    # .*\n)*)", re.MULTILINE)
# Calls of pip in this tree, and the options that make them safe.
CALLS_PIP = re.compile(r"""(?:\bpip3?"?|/pip"|"pip",)\s+"?install\b""")
SAFE = re.compile(r"--require-hashes|--no-index|\(pip install|^\s*#")


def requirements(group, table):
    return [requirement for one in table[group] for requirement in (requirements(one["include-group"], table) if isinstance(one, dict) else [one])]


def pins_of_group(group, table):
    from pip._vendor.packaging.markers import Marker
    from pip._vendor.packaging.requirements import Requirement

    file = f"requirements/{group}.txt"
    found = [
        (name.lower(), version, Marker(marker or "os_name != ''"), sums, via) for name, version, marker, sums, via in PIN.findall((ROOT / file).read_text())
    ]
    wanted = [Requirement(requirement) for requirement in requirements(group, table)]
    print(f"{file}: {len(found)} pins of {len(wanted)} requirements")
    yield from (f"{file}: {name} {version} has no checksum" for name, version, _, sums, _ in found if not sums)
    yield from (
        f"{file}: {name} is pinned, but not required"
        for name, *_, via in found
        if "via" not in via and name not in {requirement.name for requirement in wanted}
    )
    for requirement, python, machine in ((requirement, python, machine) for requirement in wanted for python in PYTHONS for machine in MACHINES):
        where = {"python_version": python, "python_full_version": f"{python}.0", "platform_machine": machine, "sys_platform": "linux"}
        fits = [name for name, version, marker, *_ in found if name == requirement.name and requirement.specifier.contains(version) and marker.evaluate(where)]
        if len(fits) != 1 and (requirement.marker is None or requirement.marker.evaluate(where)):
            yield f"{file}: {requirement}: {len(fits)} pins for Python {python} on {machine}; write the list again: see pyproject.toml"


def pins():
    import tomllib

    table = tomllib.loads((ROOT / "requirements/pyproject.toml").read_text())["dependency-groups"]
    wrong = [what for group in table for what in pins_of_group(group, table)]
    for file in (file for file in files(".") if os.access(ROOT / file, os.X_OK)):
        for number, line in enumerate((ROOT / file).read_text(errors="replace").splitlines(), 1):
            if CALLS_PIP.search(line) and not SAFE.search(line):
                wrong.append(f"{file}:{number}: pip without --require-hashes or --no-index")
    return wrong


def main(arguments):
    what = {"facts": facts, "layers": layers, "pages": pages, "pins": pins}.get(arguments[1] if len(arguments) in (2, 3) else "")
    if what is None:
        sys.exit(__doc__)
    findings = what()
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
