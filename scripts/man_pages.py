#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Keeps the manual pages in man/ true: what the programs print about themselves is copied into them, between two comment lines.

usage: man_pages.py --check | --update [--build DIR]

    ; help PROGRAM       what `PROGRAM --help` prints
    ; verbs iwheelctl    the same for each of its verbs
    ; commands           what `iwheel-sim help` lists
    ; configuration      what `iwheel-gateway --print-config` makes of share/gateway.conf
    ; document FILE      a document of ours, from Markdown
    ; header FILE        the contract in a public header
    ; file FILE          a file of ours as it is
    ; end
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FOLDERS = {"iwheel-gateway": "gateway", "iwheelctl": "ctl", "iwheel-sim": "sim", "iwheel-ros2": "bridge/ros2", "iwheel-serial": "bridge/serial", "iwheel-web": "bridge/web",
           "iwheel-mqtt": "bridge/mqtt", "iwheel-fleet": "bridge/mqtt"}
BLOCK = re.compile(r"^; (help|verbs|commands|configuration|document|header|file)(?: (\S+))?\n(.*?)^; end\n", re.MULTILINE | re.DOTALL)
UNDERLINE = re.compile(r"([_*\\])")


def literal(text):
    return "```\n" + text.rstrip("\n").replace("\\", "\\\\") + "\n```\n"


class Sources:
    def __init__(self, build):
        self.build = build

    def program(self, name):
        return os.path.join(self.build, "app", FOLDERS[name], name)

    def output(self, name, *arguments):
        return subprocess.run([self.program(name), *arguments], check=True, capture_output=True, text=True).stdout

    def help(self, name):
        return literal(self.output(name, "--help"))

    def verbs(self, name):
        names = re.findall(r"^  ([a-z]+) {2,}\S", self.output(name, "--help"), re.MULTILINE)
        pages = [self.output(name, verb, "--help").split("\n", 1) for verb in names]
        return "\n".join(f"## {verb}\n\n" + literal(usage + "\n" + rest) for verb, (usage, rest) in zip(names, pages, strict=False))

    def commands(self, _):
        """The list of a running simulator."""
        with tempfile.TemporaryDirectory() as folder:
            control = os.path.join(folder, "control")
            command = [self.program("iwheel-sim"), "--quiet", "--can", f"unix:{folder}/bus", "--estop", f"{folder}/button"]
            with subprocess.Popen([*command, "--control", control], stdout=subprocess.DEVNULL) as simulator:
                while not os.path.exists(control) and simulator.poll() is None:
                    time.sleep(0.01)
                try:
                    return literal(self.output("iwheel-sim", "--control", control, "help"))
                finally:
                    simulator.terminate()

    def configuration(self, _):
        return literal(self.output("iwheel-gateway", "--print-config", "-c", os.path.join(ROOT, "share", "gateway.conf")))

    def file(self, name):
        with open(os.path.join(ROOT, name), encoding="utf-8") as file:
            return literal(file.read())

    def header(self, name):
        """Without what only a compiler needs."""
        with open(os.path.join(ROOT, name), encoding="utf-8") as file:
            text = re.sub(r"^(#(?:if|ifdef|ifndef|else|endif|include)\b.*|#define IW\w+( __attribute.*)?|extern .*|// SPDX.*|/// @file|})\n", "", file.read(), flags=re.M)
        return literal(re.sub(r"\n{3,}", "\n\n", text.replace("IWC_API ", "")))

    def document(self, name):
        with open(os.path.join(ROOT, name), encoding="utf-8") as file:
            return from_markdown(file.read())


def inline(text):
    """Markdown within a line, to scdoc. Code and emphasis are bold, links are their text."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    out = []
    for part in re.split(r"(`[^`]*`|\*\*[^*]+\*\*|\*[^*]+\*)", text):
        width = 2 if part.startswith("**") else 1
        marked = len(part) > 2 * width and part[0] in "`*"
        plain = UNDERLINE.sub(r"\\\1", part[width:-width] if marked else part)
        out.append(f"*{plain}*" if marked else plain)
    return "".join(out)


def table_row(line):
    cells = [inline(cell.strip().replace("\\|", "|")) for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
    head, *rest = cells
    return f"{head}\n\t" + (" · ".join(cell for cell in rest if cell) or "no fields") + "\n"


def from_markdown(text):
    out, code, fence = [], [], False
    for line in text.splitlines()[1:]:
        indented = line.startswith("    ") and not fence
        if line.startswith("```"):
            fence = not fence
        elif fence or indented:
            code.append(line[4:] if indented else line)
        else:
            if code:
                out.append(literal("\n".join(code)))
                code = []
            if line.startswith("#"):
                out.append(("\n" + line[1:].replace("## ", "## ", 1)) if line.startswith("##") else line)
            elif re.match(r"\|[-| :]+\|$", line):
                continue
            elif line.startswith("|"):
                out.append(table_row(line))
            elif line.startswith("  ") and out and out[-1].startswith("- "):
                out[-1] += " " + inline(line.strip())
            else:
                out.append(inline(line))
    if code:
        out.append(literal("\n".join(code)))
    return re.sub(r"\n{3,}", "\n\n", "\n".join(out).strip() + "\n")


def renew(text, sources):
    def block(match):
        kind, argument, _ = match.groups()
        first = f"; {kind}" + (f" {argument}" if argument else "")
        return f"{first}\n{getattr(sources, kind)(argument)}; end\n"

    return BLOCK.sub(block, text)


def main():
    parser = argparse.ArgumentParser(description="Keeps the manual pages true to what the programs print.")
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--check", action="store_true", help="fail if a page is not true any more")
    group.add_argument("--update", action="store_true", help="write them anew")
    parser.add_argument("--build", default=os.path.join(ROOT, "build", "default"))
    options = parser.parse_args()
    sources, stale = Sources(os.path.abspath(options.build)), []
    for name in sorted(os.listdir(os.path.join(ROOT, "man"))):
        path = os.path.join(ROOT, "man", name)
        if name == "iwheel-web.1.scd" and not os.path.exists(sources.program("iwheel-web")):
            print(f"note: man/{name} is not looked at: iwheel-web was not built, libmicrohttpd-dev or uPlot is missing")
            continue
        with open(path, encoding="utf-8") as file:
            text = file.read()
        if name == "iwheel-ros2.1.scd" and not os.path.exists(sources.program("iwheel-ros2")):
            print(f"note: man/{name} is not looked at: iwheel-ros2 was not built, cyclonedds-dev is missing")
            continue
        if name in ("iwheel-fleet.1.scd", "iwheel-mqtt.1.scd") and not os.path.exists(sources.program(name.split(".", maxsplit=1)[0])):
            print(f"note: man/{name} is not looked at: libmosquitto-dev or libnats-dev is missing")
            continue
        new = renew(text, sources)
        if new != text:
            stale.append(name)
            if options.update:
                with open(path, "w", encoding="utf-8") as file:
                    file.write(new)
    for name in stale:
        print(f"man/{name}: " + ("written anew" if options.update else "not true any more; run: scripts/man_pages.py --update"))
    return 1 if stale and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
