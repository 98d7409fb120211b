"""Put what a study found into the documents, each study in its own section.

`python -m sonar_explore.studies.document runs/reproduce [runs/ablation] [runs/sensitivity]` for docs/reproduction.md,
`python -m sonar_explore.studies.document runs/compare` for docs/comparison.md,
`python -m sonar_explore.studies.document runs/explore-plans` for docs/exploration.md and its pictures.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import msgspec

from sonar_explore.episodes.files import write_atomically
from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.compare.results import COMPARISON, Comparison, load_comparison
from sonar_explore.studies.compare.tables import comparison_lines
from sonar_explore.studies.plans.page import PICTURES, failure_lines, is_ours, picture_name
from sonar_explore.studies.plans.results import KIND, PlansStudy, load_plans_study
from sonar_explore.studies.plans.study import report
from sonar_explore.studies.results import Study, load_study
from sonar_explore.studies.ring_scan import ring_table
from sonar_explore.studies.sensitivity import sensitivity_lines
from sonar_explore.studies.tables import goal_lines, pooled_table, table_of

PAGE = Path("docs/reproduction.md")
PAGES = {"ring-scan": Path("docs/ring_scan.md")}
"""Of the studies that have a page of their own."""
COMPARISON_PAGE = Path("docs/comparison.md")
PLANS_PAGE = Path("docs/exploration.md")
PLANS_PICTURES = Path("docs/exploration")


def section_of(study: Study) -> str:
    """What the page says of a study."""
    count = f"{study.seeds} seeds" if study.seeds > 1 else "1 seed"
    made = f"{count}, noise `{study.noise}`, version {study.version}, source {study.code}."
    return "\n".join([made, "", *_body(study)])


def _body(study: Study) -> list[str]:
    if study.kind == "reproduce":
        goal = goal_lines(study) if any(v["name"] == "chain" for v in study.variants) else []
        return [*goal, "", table_of(study).markdown()]
    if study.kind == "ablation":
        return [pooled_table(study, [v["name"] for v in study.variants]).markdown()]
    if study.kind == "ring-scan":
        return [ring_table(study).markdown()]
    return [f"Worlds: {', '.join(study.worlds)}.", "", *sensitivity_lines(study)]


def plans_section(study: PlansStudy) -> str:
    """What the page says of `explore-plans`."""
    count = f"{study.seeds} seeds" if study.seeds > 1 else "1 seed"
    made = f"{len(study.runs)} runs, {count}, SLAM `{study.slam}`, noise `{study.noise}`, version {study.version}, "
    failures = failure_lines(study, PLANS_PICTURES.name)
    body = [*report(study), "", "## Every failure and its cause", "", *failures]
    return "\n".join([f"{made}source {study.code}.", "", *body])


def with_section(page: str, study: Study) -> str:
    """The page with the section of this study made anew."""
    return with_text(page, study.kind, section_of(study))


def with_text(page: str, kind: str, text: str) -> str:
    """The page with other text between the marks of a kind of study."""
    begin, end = f"<!-- {kind} -->", f"<!-- end of {kind} -->"
    found = re.search(re.escape(begin) + ".*?" + re.escape(end), page, re.DOTALL)
    if not found:
        raise SonarExploreError(f"the page has no section {begin}")
    return page[: found.start()] + f"{begin}\n{text}\n{end}" + page[found.end() :]


def main(folders: list[str]) -> int:
    """Put every study named into its page; what cannot be done is one line on stderr."""
    try:
        put(folders)
    except SonarExploreError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def put(folders: list[str]) -> None:
    """Put every study named into its page."""
    for folder in map(Path, folders):
        kind = _kind(folder)
        if kind == KIND:
            _put_plans(folder)
            continue
        if kind == COMPARISON:
            _put_comparison(folder)
            continue
        study = load_study(folder / "results.json")
        path = PAGES.get(study.kind, PAGE)
        write_atomically(path, with_section(path.read_text(encoding="utf-8"), study).encode())


def comparison_section(found: Comparison) -> str:
    """What the page says of `compare`."""
    made = f"{found.seeds} seeds, version {found.version}, source {found.code}."
    return "\n".join([made, "", *comparison_lines(found)])


def _put_comparison(folder: Path) -> None:
    page = with_text(
        COMPARISON_PAGE.read_text(encoding="utf-8"),
        COMPARISON,
        comparison_section(load_comparison(folder / "results.json")),
    )
    write_atomically(COMPARISON_PAGE, page.encode())


class _Kind(msgspec.Struct):
    """Of a results.json, which study made it."""

    kind: str


def _kind(folder: Path) -> str:
    try:
        return msgspec.json.decode((folder / "results.json").read_bytes(), type=_Kind).kind
    except (OSError, msgspec.DecodeError) as error:
        raise SonarExploreError(f"{folder} holds no study's results.json: {error}") from error


def _put_plans(folder: Path) -> None:
    """The section, and the pictures of the failures in place of those of an earlier study."""
    study = load_plans_study(folder / "results.json")
    page = with_text(PLANS_PAGE.read_text(encoding="utf-8"), KIND, plans_section(study))
    shutil.rmtree(PLANS_PICTURES, ignore_errors=True)
    shown = [run for run in study.failures() if run.summary and is_ours(run)]
    if shown:
        PLANS_PICTURES.mkdir()
    for run in shown:
        shutil.copy(folder / PICTURES / picture_name(run), PLANS_PICTURES)
    write_atomically(PLANS_PAGE, page.encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
