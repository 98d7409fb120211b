"""What a study shows in the terminal: how far it is, and its table."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table as RichTable
from rich.text import Text

from sonar_explore.studies.jobs import Outcome
from sonar_explore.studies.success import causes_of_failure
from sonar_explore.studies.tables import Table


def _words(outcome: Outcome) -> str:
    causes = causes_of_failure(outcome.summary)
    end = outcome.error or ", ".join(causes) or "success"
    return f"{outcome.world} {outcome.variant} {outcome.seed}: {end}"


@contextmanager
def bar(
    total: int, done: int, words: Callable[[Any], str] = _words, what: str = "episodes"
) -> Iterator[Callable[[Any], None]]:
    """A bar on stderr; lines now and then where nobody watches. Call what it gives with each outcome."""
    if sys.stderr.isatty():
        with _live(total, done, words, what) as on_done:
            yield on_done
    else:
        yield _Lines(total, done, words, what)


@contextmanager
def _live(total: int, done: int, words: Callable[[Any], str], what: str) -> Iterator[Callable[[Any], None]]:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True, highlight=False, markup=False)) as shown:
        task = shown.add_task(what, total=total, completed=done)
        yield lambda outcome: shown.update(task, advance=1, description=words(outcome))


class _Lines:
    """About twenty lines in all."""

    def __init__(self, total: int, done: int, words: Callable[[Any], str], what: str) -> None:
        self._total, self._done, self._words = total, done, words
        self._every = max(1, total // 20)
        if done:
            print(f"{done} of {total} {what} are there", file=sys.stderr)

    def __call__(self, outcome: Any) -> None:
        self._done += 1
        if outcome.error or self._done % self._every == 0 or self._done == self._total:
            print(f"{self._done} of {self._total}: {self._words(outcome)}", file=sys.stderr, flush=True)


def show_table(table: Table) -> None:
    """On stdout."""
    shown = RichTable(
        box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, collapse_padding=True, show_edge=False
    )
    for index, column in enumerate(table.columns):
        shown.add_column(column, no_wrap=index < 3, overflow="fold")
    for row in table.rows:
        shown.add_row(*(Text(cell) for cell in row))
    Console(highlight=False, markup=False).print(shown)


def say(*lines: str) -> None:
    """On stdout, as they are."""
    for line in lines:
        print(line)
