"""Faults made from the code: what one token of a module could be instead, by rule.

A module's text is cut into tokens, which know comments, strings and the width of a literal. Its
statements are followed far enough to tell an expression from a declaration. Left out is what
computes nothing: ranges of declarations, parameter lists, the widths of casts, counts of
replications, parameter checks, and whatever is generated.

Most mutants of a module go into one text (``schemata``): each expression takes all its forms, and a
number, read from a file at the start of a simulation, says which one holds. So a module is built
once for all of them. A constant of the elaboration cannot do that; it has a text of its own.
"""

import random
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from pathlib import Path

from vrscan.engines.tools import repository_root, rtl_modules

_TOKEN = re.compile(
    r"""(?P<space>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<string>"(?:\\.|[^"\\])*")
    |(?P<number>\d[\d_]*\s*'s?[bdho][0-9a-fA-F_xzXZ?]+|'[01xz](?!\w)|\d[\d_]*)
    |(?P<name>[$`]?[A-Za-z_][\w$]*)
    |(?P<sign><<<=|>>>=|<<<|>>>|===|!==|==\?|!=\?|<->|<<=|>>=|\|->|\|=>|==|!=|<=|>=|&&|\|\||<<|>>
      |\+\+|--|\+=|-=|\*=|\|=|&=|\^=|\+:|-:|\*\*|::|->|'\(|'\{|~&|~\||~\^|.)""",
    re.X | re.S,
)
_OPEN = {"(": ")", "'(": ")", "[": "]", "{": "}", "'{": "}"}
_CLOSE = {")", "]", "}"}

# A binary operator, what it could be instead, and the name of the kind.
_OPERATORS = {
    "+": ("-", "arithmetic"),
    "-": ("+", "arithmetic"),
    "*": ("+", "arithmetic"),
    "<": ("<=", "comparison"),
    "<=": ("<", "comparison"),
    ">": (">=", "comparison"),
    ">=": (">", "comparison"),
    "==": ("!=", "equality"),
    "!=": ("==", "equality"),
    "&&": ("||", "logic"),
    "||": ("&&", "logic"),
    "&": ("|", "bitwise"),
    "|": ("&", "bitwise"),
    "^": ("|", "bitwise"),
    "<<": (">>", "shift"),
    ">>": ("<<", "shift"),
    "<<<": (">>>", "shift"),
    ">>>": (">>", "shift"),
}
_REDUCTIONS = {"&": "|", "|": "&"}
KINDS = (
    "arithmetic", "comparison", "equality", "logic", "bitwise", "shift", "inversion", "constant",
    "index", "condition", "assignment", "reset", "connection", "elaboration",
)  # fmt: skip

# The simulator's objections to a mutant are no verdict: its tests have to notice.
_QUIET = (
    "WIDTH", "UNSIGNED", "CMPCONST", "LATCH", "CASEINCOMPLETE", "CASEOVERLAP", "ENUMVALUE",
    "SELRANGE", "UNOPTFLAT", "MULTIDRIVEN", "ALWCOMBORDER",
)  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One change of a module's text.

    Attributes:
        file: The module's path in the repository.
        line, column: Where the change begins, from 1.
        kind: One of ``KINDS``.
        edits: (start, end, new) of the text, in order.
        place: Start and end of the expression or statement that has a form for it; None for a
            constant of the elaboration.
        old, new: The lines that change, before and after.
    """

    file: str
    line: int
    column: int
    kind: str
    edits: tuple[tuple[int, int, str], ...]
    place: tuple[int, int] | None
    old: str
    new: str

    @property
    def name(self) -> str:
        """Its name within the file, which stays as long as the file's text."""
        return f"{self.line}:{self.column} {self.kind} {self.new}"

    def within(self, text: str, start: int = 0, end: int | None = None) -> str:
        """Return the text, or the part of it that begins at ``start``, with the change."""
        end = len(text) if end is None else end
        made, at = "", start
        for first, last, new in self.edits:
            made += text[at:first] + new
            at = last
        return made + text[at:end]


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    start: int
    end: int


class _Unmade(ValueError):
    """An expression that cannot stand twice."""


class _Module:
    """Walks through the statements of a module and collects its mutants."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.text = text
        found = (_Token(str(m.lastgroup), m[0], *m.span()) for m in _TOKEN.finditer(text))
        self.tokens = [t for t in found if t.kind != "space"]
        self.mutants: list[Mutant] = []
        self.body = 0  # where the module's own text begins, behind its ports
        self.reset = False
        words = [t.text for t in self.tokens]
        # Functions that the elaboration calls cannot ask a signal.
        named = " ".join(re.findall(r"localparam\b[^;]*;", text))
        self.constant_functions = set(re.findall(r"(\w+)\s*\(", named))
        if "module" in words:
            self._items(self._header(words.index("module")))

    # ---- places in the list of tokens ----
    def _is(self, k: int, *words: str) -> bool:
        return k < len(self.tokens) and self.tokens[k].text in words

    def _closing(self, k: int) -> int:
        """Return the place of what closes the bracket at ``k``."""
        depth = 0
        while True:
            depth += self._is(k, *_OPEN) - self._is(k, *_CLOSE)
            if not depth:
                return k
            k += 1

    def _find(self, k: int, *words: str) -> int:
        """Return the next place of a word outside of brackets."""
        while not self._is(k, *words):
            k = self._closing(k) + 1 if self._is(k, *_OPEN) else k + 1
        return k

    # ---- the module ----
    def _header(self, k: int) -> int:
        k = self._find(k, ";")
        self.body = self.tokens[k].end
        return k + 1

    def _items(self, k: int) -> None:
        while not self._is(k, "endmodule"):
            k = self._item(k)

    def _item(self, k: int) -> int:
        token = self.tokens[k]
        if token.text == "localparam":
            end = self._find(k, ";")
            equals = self._find(k, "=")
            # A width that is too large changes nothing, one that is too small does not build.
            if not re.search(r"(Width|Bits)$", self.tokens[equals - 1].text):
                self._expression(equals + 1, end, static=True)
            return end + 1
        if token.text == "assign":
            equals, end = self._find(k, "="), self._find(k, ";")
            if not self.tokens[k + 1].text.startswith("unused"):  # said for the linter only
                self._expression(equals + 1, end)
            return end + 1
        if token.text in ("always_ff", "always_comb"):
            k += 1
            if self._is(k, "@"):
                k = self._closing(k + 1) + 1
            return self._statement(k, clocked=token.text == "always_ff")
        if token.text == "function":
            return self._function(k)
        if token.text == "initial":
            before = len(self.mutants)
            k = self._statement(k + 1)
            del self.mutants[before:]  # tables, which the host fills
            return k
        if token.text == "if":
            end = self._closing(k + 1) + 1
            if self._is(end, "begin") and self.tokens[end + 2].text.startswith("gen_bad"):
                return self._find(end, "end") + 1
            return end
        if token.text == "for":
            return self._closing(k + 1) + 1
        if token.text in ("begin", "end", "else", "generate", "endgenerate"):
            return k + 1
        if token.text == ":":
            return k + 2
        if token.kind == "name" and self._is(k + 1, "#"):
            end = self._closing(k + 2)
            self._connections(k + 3, end, static=True)
            return self._instance(end + 1)
        if token.kind == "name" and self.tokens[k + 1].kind == "name" and self._is(k + 2, "("):
            return self._instance(k + 1)
        return self._find(k, ";") + 1

    def _instance(self, k: int) -> int:
        end = self._closing(k + 1)
        self._connections(k + 2, end)
        return self._find(end, ";") + 1

    def _connections(self, k: int, end: int, static: bool = False) -> None:
        while k < end:
            if not self._is(k, "."):
                k += 1
                continue
            name = self.tokens[k + 1]
            if not self._is(k + 2, "("):
                if name.text.endswith("_i") and "clk" not in name.text:
                    self._tied((name.end, name.end), name.text)
                k += 2
                continue
            close = self._closing(k + 2)
            if static:
                self._expression(k + 3, close, static=True)
            elif name.text.endswith("_i") and "clk" not in name.text and close > k + 3:
                place = (self.tokens[k + 3].start, self.tokens[close - 1].end)
                self._expression(k + 3, close)
                named = self.tokens[k + 3].kind == "name"
                if named and (close == k + 4 or self._is(k + 4, ".")):
                    self._tied(place, self.text[place[0] : place[1]])
            k = close + 1

    def _tied(self, place: tuple[int, int], words: str) -> None:
        """Collect what an input is tied to; the place is empty where its name alone stands."""
        for tied in ["'0"] if "rst" in words else ["'0", f"~{words}"]:
            new = tied if place[0] < place[1] else f"({tied})"
            self._add("connection", [(*place, new)], place)

    def _function(self, k: int) -> int:
        name = self.tokens[self._find(k, "(") - 1].text
        k = self._find(k, ";") + 1
        before = len(self.mutants)
        while not self._is(k, "endfunction"):
            k = self._statement(k)
        if name in self.constant_functions:
            del self.mutants[before:]
        return k + 1

    # ---- statements ----
    def _statement(self, k: int, clocked: bool = False) -> int:
        word = self.tokens[k].text
        if word == "begin":
            k += 3 if self._is(k + 1, ":") else 1
            while not self._is(k, "end"):
                k = self._statement(k, clocked)
            return k + 1
        if word in ("unique", "priority"):
            return self._statement(k + 1, clocked)
        if word == "if":
            end = self._closing(k + 1)
            reset, outer = [t.text for t in self.tokens[k + 2 : end]], self.reset
            self._expression(k + 2, end, condition=True)
            self.reset = outer or (len(reset) == 1 and reset[0].startswith("rst"))
            k = self._statement(end + 1, clocked)
            self.reset = outer
            return self._statement(k + 1, clocked) if self._is(k, "else") else k
        if word in ("case", "casez"):
            end = self._closing(k + 1)
            self._expression(k + 2, end)
            k = end + 1
            while not self._is(k, "endcase"):
                k = self._statement(self._find(k, ":") + 1, clocked)
            return k + 1
        if word == "for":
            return self._statement(self._closing(k + 1) + 1, clocked)
        end = self._find(k, ";")
        if word == "return":
            self._expression(k + 1, end)
        elif not self._declares(k) and word not in (";", "assert", "assume", "cover"):
            sign = self._find(k, "=", "<=", ";", "+=", "-=", "|=", "&=", "++", "--")
            if self._is(sign, "=", "<="):
                self._expression(sign + 1, end)
                if clocked:
                    place = (self.tokens[k].start, self.tokens[end].end)
                    self._add(self._kind("assignment"), [(*place, ";")], place)
        return end + 1

    def _declares(self, k: int) -> bool:
        word, after = self.tokens[k], self.tokens[k + 1]
        if word.text in ("logic", "int", "automatic", "static", "localparam", "typedef"):
            return True
        return word.kind == "name" and (after.kind == "name" or after.text in ("::", "("))

    def _kind(self, kind: str) -> str:
        return "reset" if self.reset else kind

    # ---- expressions ----
    def _expression(
        self, first: int, end: int, *, static: bool = False, condition: bool = False
    ) -> None:
        """Collect what the tokens from ``first`` up to ``end`` could be instead."""
        place = None if static else (self.tokens[first].start, self.tokens[end - 1].end)
        if any(t.text == "'{" or t.kind == "string" for t in self.tokens[first:end]):
            return  # a pattern cannot stand twice
        whole = (self.tokens[first].start, self.tokens[end - 1].end)
        if condition and self.text[slice(*whole)] != "rst_i":
            self._add("condition", [(whole[0], whole[0], "!("), (whole[1], whole[1], ")")], place)
        kept = self._kept(first, end)
        for k in range(first, end):
            token = self.tokens[k]
            if k in kept:
                continue
            index = self._index(k, first)
            before = self.tokens[k - 1] if k > first else None
            binary = before is not None and (
                before.kind in ("name", "number") or before.text in _CLOSE
            )
            edit, kind = None, ""
            if token.kind == "number":
                new = _other(token.text)
                edit, kind = [(token.start, token.end, new)], self._kind("constant")
            elif token.text == "?":
                start, stop = self._start(k, first), self.tokens[k - 1].end
                edit = [(start, start, "!("), (stop, stop, ")")]
                kind = "condition"
            elif binary and token.text in _OPERATORS:
                new, kind = _OPERATORS[token.text]
                edit = [(token.start, token.end, new)]
            elif not binary and token.text in _REDUCTIONS:
                edit, kind = [(token.start, token.end, _REDUCTIONS[token.text])], "bitwise"
            elif token.text in ("!", "~") and not binary:
                edit, kind = [(token.start, token.end, "")], "inversion"
            if edit:
                kind = "elaboration" if static else "index" if index else kind
                self._add(kind, edit, place)

    def _kept(self, first: int, end: int) -> set[int]:
        """Return the tokens that say a width or a range: they stay."""
        kept: set[int] = set()
        for k in range(first, end):
            if self._is(k, "'("):
                back = k - 1
                depth = self._is(back, *_CLOSE)
                while depth:
                    back -= 1
                    depth += self._is(back, *_CLOSE) - self._is(back, *_OPEN)
                kept.update(range(back, k))
            elif self._is(k, "["):
                close, depth = self._closing(k), 0
                for at in range(k + 1, close):
                    depth += self._is(at, *_OPEN) - self._is(at, *_CLOSE)
                    if not depth and self._is(at, "+:", "-:"):
                        kept.update(range(at, close))
                    elif not depth and self._is(at, ":"):
                        kept.update(range(k, close))
            elif self._is(k, "{") and k + 1 < end:
                at = k + 1
                while not self._is(at, ",", "}", "{"):
                    at = self._closing(at) + 1 if self._is(at, "(", "[", "'(") else at + 1
                if self._is(at, "{") and at > k + 1:
                    kept.update(range(k + 1, at))
        return kept

    def _index(self, k: int, first: int) -> bool:
        """Return whether a token stands between square brackets."""
        depth = 0
        for at in range(k - 1, first - 1, -1):
            depth += self._is(at, "]") - self._is(at, "[")
            if depth < 0:
                return True
        return False

    def _start(self, k: int, first: int) -> int:
        """Return where the condition of the ``?`` at ``k`` begins."""
        depth = 0
        for at in range(k - 1, first - 1, -1):
            depth += self._is(at, *_CLOSE) - self._is(at, *_OPEN)
            if depth < 0 or (not depth and self._is(at, ",", "?", ":")):
                return self.tokens[at + 1].start
        return self.tokens[first].start

    def _add(
        self, kind: str, edits: Sequence[tuple[int, int, str]], place: tuple[int, int] | None
    ) -> None:
        start, end = edits[0][0], edits[-1][1]
        begin = self.text.rfind("\n", 0, start) + 1
        close = self.text.find("\n", end)
        mutant = Mutant(
            self.file, self.text.count("\n", 0, start) + 1, start - begin + 1, kind, tuple(edits),
            place, "", "",
        )  # fmt: skip
        old = self.text[begin:close]
        new = mutant.within(self.text, begin, close)
        object.__setattr__(mutant, "old", _plain(old))
        object.__setattr__(mutant, "new", _plain(new))
        self.mutants.append(mutant)


def _other(number: str) -> str:
    """Return a literal that is one more, or one less where it is the largest of its width."""
    if number in ("'0", "'1"):
        return "'1" if number == "'0" else "'0"
    width, mark, digits = number.partition("'")
    if not mark:
        return str(int(number.replace("_", "")) + 1)
    sign = "s" if digits[0] == "s" else ""
    base = digits[len(sign)]
    radix = {"b": 2, "d": 10, "h": 16, "o": 8}[base]
    value = int(digits[len(sign) + 1 :].replace("_", ""), radix)
    other = value + 1 if value + 1 < 1 << int(width) else value - 1
    return f"{width.strip()}'{sign}{base}{format(other, {2: 'b', 8: 'o', 10: 'd', 16: 'x'}[radix])}"


def _plain(text: str) -> str:
    """Return code on one line, without comments."""
    return " ".join(re.sub(r"//[^\n]*", " ", text).split())


def sources() -> list[Path]:
    """Return the modules that have mutants: what somebody writes and a simulation runs."""
    files = [f for f in rtl_modules() if "// Generated from" not in f.read_text()]
    return [f for f in files if f.stem != "reset_bridge"]  # only the boards' wrappers have it


def mutants(file: str, text: str) -> list[Mutant]:
    """Return every mutant of a module, in the order of its text."""
    return sorted(_Module(file, text).mutants, key=lambda m: (m.edits, m.kind))


def sample(files: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Return some mutants, spread over modules and kinds; the first ones of any larger sample.

    Modules and, within one, kinds take turns, so that a large module does not hide a small one.
    """
    root = repository_root()
    columns: list[list[Mutant]] = []
    for file in files:
        chance = random.Random(f"{seed} {file}")
        kinds: defaultdict[str, list[Mutant]] = defaultdict(list)
        for mutant in mutants(file, (root / file).read_text()):
            kinds[mutant.kind].append(mutant)
        for each in kinds.values():
            chance.shuffle(each)
        order = sorted(kinds, key=KINDS.index)
        chance.shuffle(order)
        rows = zip_longest(*(kinds[kind] for kind in order))
        columns.append([m for row in rows for m in row if m is not None])
    return [m for row in zip_longest(*columns) for m in row if m is not None][:count]


def schemata(text: str, chosen: Sequence[Mutant], number: Path, touched: Path) -> str:
    """Return a module's text in which the number in a file says which mutant it is, 0 none.

    Args:
        text: The module's.
        chosen: Its mutants, the first of which is number 1; none of the elaboration.
        number: File with the number, read at the start of every simulation.
        touched: File that gets a byte from every simulation that has the module.
    """
    places: defaultdict[tuple[int, int], list[tuple[int, Mutant]]] = defaultdict(list)
    for k, mutant in enumerate(chosen, 1):
        assert mutant.place is not None, mutant.name
        places[mutant.place].append((k, mutant))
    edits: list[tuple[int, int, str]] = []
    for (start, end), forms in places.items():
        gone = [k for k, m in forms if m.edits == ((start, end, ";"),)]
        if gone:
            kept = " && ".join(f"mutant_q != {k}" for k in gone)
            edits += [(start, start, f"begin if ({kept}) "), (end, end, " end")]
            continue
        # A port may be connected by its name alone.
        made = f"({_plain(text[start:end]) or _name_before(text, start)})"
        for k, mutant in forms:
            made = f"(mutant_q == {k}) ? ({_plain(mutant.within(text, start, end))}) : {made}"
        edits.append((start, end, f"({made})"))
    body = _Module("", text).body
    edits.append((body, body, f" int mutant_q; {_reader(number, touched)}"))
    # An insertion at the start of a statement comes before the statement's own expressions.
    edits.sort(key=lambda edit: edit[:2])
    assert all(a[1] <= b[0] for a, b in pairwise(edits)), "expressions overlap"
    out, at = "", 0
    for start, end, new in edits:
        out += text[at:start] + new
        at = end
    quiet = [f"/* verilator lint_off {rule} */" for rule in _QUIET]  # faults, put in on purpose
    return f"{' '.join(quiet)} {out}{text[at:]}"


def _name_before(text: str, end: int) -> str:
    start = end
    while text[start - 1].isidentifier() or text[start - 1].isdigit():
        start -= 1
    return text[start:end]


def _reader(number: Path, touched: Path) -> str:
    return (
        "initial begin : read_mutant int file; "
        f'file = $fopen("{number}", "r"); void\'($fscanf(file, "%d", mutant_q)); $fclose(file); '
        f'file = $fopen("{touched}", "a"); $fwrite(file, "x"); $fclose(file); end'
    )
