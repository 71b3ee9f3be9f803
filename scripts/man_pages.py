#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Prints a manual page in scdoc's form: the page of man/, in which the output of the programs and documents of this tree replace the lines

    ; file FILE...       unchanged files of this tree, in one block
    ; document FILE      a document of this tree, from Markdown
    ; header FILE        the contract in a public header
    ; iwheelctl          the output of `iwheelctl --help`
    ; verbs              the same for each of its verbs

usage: man_pages.py PAGE.scd [--depends FILE PAGE]    writes the sources of PAGE into FILE, in the form of make

It does not run the programs, so a cross build makes the same pages. No tool does it: scdoc includes no files and reads no Markdown; help2man runs programs.
"""

import argparse
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LINE = re.compile(r"^; (\S+)((?: \S+)*)\n", re.MULTILINE)
UNDERLINE = re.compile(r"([_*\\])")


def literal(text):
    return "```\n" + text.rstrip("\n").replace("\\", "\\\\") + "\n```\n"


class Sources:
    def __init__(self):
        self.used = []

    def read(self, name):
        path = os.path.join(ROOT, name)
        self.used.append(path)
        with open(path, encoding="utf-8") as file:
            return file.read()

    def verb_pages(self):
        """Returns the pages of the verbs in the order of the program's table."""
        return {verb: self.read(f"app/ctl/help/{verb}.txt") for verb in re.findall(r"^    VERB\((\w+),", self.read("app/ctl/talk/ctl.h"), re.MULTILINE)}

    def iwheelctl(self):
        """Returns the output of help_print() of iwheelctl."""
        summaries = "".join(f"  {verb:<9}{page.split(f'{verb}: ', 1)[1].split(chr(10), 1)[0]}\n" for verb, page in self.verb_pages().items())
        return literal(self.read("app/ctl/help/iwheelctl.txt").replace("\nVERBS\n", "\n" + summaries, 1))

    def verbs(self):
        return "\n".join(f"## {verb}\n\n" + literal(page) for verb, page in self.verb_pages().items())

    def file(self, *names):
        return literal("".join(self.read(name) for name in names))

    def header(self, name):
        """Returns the header without the lines that only a compiler needs."""
        text = re.sub(
            r"^(#(?:if|ifdef|ifndef|else|endif|include)\b.*|#define IW\w+( __attribute.*)?|extern .*|// SPDX.*|/// @file|})\n", "", self.read(name), flags=re.M
        )
        return literal(re.sub(r"\n{3,}", "\n\n", text.replace("IWC_API ", "")))

    def document(self, name):
        return from_markdown(self.read(name))


def inline(text):
    """Converts Markdown within a line to scdoc. Code and emphasis become bold, links become their text."""
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


def main():
    parser = argparse.ArgumentParser(description="Prints a manual page in scdoc's form.")
    parser.add_argument("page", metavar="PAGE.scd")
    parser.add_argument("--depends", nargs=2, metavar=("FILE", "PAGE"), help="write the sources of PAGE into FILE, in the form of make")
    options = parser.parse_args()
    sources = Sources()
    sys.stdout.reconfigure(encoding="utf-8")

    def block(match):
        kind, names = match.groups()
        if kind not in ("file", "document", "header", "iwheelctl", "verbs"):
            sys.exit(f'{options.page}: there is no "; {kind}"')
        return getattr(sources, kind)(*names.split())

    print(LINE.sub(block, sources.read(os.path.abspath(options.page))), end="")
    if options.depends:
        file, page = options.depends
        with open(file, "w", encoding="utf-8") as out:
            out.write(f"{page}: " + " ".join(sources.used) + "\n")


if __name__ == "__main__":
    main()
