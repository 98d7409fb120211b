"""The command line: what it lists of itself, of worlds and of policies."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pytest

from sonar_explore import cli
from sonar_explore.envs.load import load_world

Capture = pytest.CaptureFixture[str]


def test_no_command_shows_the_help(capsys: Capture) -> None:
    assert cli.main([]) == 0
    assert "Usage: sonar-explore" in capsys.readouterr().out


def test_help_imports_nothing_heavy() -> None:
    # gymnasium and its numpy come with the package itself, which registers the environments
    heavy = "{'matplotlib', 'rich', 'jinja2', 'msgspec', 'scipy', 'skimage', 'shapely', 'numba'}"
    code = (
        f"import sys; from sonar_explore import cli; cli.main(['--help']); print({heavy} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("set()\n")


def test_a_reader_that_goes_away_is_no_error() -> None:
    code = "import sys; from sonar_explore import cli; sys.exit(cli.main(['--help']))"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    process.wait()
    process.stderr.close()


def test_no_summary_of_a_command_is_cut_short(capsys: Capture) -> None:
    assert cli.main(["--help"]) == 0
    _, _, summaries = capsys.readouterr().out.partition("Commands:")
    assert len(summaries.splitlines()) > len(cli.commands.commands) and "..." not in summaries


def test_worlds_and_generators_are_listed_as_a_table_and_as_json(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = SimpleNamespace(name="loop", title="A [bold]loop[/bold]", walls=[1, 2], has_loop=True)
    monkeypatch.setattr("sonar_explore.envs.generator.generator_names", lambda: ("generated/cave",))
    monkeypatch.setattr("sonar_explore.envs.load.shipped_worlds", lambda: ("loop",))
    monkeypatch.setattr("sonar_explore.envs.load.load_world", lambda _: world)
    assert cli.main(["worlds"]) == 0
    out = capsys.readouterr().out
    assert "A [bold]loop[/bold]" in out and "generated/cave" in out
    assert "None" not in out
    assert cli.main(["worlds", "--json"]) == 0
    shipped, generator = json.loads(capsys.readouterr().out)
    assert shipped == {"name": "loop", "title": "A [bold]loop[/bold]", "walls": 2, "loop": True}
    assert generator["name"] == "generated/cave" and "generated/cave-17" in generator["title"]
    assert generator["walls"] is None and generator["loop"] is None


def test_every_world_that_is_listed_can_be_read(capsys: Capture) -> None:
    assert cli.main(["worlds", "--json"]) == 0
    names = [row["name"] for row in json.loads(capsys.readouterr().out)]
    assert {"paper/rooms", "generated/office"} <= set(names)
    assert all(len(load_world(name).walls) for name in names)


def test_agents_are_listed_with_one_line_each(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    known = {"random": "Anywhere.", "frontier": "The paper's."}
    monkeypatch.setattr("sonar_explore.agents.known_agents", lambda: known, raising=False)
    assert cli.main(["agents", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [
        {"name": "frontier", "about": "The paper's."},
        {"name": "random", "about": "Anywhere."},
    ]
    assert cli.main(["agents"]) == 0
    assert "The paper's." in capsys.readouterr().out
