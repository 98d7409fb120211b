"""Tables of text: what the pages and the terminal make of them."""

import pytest

from sonar_explore.studies import progress, ring_scan
from sonar_explore.studies.plans import tables as plans
from sonar_explore.studies.tables import Table

TABLE = Table(
    ("world", "success", "explored", "causes"), (("loop", "9 of 9", "-", "none"), ("bend", "8", "9 %", "-"))
)


def test_columns_of_words_are_told_from_columns_of_numbers():
    assert TABLE.words == (True, False, False, True)
    assert Table(TABLE.columns, ()).words == (False,) * 4


def test_some_columns_keep_their_cells_under_their_new_names():
    found = TABLE.only({"causes": "why", "world": "where"})
    assert found == Table(("why", "where"), (("none", "loop"), ("-", "bend")))


RATE, MEDIAN = "100 of 100 [100, 100]", "0.123 [0.123, 0.123]"
LONGEST_ARM = max((variant.name for variant in ring_scan.VARIANTS), key=len)


@pytest.mark.parametrize(
    ("columns", "briefly", "row"),
    [
        (
            ring_scan.COLUMNS,
            ring_scan.BRIEFLY,
            ("open-loop", LONGEST_ARM, RATE, *["0.123"] * 3, "123", "123", "123.4", "wall error 100"),
        ),
        (
            plans.GROUP_COLUMNS,
            plans.BRIEFLY,
            ("plans with clutter", "1000", RATE, RATE, RATE, MEDIAN, "123", MEDIAN),
        ),
    ],
)
def test_what_the_terminal_shows_fits_into_80_columns(columns, briefly, row, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    progress.show_table(Table(columns, (row,)).only(briefly))
    lines = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert len(lines) == 3  # heading, rule, row: nothing is folded
