"""Where the code cites the paper: docstrings and comments read with `ast`, nothing imported."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).parents[2]
NO_PAPER = {"studies", "reports"}  # they speak about the paper, and carry out none of it

_SECTION = re.compile(r"\bIII\.[A-G]\b")
_STANDS_IN = {
    **dict.fromkeys(("figure 5", "figure 6"), "III.B"),
    **dict.fromkeys(("figure 7", "figure 8", "figure 9"), "III.C"),
    **dict.fromkeys(("figure 10", "equation (1)", "equation (2)"), "III.D"),
    "equation (3)": "III.E",
    **dict.fromkeys(("figure 11", "figure 12", "equation (4)", "equation (5)"), "III.F"),
}
_LATER = r"(?: (?:and|to) \(?\d+\)?)*"
_PATTERNS = (
    ("section ", re.compile(r"\bI{1,3}V?(?:\.[A-G])?\b(?=[^\w(]|$)")),
    ("", re.compile(rf"[Ee]quations? \(\d\){_LATER}")),
    ("", re.compile(r"[Ff]igures? \d+(?:\([a-z]\))?(?:(?: and| to) \d+(?:\([a-z]\))?)*")),
    ("", re.compile(r"READING section \d+")),
)


@dataclass(frozen=True)
class Place:
    """A function, class or constant, and what is written at it."""

    file: str
    """Within the package."""
    name: str
    """Qualified; empty for the module itself."""
    line: int
    text: str
    """Docstring, or the comment and string at a constant or field."""
    around: str
    """Docstrings of the class and the module that hold it, and the comments inside it."""

    @property
    def summary(self) -> str:
        """First sentence of the text."""
        flat = " ".join(self.text.split())
        return re.split(r"(?<=[^.A-Z]\.)\s", flat)[0] if flat else ""

    def cites(self, section: str) -> bool:
        """Whether it, or what holds it, cites the section, or an equation or a figure that stands in it."""
        text = f"{self.text} {self.around}"
        named = {where for what, where in _STANDS_IN.items() if re.search(re.escape(what) + r"(?!\d)", text)}
        return section in named | set(_SECTION.findall(text))

    @property
    def citations(self) -> list[str]:
        """What its own text cites, in order."""
        found = [prefix + match for prefix, pattern in _PATTERNS for match in pattern.findall(self.text)]
        return list(dict.fromkeys(c[:1].lower() + c[1:] if c[1:2].islower() else c for c in found))


def places() -> dict[tuple[str, str], Place]:
    """Every named thing of the package by (file, name)."""
    files = (p for p in sorted(PACKAGE.rglob("*.py")) if p.relative_to(PACKAGE).parts[0] not in NO_PAPER)
    found = (place for path in files for place in _places_in(path))
    return {(place.file, place.name): place for place in found}


def _places_in(path: Path) -> Iterator[Place]:
    source = path.read_text(encoding="utf-8")
    file, tree, lines = path.relative_to(PACKAGE).as_posix(), ast.parse(source), source.splitlines()
    module = ast.get_docstring(tree) or ""
    yield Place(file, "", 1, module, "")
    yield from _within(tree, file, "", module, lines)


def _within(
    parent: ast.Module | ast.ClassDef, file: str, prefix: str, around: str, lines: list[str]
) -> Iterator[Place]:
    for node, after in zip(parent.body, [*parent.body[1:], None], strict=True):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            text = ast.get_docstring(node) or ""
            comments = " ".join(_comment(line) for line in lines[node.lineno - 1 : node.end_lineno])
            name = prefix + node.name
            strings = _strings(node) if isinstance(node, ast.ClassDef) else ""
            yield Place(file, name, node.lineno, text, f"{around} {comments} {strings}")
            if isinstance(node, ast.ClassDef):
                yield from _within(node, file, f"{name}.", f"{around} {text}", lines)
        else:
            for name in _assigned(node):
                text = f"{_string(after)} {_comment(lines[node.lineno - 1])}".strip()
                yield Place(file, prefix + name, node.lineno, text, around)


def _assigned(node: ast.stmt) -> list[str]:
    targets = (
        node.targets
        if isinstance(node, ast.Assign)
        else [node.target]
        if isinstance(node, ast.AnnAssign)
        else []
    )
    flat = [n for t in targets for n in (t.elts if isinstance(t, ast.Tuple) else [t])]
    return [n.id for n in flat if isinstance(n, ast.Name)]


def _string(node: ast.stmt | None) -> str:
    if (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ):
        return node.value.value
    return ""


def _strings(node: ast.ClassDef) -> str:
    return " ".join(_string(statement) for statement in node.body)


def _comment(line: str) -> str:
    return line.partition("  # ")[2] or (line.strip()[2:] if line.strip().startswith("# ") else "")
