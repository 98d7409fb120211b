"""docs/conformance.md: each statement of section III, the code that carries it out, its test and its figure.

`python -m sonar_explore.studies.conformance` writes the page; a test fails while it is not what this makes.
"""

from __future__ import annotations

import ast
from pathlib import Path

from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.conformance.citations import Place, places
from sonar_explore.studies.conformance.statements import STATEMENTS, Statement

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "conformance.md"
TESTS = ROOT / "tests"
TITLES = {
    "III.A": "Seed chain creation",
    "III.B": "Feature association",
    "III.C": "Achieving robustness",
    "III.D": "Probability of association",
    "III.E": "New chains",
    "III.F": "Local localization",
    "III.G": "Dual association",
}
EQUATIONS = tuple(f"quation ({number})" for number in range(1, 6))


def conformance_page() -> str:
    """The page; raises where a name on it does not exist."""
    found = problems()
    if found:
        raise SonarExploreError("; ".join(found))
    known = places()
    parts = [_HEAD]
    for section, title in TITLES.items():
        rows = [_row(s, known) for s in STATEMENTS if s.section == section]
        parts += [f"## {section} {title}\n", _COLUMNS, *rows, ""]
    return "\n".join([*parts, _CITATIONS, *_citation_rows(known), ""])


def problems() -> list[str]:
    """What is wrong between statements, code and tests; empty when nothing is."""
    known, tests = places(), _tests()
    found = []
    for s in STATEMENTS:
        for code in s.code:
            place = known.get(_split(code))
            if place is None:
                found.append(f"{s.section}: {code} does not exist")
            elif not place.cites(s.section):
                found.append(f"{s.section}: nothing at {code} cites the section")
        found += [f"{s.section}: no test {name}" for name in _test_names(s) if name not in tests]
        if not s.tests:
            found.append(f"{s.section}: no test of {s.says!r}")
    cited = {section for place in known.values() for section in TITLES if place.cites(section)}
    found += [
        f"{section} is cited and has no statement" for section in cited - {s.section for s in STATEMENTS}
    ]
    says = " ".join(s.says for s in STATEMENTS)
    return found + [f"no statement of e{equation}" for equation in EQUATIONS if equation not in says]


def _row(statement: Statement, known: dict[tuple[str, str], Place]) -> str:
    code = "<br>".join(_code_cell(known[_split(code)]) for code in statement.code)
    tests = "<br>".join(f"`{name}`" for name in _test_names(statement))
    return f"| {statement.says} | {code} | {tests} | {_figure(statement.figure)} |"


def _code_cell(place: Place) -> str:
    link = f"[`{place.name}`](../sonar_explore/{place.file})"
    summary = place.summary.replace("|", "\\|")
    return f"{link} {summary}".strip()


def _figure(figure: str) -> str:
    if figure.isdigit() and int(figure) <= 12:
        return f"[{figure}](figures/figure-{int(figure):02d}.svg)"
    name = {"runs": "14 to 20"}.get(figure, figure)
    return f"[{name}](reproduction.md)"


def _test_names(statement: Statement) -> list[str]:
    """`paper/test_iii_b_association.py::test_...`"""
    return [_test_name(statement.section, name) for name in statement.tests]


def _test_name(section: str, name: str) -> str:
    file, _, test = name.rpartition(":")
    if not file:
        letter = section[-1].lower()
        file = next(
            (p.stem for p in sorted((TESTS / "paper").glob(f"test_iii_{letter}_*.py"))), f"test_iii_{letter}"
        )
    folder = "" if "/" in file else "paper/"
    return f"{folder}{file}.py::test_{test}"


def _tests() -> set[str]:
    """All tests, by the same names."""
    return {
        f"{path.relative_to(TESTS).as_posix()}::{node.name}"
        for path in TESTS.rglob("test_*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
    }


def _split(code: str) -> tuple[str, str]:
    file, _, name = code.partition(":")
    return file, name


def _citation_rows(known: dict[tuple[str, str], Place]) -> list[str]:
    return [_citation_row(place) for place in known.values() if place.citations]


def _citation_row(place: Place) -> str:
    name = f"`{place.name}`" if place.name else "the module"
    return f"| [{place.file}](../sonar_explore/{place.file}) | {name} | {', '.join(place.citations)} |"


_HEAD = """# Conformance: the paper and the code

Made by `python -m sonar_explore.studies.conformance` from the list in
`sonar_explore/studies/conformance/statements.py` and the docstrings: edit those. A test fails where this page is not
what the command makes, where a name on it does not exist, where code does not cite the section that it stands for, and
where a test is missing.

The statements are the paper's in our words, with its numbers. What each piece of code says is the first sentence of its
docstring. Figures 5 to 12 are redrawn from an episode of ours; 14 to 20 are the runs in
[reproduction.md](reproduction.md). Where the default goes beyond the paper: [departures.md](departures.md).
"""

_COLUMNS = "| the paper | code | tests (in `tests/`) | figure |\n|---|---|---|---|"

_CITATIONS = """## Where the code cites the paper

*READING* is our reading of what the paper leaves open; its sections are numbered.

| file | at | cites |
|---|---|---|"""
