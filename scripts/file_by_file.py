# SPDX-License-Identifier: MIT
"""A tool over every file of ours that a build compiles. A file that passed is not looked at again until its text after
preprocessing, its flags, the tool or what the tool is told change."""
import concurrent.futures
import hashlib
import json
import shlex
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def commands_of(build, folders, root=ROOT):
    """[(name, compiler command)] of the files in these folders, each once."""
    found = {}
    for entry in json.loads((Path(build) / "compile_commands.json").read_text()):
        path = Path(entry["file"]).resolve()
        if path.is_relative_to(root) and str(path.relative_to(root)).startswith(folders):
            found[str(path.relative_to(root))] = shlex.split(entry["command"])
    return sorted(found.items())


def with_output(command, *instead):
    """The command without -c and -o, and with that instead."""
    words, skip = [], False
    for word in command:
        if not skip and word not in ("-c", "-o"):
            words.append(word)
        skip = word == "-o"
    return [*words, *instead]


def look_at_all(commands, look, passed, tool, jobs):
    """{name: what `look(name, command)` found}, without those in which it finds nothing. `passed`: the folder of what passed."""
    passed.mkdir(parents=True, exist_ok=True)

    def judge(item):
        name, command = item
        text = subprocess.run(with_output(command, "-E", "-C"), capture_output=True, check=True).stdout  # A comment can silence a tool.
        stamp = passed / hashlib.sha256(b"\0".join((text, " ".join((name, *command)).encode(), tool))).hexdigest()
        said = "" if stamp.exists() else look(name, command)
        if not said:
            stamp.touch()
        return name, said

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        return {name: said for name, said in pool.map(judge, commands) if said}


def tell(commands, found):
    """The exit status, told."""
    for said in found.values():
        print(said, end="")
    print(f"{len(commands)} files, {len(found)} with findings: {' '.join(found)}")
    return 1 if found or not commands else 0
