"""The conformance page cannot go stale."""

import pytest

from sonar_explore.studies.conformance import page
from sonar_explore.studies.conformance.citations import places
from sonar_explore.studies.conformance.statements import STATEMENTS, Statement


def test_no_name_is_missing_and_every_section_is_cited_and_tested():
    assert page.problems() == []


def test_the_page_is_what_the_command_makes():
    assert page.PAGE.read_text(encoding="utf-8") == page.conformance_page()


def test_every_figure_that_the_page_shows_is_there():
    figures = {int(s.figure) for s in STATEMENTS if s.figure.isdigit() and int(s.figure) <= 12}
    assert figures == {5, 6, 7, 8, 9, 10, 11, 12}
    assert all((page.ROOT / f"docs/figures/figure-{n:02d}.svg").exists() for n in figures)


@pytest.mark.parametrize(
    ("statement", "problem"),
    [
        (Statement("III.B", "x", ("slam/association.py:magic",), ("y",), "5"), "does not exist"),
        (Statement("III.G", "x", ("slam/rcd.py:regions",), ("y",), "5"), "cites the section"),
        (Statement("III.B", "x", (), ("a_test_that_nobody_wrote",), "5"), "no test"),
        (Statement("III.B", "x", (), (), "5"), "no test of 'x'"),
    ],
)
def test_a_false_statement_is_found(statement, problem, monkeypatch):
    monkeypatch.setattr(page, "STATEMENTS", (*STATEMENTS, statement))
    assert any(problem in found for found in page.problems())


def test_a_missing_equation_is_found(monkeypatch):
    fewer = tuple(s for s in STATEMENTS if "quation (5)" not in s.says)
    monkeypatch.setattr(page, "STATEMENTS", fewer)
    assert "no statement of equation (5)" in page.problems()


def test_constants_fields_and_methods_are_places_too():
    known = places()
    assert known["slam/association.py", "MAX_END_GAP_M"].citations == ["section III.B"]
    assert known["slam/probability.py", "RootCertainty.of_first_scan"].cites("III.A")
    assert known["slam/link_graph.py", "LinkGraphs.angle_fits"].citations == ["figure 7"]
    assert known["slam/localization.py", "localize"].citations == ["equation (4)", "equation (5)"]
