# SPDX-License-Identifier: MIT
"""All mutants of a file of the core: from clang's syntax tree, one small change each."""

import json
import re
import subprocess
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent.parent
CORE, PUBLIC = ROOT / "core/src", ROOT / "core/include/iwheel"
# Macros that are only hints: their arguments are parsed as if the macros were absent.
HINTS = ("IW_CODEC_LIKELY",)
OPERATORS = {
    "<": ("<=", ">="),
    "<=": ("<", ">"),
    ">": (">=", "<="),
    ">=": (">", "<"),
    "==": ("!=",),
    "!=": ("==",),
    "&&": ("||",),
    "||": ("&&",),
    "+": ("-",),
    "-": ("+",),
    "*": ("/",),
    "/": ("*",),
    "%": ("/",),
    "&": ("|",),
    "|": ("&",),
    "^": ("|",),
    "<<": (">>",),
    ">>": ("<<",),
    "+=": ("-=",),
    "-=": ("+=",),
    "|=": ("&=",),
    "&=": ("|=",),
    "<<=": (">>=",),
    ">>=": ("<<=",),
    "*=": ("/=",),
    "/=": ("*=",),
    "%=": ("/=",),
}
SIDES = {"IW_LEFT": "IW_RIGHT", "IW_RIGHT": "IW_LEFT"}


class Mutant(NamedTuple):
    file: str
    function: str
    kind: str
    begin: int
    end: int
    text: str  # The replacement.

    def apply(self, source):
        return source[: self.begin] + self.text + source[self.end :]

    def key(self, source):
        """A name without line numbers: the line before and after the change."""
        from_line, to_line = source.rfind("\n", 0, self.begin) + 1, source.find("\n", self.end)
        before = " ".join(source[from_line:to_line].split())
        after = " ".join((source[from_line : self.begin] + self.text + source[self.end : to_line]).split())
        return f"{self.file} | {self.function} | {before} | {after}"


def place(location):
    """(offset, length, True if it comes from a macro)"""
    if "expansionLoc" in location:
        return location["expansionLoc"]["offset"], location["expansionLoc"]["tokLen"], True
    return location.get("offset"), location.get("tokLen", 0), False


def definitions(dump, names):
    """The syntax trees of these functions. Only they are parsed: nearly all of the dump comes from headers."""
    for text in dump.partition('\n  "inner": [\n    {')[2].rpartition("\n    }\n  ]")[0].split("\n    },\n    {"):
        name = '\n      "kind": "FunctionDecl",\n' in text and re.search(r'^      "name": "(\w+)",$', text, re.M)
        if name and name[1] in names:
            yield json.loads("{" + text + "}")


class Finder:
    """Walks the functions of one file."""

    def __init__(self, path, flags=("-std=c99", f"-I{PUBLIC.parent}", f"-I{CORE}"), name=None):
        self.path, self.source, self.found = Path(path), Path(path).read_text(), []
        self.name = name or self.path.name
        plain = re.sub(rf"(?<!#define )\b({'|'.join(HINTS)})(?=\()", lambda match: " " * len(match[1]), self.source)
        dump = subprocess.run(
            ["clang", "-Xclang", "-ast-dump=json", "-fsyntax-only", "-w", *flags, "-xc", "-"], input=plain, capture_output=True, text=True, check=True
        ).stdout
        names = set(re.findall(r"^[\w \*]*?\b(\w+)\([^;{}]*\) \{$", self.source, re.M))
        self.function = None
        for node in definitions(dump, names):
            body = [child for child in node.get("inner", ()) if child["kind"] == "CompoundStmt"]
            if body:
                self.function, self.declaration = node["name"], node
                self.visit(body[0], None)

    def add(self, kind, span, text):
        if span and re.search(rf"\b({'|'.join(HINTS)})$", self.source[: span[0]]):
            text = f"({text})"
        if span and self.source[span[0] : span[1]] != text:
            self.found.append(Mutant(self.name, self.function, kind, *span, text))

    def span(self, node):
        """Where it is in the file; None inside a macro that has arguments."""
        begin, _, in_macro = place(node["range"]["begin"])
        end, length, ends_in_macro = place(node["range"]["end"])
        if begin is None or end is None:
            return None
        for macro, at in ((in_macro, begin), (ends_in_macro, end)):
            if macro and re.match(r"\w+\(", self.source[at:]):
                return None
        return begin, end + (len(re.match(r"\w*", self.source[end:])[0]) if ends_in_macro else length)

    def visit(self, node, parent):
        kind = node.get("kind")
        handler = getattr(self, f"visit_{kind}", None)
        if handler:
            handler(node)
        if kind == "CallExpr" and parent["kind"] not in ("CompoundStmt", "CStyleCastExpr") and node["type"]["qualType"] != "void":
            self.add("call", self.span(node), "0")
        if kind == "CaseStmt":
            node = {**node, "inner": node["inner"][1:]}
        for child in node.get("inner", ()):
            if "kind" in child:
                self.visit(child, node)

    def visit_BinaryOperator(self, node):
        left, right = (self.span(child) for child in node["inner"])
        operator = node["opcode"]
        if left and right and operator in OPERATORS:
            at = self.source.find(operator, left[1], right[0])
            if at >= 0:
                for other in OPERATORS[operator]:
                    self.add("operator", (at, at + len(operator)), other)
        if operator in ("&&", "||"):
            for span in (left, right):
                if span:
                    self.add("condition", span, "1" if operator == "&&" else "0")

    visit_CompoundAssignOperator = visit_BinaryOperator

    def visit_UnaryOperator(self, node):
        span, operator = self.span(node), node["opcode"]
        if not span:
            return
        if operator in ("!", "-", "~") and self.source[span[0]] == operator:
            self.add("operator", (span[0], span[0] + 1), "")
        elif operator in ("++", "--"):
            at = self.source.find(operator, *span)
            self.add("operator", (at, at + 2), "--" if operator == "++" else "++")

    def visit_IntegerLiteral(self, node):
        span = self.span(node)
        text = self.source[slice(*span)] if span else ""
        if text in ("true", "false"):
            self.add("constant", span, "false" if text == "true" else "true")
        elif re.fullmatch(r"[A-Z]\w+", text):
            self.add("constant", span, f"({text} + 1)")
        elif re.fullmatch(r"(0[xX][0-9a-fA-F]+|\d+)[uU]?[lL]*", text):
            value = int(node["value"])
            suffix = "U" if "U" in text.upper() else ""
            self.add("constant", span, f"{value + 1}{suffix}")
            if value > 0:
                self.add("constant", span, f"{value - 1}{suffix}")

    def visit_DeclRefExpr(self, node):
        span = self.span(node)
        if span and node["referencedDecl"]["kind"] == "EnumConstantDecl":
            text = self.source[slice(*span)]
            self.add("constant", span, SIDES.get(text, f"({text} + 1)"))

    def force(self, node):
        span = self.span(node)
        if span and self.source[slice(*span)] not in ("true", "false"):
            self.add("condition", span, "1")
            self.add("condition", span, "0")

    def visit_IfStmt(self, node):
        self.force(node["inner"][0])

    visit_ConditionalOperator = visit_IfStmt

    def visit_WhileStmt(self, node):
        span = self.span(node["inner"][0])
        if span:
            self.add("condition", span, "0")

    def visit_ReturnStmt(self, node):
        value = self.span(node["inner"][0]) if node.get("inner") else None
        if value:
            self.add("returned value", value, "0")
            self.add("returned value", value, "1")

    def visit_CompoundStmt(self, node):
        for child in node.get("inner", ()):
            if child["kind"] in ("CallExpr", "BinaryOperator", "CompoundAssignOperator", "UnaryOperator", "CStyleCastExpr", "BreakStmt"):
                span = self.span(child)
                if span:
                    self.add("statement", span, "")
            elif child["kind"] == "ReturnStmt" and not child.get("inner"):
                self.add("statement", self.span(child), "")


def function_spans(source):
    """{function: (begin, end)}"""
    return {match[1]: match.span() for match in re.finditer(r"^[\w \*]*?\b(\w+)\([^;{}]*\) \{$.*?^\}$", source, re.M | re.S)}


def functions(path):
    """{function: its text}, for finding out whether it changed."""
    source = Path(path).read_text()
    return {name: source[begin:end] for name, (begin, end) in function_spans(source).items()}


def files():
    """The core's sources and those headers of the core that contain functions."""
    headers = [path for folder in (PUBLIC, CORE) for path in sorted(folder.glob("*.h"))]
    return sorted(CORE.glob("*.c")) + [path for path in headers if functions(path)]


def mutants(path, finder=Finder):
    """Every change, each only once."""
    return list({(mutant.begin, mutant.end, mutant.text): mutant for mutant in reversed(finder(path).found)}.values())[::-1]
