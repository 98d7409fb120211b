"""docs/reproduction.md: put what a study found into the page, each study in its own section.

`python -m sonar_explore.studies.document runs/reproduce [runs/ablation] [runs/sensitivity]`
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sonar_explore.episodes.files import write_atomically
from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.results import Study, load_study
from sonar_explore.studies.study import sensitivity_lines
from sonar_explore.studies.tables import goal_lines, pooled_table, table_of

PAGE = Path("docs/reproduction.md")


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
    return [f"Worlds: {', '.join(study.worlds)}.", "", *sensitivity_lines(study)]


def with_section(page: str, study: Study) -> str:
    """The page with the section of this study made anew."""
    begin, end = f"<!-- {study.kind} -->", f"<!-- end of {study.kind} -->"
    found = re.search(re.escape(begin) + ".*?" + re.escape(end), page, re.DOTALL)
    if not found:
        raise SonarExploreError(f"the page has no section {begin}")
    return page[: found.start()] + f"{begin}\n{section_of(study)}\n{end}" + page[found.end() :]


def main(folders: list[str]) -> int:
    """Put every study named into the page."""
    page = PAGE.read_text(encoding="utf-8")
    for folder in folders:
        page = with_section(page, load_study(Path(folder) / "results.json"))
    write_atomically(PAGE, page.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
