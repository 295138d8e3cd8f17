"""A random sample of single faults over the whole package, the same on each machine: what nobody thought of.

Each line of code that can go wrong has a rank, a hash of `SEED`, of its text and of where it stands; the first `SIZE` lines
are the sample, with one fault each. A change of the package thus replaces the faults of the lines that it changes, and no
others. A fault is named by this hash and by what it changes. `sample.toml` names those that no test can see, and says why.
"""

import ast
import hashlib
import re
import tomllib
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, islice, pairwise

from tests.mutants.faults import FOLDER, PACKAGE, ROOT, Fault

SEED = 20261129
SIZE = 300

_ARITHMETIC = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "//"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.BitXor: ("^", "&"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
}
_COMPARISONS = {
    ast.Lt: ("<", ("<=", ">")),
    ast.LtE: ("<=", ("<", ">=")),
    ast.Gt: (">", (">=", "<")),
    ast.GtE: (">=", (">", "<=")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
_PAIRS = [
    *(("sin", "cos"), ("arcsin", "arccos"), ("floor", "ceil"), ("min", "max"), ("minimum", "maximum"), ("any", "all")),
    *(("argmin", "argmax"), ("radians", "degrees"), ("nanmin", "nanmax"), ("log", "log10"), ("mean", "sum")),
]
_OTHER = dict(_PAIRS) | {second: first for first, second in _PAIRS}
# The order of their arguments says nothing, or is wrong at once.
_ORDERLESS = {
    "max",
    "min",
    "maximum",
    "minimum",
    "hypot",
    "isclose",
    "allclose",
    "array_equal",
    "gcd",
    "isinstance",
    "getattr",
}

_UNLIKE = (ast.JoinedStr, ast.Lambda)  # to swap such an argument with another is no slip


@dataclass(frozen=True)
class Edit:
    """A change of a source: bytes from `start` up to `end` become `new`."""

    kind: str
    start: int
    end: int
    new: str


class _Source:
    """A module's bytes, and where its nodes stand in them."""

    def __init__(self, source: bytes) -> None:
        self.bytes = source
        self.starts = [0, *accumulate(len(line) for line in source.splitlines(keepends=True))]
        self.tree = ast.parse(source)
        firsts = [min(part.lineno for part in (node, *getattr(node, "decorator_list", ()))) for node in self.tree.body]
        self.firsts = [self.starts[line - 1] for line in firsts]  # bytes at which the statements of the module begin

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Return the first byte of a node and the one behind its last."""
        return (
            self.starts[node.lineno - 1] + node.col_offset,
            self.starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0),
        )

    def text(self, node: ast.expr) -> str:
        start, end = self.span(node)
        return self.bytes[start:end].decode()

    def line(self, at: int) -> int:
        """Return the index of the line that holds a byte."""
        return bisect_right(self.starts, at) - 1

    def between(self, left: ast.expr, right: ast.expr, symbol: str) -> tuple[int, int] | None:
        """Return where an operator stands between its operands; None where a comment may hide it."""
        start, end = self.span(left)[1], self.span(right)[0]
        text = self.bytes[start:end].decode()
        pattern = r"\s+".join(map(re.escape, symbol.split()))
        if "#" in text or (place := re.search(pattern, text)) is None:
            return None
        return start + place.start(), start + place.end()


class _Finder(ast.NodeVisitor):
    """Finds what can go wrong in a module."""

    def __init__(self, source: _Source) -> None:
        self.source = source
        self.edits: list[tuple[str, Edit]] = []  # with the name of what it stands in
        self.names: list[str] = []

    def add(self, kind: str, span: tuple[int, int] | None, new: str) -> None:
        if span is not None:
            self.edits.append((".".join(self.names), Edit(kind, *span, new)))

    # ------------------------------------------------------------------------------------------ what is left out, and why

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Skip messages: until Python 3.12, positions in them are wrong."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_arg(self, node: ast.arg) -> None:
        """Skip annotations."""

    def visit_If(self, node: ast.If) -> None:
        if "TYPE_CHECKING" in ast.dump(node.test) or "__name__" in ast.dump(node.test):
            return
        self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self._inside(node.name, node.body)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Visit defaults and what is done, without decorators and annotations."""
        self._inside(node.name, [node.args, *node.body])

    def visit_AsyncFunctionDef(self, node: ast.AsyncFunctionDef) -> None:
        self._inside(node.name, [node.args, *node.body])

    def _inside(self, name: str, nodes: list) -> None:
        self.names.append(name)
        for node in nodes:
            self.visit(node)
        self.names.pop()

    # ------------------------------------------------------------------------------------------------------ what goes wrong

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self.generic_visit(node)
        if any(
            isinstance(side, ast.JoinedStr | ast.List | ast.Tuple) or _is_text(side) for side in (node.left, node.right)
        ):
            return
        if any(isinstance(side, ast.Constant) and side.value is None for side in (node.left, node.right)):  # a type
            return
        start, end = self.source.span(node)
        if isinstance(node.op, ast.MatMult):
            if (place := self.source.between(node.left, node.right, "@")) is not None:
                left = self.source.bytes[start : place[0]].decode().strip()
                right = self.source.bytes[place[1] : end].decode().strip()
                self.add("swapped", (start, end), f"{right} @ {left}")
            return
        symbol, other = _ARITHMETIC[type(node.op)]
        if (place := self.source.between(node.left, node.right, symbol)) is None:
            return
        self.add("operator", place, other)
        if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div | ast.BitAnd | ast.BitOr):
            self.add("dropped", (start, end), self.source.bytes[start : place[0]].decode().strip())
        if isinstance(node.op, ast.Add | ast.Mult | ast.BitAnd | ast.BitOr):
            self.add("dropped", (start, end), self.source.bytes[place[1] : end].decode().strip())

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.generic_visit(node)
        if (
            type(node.op) in _ARITHMETIC
            and not _is_text(node.value)
            and not isinstance(node.value, ast.List | ast.JoinedStr)
        ):
            symbol, other = _ARITHMETIC[type(node.op)]
            self.add("operator", self.source.between(node.target, node.value, f"{symbol}="), f"{other}=")

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        self.generic_visit(node)
        symbol, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        places = [self.source.between(left, right, symbol) for left, right in pairwise(node.values)]
        start, end = self.source.span(node)
        for place in places:
            self.add("operator", place, other)
        if places[-1] is not None:
            self.add("dropped", (start, end), self.source.bytes[start : places[-1][0]].decode().strip())
        if places[0] is not None:
            self.add("dropped", (start, end), self.source.bytes[places[0][1] : end].decode().strip())

    def visit_Compare(self, node: ast.Compare) -> None:
        self.generic_visit(node)
        for (left, right), op in zip(pairwise([node.left, *node.comparators]), node.ops, strict=True):
            symbol, others = _COMPARISONS[type(op)]
            place = self.source.between(left, right, symbol)
            for other in others:
                self.add("comparison", place, other)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        self.generic_visit(node)
        start, _ = self.source.span(node)
        width = {ast.USub: 1, ast.Invert: 1, ast.Not: 4}.get(type(node.op), 0)
        if width:
            self.add("sign", (start, start + width), "")

    def visit_Subscript(self, node: ast.Subscript) -> None:
        first = len(self.edits)
        self.visit(node.slice)
        self.edits[first:] = [
            (name, Edit("index", edit.start, edit.end, edit.new)) if edit.kind == "constant" else (name, edit)
            for name, edit in self.edits[first:]
        ]
        self.visit(node.value)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self.add("constant", self.source.span(node), str(not value))
        elif isinstance(value, int):
            self.add("constant", self.source.span(node), str(value + 1))
        elif isinstance(value, float) and value == value and abs(value) != float("inf"):
            factor = 1000.0 if "e" in self.source.text(node).lower() else 1.5  # 1e-9 is a unit or a tolerance
            self.add("constant", self.source.span(node), repr(float(f"{factor * value:.12g}")) if value else "1.0")

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self.generic_visit(node)
        test, chosen, other = (self.source.text(part) for part in (node.test, node.body, node.orelse))
        if "#" not in self.source.text(node):
            self.add("swapped", self.source.span(node), f"({other}) if ({test}) else ({chosen})")

    def visit_Attribute(self, node: ast.Attribute) -> None:
        self.generic_visit(node)
        end = self.source.span(node)[1]
        if node.attr == "T":
            self.add("dropped", (end - 2, end), "")

    def visit_Call(self, node: ast.Call) -> None:
        for keyword in node.keywords:
            if keyword.arg != "strict":  # of zip: whether a mistake elsewhere is noticed
                self.visit(keyword.value)
        for part in (node.func, *node.args):
            self.visit(part)
        function = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if function in _OTHER:
            end = self.source.span(node.func)[1]
            self.add("function", (end - len(function), end), _OTHER[function])
        if function in _ORDERLESS or any(isinstance(argument, ast.Starred) for argument in node.args):
            return
        named = [keyword.value for keyword in node.keywords if keyword.arg]
        for first, second in [*pairwise(node.args), *pairwise(named)]:
            if any(isinstance(part, _UNLIKE) or _is_text(part) for part in (first, second)):
                continue
            start, end = self.source.span(first)[0], self.source.span(second)[1]
            gap = self.source.bytes[self.source.span(first)[1] : self.source.span(second)[0]].decode()
            one, other = self.source.text(first), self.source.text(second)
            if "#" not in gap and one != other:
                self.add("swapped", (start, end), f"{other}{gap}{one}")


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)


def _rank(*words: object) -> str:
    return hashlib.sha256("\0".join(map(str, (SEED, *words))).encode()).hexdigest()[:8]


@dataclass(frozen=True)
class _Line:
    """A line that can go wrong, and all the ways in which it can."""

    file: str
    name: str
    index: int
    source: _Source
    where: tuple[object, ...]
    edits: list[Edit]

    @property
    def rank(self) -> str:
        return _rank(*self.where)

    def choose(self) -> Edit | None:
        """Return one edit, of a kind that is drawn first; None if none is Python."""
        start = self.source.starts[self.index]
        edits = sorted(
            self.edits, key=lambda e: (_rank(*self.where, e.kind), _rank(*self.where, e.start - start, e.new))
        )
        return next((edit for edit in edits if _is_change(self.source, edit)), None)


def _lines_of(file: str) -> Iterator[_Line]:
    source = _Source((ROOT / file).read_bytes())
    finder = _Finder(source)
    finder.visit(source.tree)
    del source.tree  # trees of the whole package would fill the memory
    lines: dict[tuple[int, str], list[Edit]] = {}
    for name, edit in finder.edits:
        lines.setdefault((source.line(edit.start), name), []).append(edit)
    seen: Counter[tuple[str, str]] = Counter()
    for (index, name), edits in sorted(lines.items()):
        text = source.bytes[source.starts[index] : source.starts[index + 1]].decode().strip()
        seen[name, text] += 1
        yield _Line(file, name, index, source, (file, name, text, seen[name, text]), edits)


def _is_change(source: _Source, edit: Edit) -> bool:
    """Return whether Python reads something else with an edit, in the statement of the module that holds it."""
    number = bisect_right(source.firsts, edit.start)
    start, end = source.firsts[number - 1], [*source.firsts, len(source.bytes)][number]
    before = source.bytes[start:end]
    after = before[: edit.start - start] + edit.new.encode() + before[edit.end - start :]
    try:
        return ast.dump(ast.parse(after)) != ast.dump(ast.parse(before))
    except SyntaxError:
        return False


def draw(size: int = SIZE) -> list[Fault]:
    """Return the sample, in the order of its ranks: a shorter one is the beginning of a longer one."""
    files = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / PACKAGE).rglob("*.py"))
    lines = sorted((line for file in files for line in _lines_of(file)), key=lambda line: line.rank)
    reasons = equivalent()
    faults = (_fault(line, edit) for line in lines if (edit := line.choose()) is not None)
    return [replace(fault, equivalent=reasons.get(fault.name, "")) for fault in islice(faults, size)]


def equivalent() -> dict[str, str]:
    """Return why faults of the sample cannot be seen, by their names."""
    return tomllib.loads((FOLDER / "sample.toml").read_text(encoding="utf-8"))["equivalent"]


def _fault(line: _Line, edit: Edit) -> Fault:
    """Return an edit as whole lines, with as many of those before it as make them unique in the file."""
    source = line.source
    first, last = line.index, source.line(max(edit.end - 1, edit.start))
    end = source.starts[last + 1]
    while source.bytes.count(source.bytes[source.starts[first] : end]) > 1:
        first -= 1
    old = source.bytes[source.starts[first] : end]
    at = edit.start - source.starts[first]
    new = old[:at] + edit.new.encode() + old[at + edit.end - edit.start :]
    was = " ".join(source.bytes[edit.start : edit.end].decode().split())
    told = f"{line.rank} {edit.kind} in {line.name or 'the module'}: {was!r} -> {' '.join(edit.new.split())!r}"
    parts = line.file.split("/")
    room = parts[1] if len(parts) > 2 else PACKAGE
    return Fault(room, told, line.file, old.decode(), new.decode(), line=line.index + 1)
