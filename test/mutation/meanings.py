# SPDX-License-Identifier: MIT
"""Semantic mutants of the code around the core: daemon, Linux port and STM32 driver. Each makes one mistake that a programmer could make."""

import itertools
import re

from mutants import SIDES, Finder

EFFECTS = ("CallExpr", "BinaryOperator", "CompoundAssignOperator", "UnaryOperator", "CStyleCastExpr")
LEAVES = ("ReturnStmt", "BreakStmt", "ContinueStmt", "GotoStmt")
CLOCKS = {"CLOCK_MONOTONIC": "CLOCK_REALTIME", "CLOCK_BOOTTIME": "CLOCK_MONOTONIC", "CLOCK_REALTIME": "CLOCK_MONOTONIC"}
TIME = re.compile(r"_(?:ns|us|ms|s)$", re.IGNORECASE)
LIMITS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "&&": "||", "||": "&&", "+": "-", "-": "+"}
# Calls that affect other processes: no test may run a mutant of them.
DANGEROUS = re.compile(r"\b(?:kill|killpg|reboot)\(")
OTHER = {"left": "right", "right": "left"}


def calls(node):
    """True if the node calls a function."""
    return node.get("kind") == "CallExpr" or any(calls(child) for child in node.get("inner", ()))


class Meanings(Finder):
    """Walks the functions of one file."""

    def text(self, node):
        span = self.span(node)
        return self.source[slice(*span)] if span else ""

    def visit(self, node, parent):
        if parent is None:
            self.times = [
                (child["name"], child["type"]["qualType"]) for child in self.declaration.get("inner", ()) if child["kind"] == "ParmVarDecl" and "name" in child
            ]
        handler = getattr(self, f"mean_{node.get('kind')}", None)
        if handler:
            handler(node)
        children = node.get("inner", ())
        for child in children[1:] if node.get("kind") == "CaseStmt" else children:
            if "kind" in child:
                self.visit(child, node)
        if node.get("kind") == "VarDecl":  # Usable only from here on: compilers warn of a variable that is used in its own initialiser.
            self.times.append((node["name"], node["type"]["qualType"]))

    def mean_IfStmt(self, node):
        condition, then = node["inner"][:2]
        span = self.span(condition)
        self.add("condition negated", span, f"!({self.text(condition)})")
        last = then["inner"][-1] if then["kind"] == "CompoundStmt" and then.get("inner") else then
        if last["kind"] in LEAVES and len(node["inner"]) == 2:
            self.add("error branch dropped", span, "0")

    def mean_ConditionalOperator(self, node):
        self.add("condition negated", self.span(node["inner"][0]), f"!({self.text(node['inner'][0])})")

    def mean_CompoundStmt(self, node):
        before, former, is_void = None, None, self.declaration["type"]["qualType"].startswith("void (")
        for number, child in enumerate(node.get("inner", ())):
            span = self.span(child) if child["kind"] in EFFECTS else None
            if span:
                self.add("effect dropped", span, "")
                if is_void and number > 0:
                    self.add("returns early", span, "return")
                if before and ";" not in self.source[slice(*before)] and not self.is_order_free(former, child):
                    between = self.source[before[1] : span[0]]
                    self.add("order of two effects", (before[0], span[1]), self.source[slice(*span)] + between + self.source[slice(*before)])
            before, former = span, child
            if child["kind"] == "ContinueStmt":
                self.add("event not skipped", self.span(child), "")

    def is_order_free(self, one, other):
        """True if the order of two statements has no effect: members of one object, independent assignments, or a log line next to a statement that it does not report."""
        texts = [self.text(node) for node in (one, other)]
        targets = [None if calls(node) else self.text(node["inner"][0]).lstrip("*") for node in (one, other)]
        logs = [text.startswith("sock_log(") for text in texts]
        if all(text.startswith("iwn_out_") for text in texts):
            return True
        if logs[0] != logs[1]:
            arguments, target = texts[logs.index(True)].partition(",")[2], targets[logs.index(False)]
            return target not in arguments if target else not re.search(r"->|\w\(", arguments)
        return all(targets) and targets[0] not in texts[1] and targets[1] not in texts[0]

    def mean_DeclRefExpr(self, node):
        span, declared = self.span(node), node["referencedDecl"]
        text = self.source[slice(*span)] if span else ""
        if declared["kind"] == "EnumConstantDecl" and text in SIDES:
            self.add("sides swapped", span, SIDES[text])
        if declared["kind"] in ("VarDecl", "ParmVarDecl") and TIME.search(text):
            others = [
                name
                for name, kind in self.times
                if name != text and TIME.search(name) and kind.removeprefix("const ") == declared["type"]["qualType"].removeprefix("const ")
            ]
            if others:
                self.add("wrong clock", span, others[0])

    def mean_MemberExpr(self, node):
        span = self.span(node)
        match = re.search(r"(left|right)(?=\w*$)", self.source[slice(*span)]) if span else None
        if match:
            self.add("sides swapped", (span[0] + match.start(), span[0] + match.end()), OTHER[match[1]])

    def mean_ArraySubscriptExpr(self, node):
        index = self.span(node["inner"][1])
        text = self.source[slice(*index)] if index else ""
        if text.endswith("side"):
            self.add("sides swapped", index, f"1 - {text}")

    def mean_IntegerLiteral(self, node):
        span = self.span(node)
        text = self.source[slice(*span)] if span else ""
        if text in CLOCKS:
            self.add("wrong clock", span, CLOCKS[text])
        elif text in ("true", "false"):
            self.add("flag inverted", span, "false" if text == "true" else "true")
        elif re.fullmatch(r"[A-Z]\w+", text) and TIME.search(text):
            self.add("off by a period", span, f"(2 * {text})")
            self.add("off by a period", span, f"({text} / 2)")
        elif re.fullmatch(r"[A-Z]\w+", text) and text != "NULL":
            self.add("constant off by one", span, f"({text} + 1)")
        elif re.fullmatch(r"\d+[uU]?[lL]*", text) and not self.source[: span[0]].endswith("-"):
            self.add("constant off by one", span, f"{int(node['value']) + 1}{'U' if 'U' in text.upper() else ''}")

    def mean_BinaryOperator(self, node):
        left, right = (self.span(child) for child in node["inner"])
        operator = node["opcode"]
        if left and right and operator in LIMITS:
            at = self.source.find(operator, left[1], right[0])
            if at >= 0:
                self.add("limit or operator", (at, at + len(operator)), LIMITS[operator])

    def mean_CallExpr(self, node):
        arguments = node["inner"][1:]
        for one, other in itertools.pairwise(arguments):
            a, b = self.span(one), self.span(other)
            if a and b and one["type"]["qualType"] == other["type"]["qualType"]:
                self.add("arguments swapped", (a[0], b[1]), self.source[slice(*b)] + self.source[a[1] : b[0]] + self.source[slice(*a)])

    def mean_ReturnStmt(self, node):
        value = node["inner"][0] if node.get("inner") else None
        if value and node["inner"][0]["type"]["qualType"] in ("bool", "_Bool") and self.text(value) not in ("true", "false"):
            self.add("wrong answer", self.span(value), f"!({self.text(value)})")
