"""What the README says can be done: its Python runs, its links lead somewhere."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_the_python_of_the_readme_runs_from_top_to_bottom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 3
    names: dict = {}
    for block in blocks:
        exec(block, names)
    assert names["observation"]["action_mask"].any()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_to_a_file_leads_to_one(page):
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    assert not [target for target in targets if not (page.parent / target).exists()]


def test_every_subcommand_in_the_readme_exists():
    from sonar_explore.cli import commands

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    used = set(re.findall(r"^sonar-explore ([\w-]+)", text, re.MULTILINE))
    assert used == set(commands.commands)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_option_that_is_named_exists(page):
    from sonar_explore.config import ExplorationConfig
    from sonar_explore.studies.options import option

    names = re.findall(r"`((?:slam|mapping|planning|driving|candidates)(?:\.\w+)+)`", page.read_text("utf-8"))
    for name in names:
        if not name.endswith(".py"):
            option(ExplorationConfig(), name)


def test_every_page_can_be_found_from_the_readme():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert not [page.name for page in PAGES[1:] if f"](docs/{page.name})" not in text]


def test_every_choice_of_slam_is_explained():
    from sonar_explore.slam import SLAMS

    text = (ROOT / "docs/slam.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w[\w-]*)` \|", text, re.MULTILINE)) == set(SLAMS)
