"""The command line: what it prints, what it writes, and how it refuses."""

import json
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from sonar_explore import cli
from sonar_explore.agents import make_agent
from sonar_explore.choices import SLAMS as CHOICES
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.load import load_world
from sonar_explore.episodes.commands import default_folder
from sonar_explore.episodes.record import EpisodeRecord, StepRecord
from sonar_explore.errors import SonarExploreError, unknown_name

Capture = pytest.CaptureFixture[str]
SUMMARY_KEYS = {"world", "agent", "slam", "noise", "seed", "end_reason", "scans", "position_error_m"}


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    builder = runpy.run_path(str(Path(__file__).parent / "reports" / "synthetic_record.py"))
    made: EpisodeRecord = builder["synthetic_record"]()
    return made


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch, record: EpisodeRecord) -> SimpleNamespace:
    """A runner that ran already; `calls` holds what it was asked for, `fail` what it shall raise."""
    module = ModuleType("sonar_explore.episodes.run")
    state = SimpleNamespace(calls=[], fail=None)

    def run_episode(*arguments: Any, config: Any, on_step: Callable[[StepRecord], None]) -> EpisodeRecord:
        state.calls.append((*arguments, config))
        if state.fail is not None:
            raise state.fail
        for step in record.steps:
            on_step(step)
        return record

    vars(module).update(run_episode=run_episode)
    monkeypatch.setitem(sys.modules, "sonar_explore.episodes.run", module)
    return state


def tree(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def assert_refused(capsys: Capture, arguments: list[str], *words: str, status: int = 2) -> None:
    assert cli.main(arguments) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("sonar-explore: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["explode"], ["unknown command 'explode'", "run"]),
        (["--explode"], ["--explode"]),
        (["rnu"], ["did you mean 'run'?", "known: ablation"]),
        (["run", "loop", "--slam", "smooth"], ["unknown slam 'smooth' (did you mean 'smoothed'?)", "chain"]),
        (
            ["run", "loop", "--scan", "rign"],
            ["unknown scan 'rign' (did you mean 'ring'?); known: ring, turn"],
        ),
        (["run", "loop", "--sensor", "bat"], ["unknown sensor 'bat'; known: amigobot, nxt"]),
        (["replay", "log", "--slam", "fast"], ["unknown slam 'fast'; known: chain"]),
        (["run"], ["WORLD"]),
        (["run", "loop", "--sed", "3"], ["--sed", "--seed"]),
        (["run", "loop", "--seed", "-1"], ["--seed", "0<=x<=4294967295"]),
        (["run", "loop", "--seed", str(2**32)], ["--seed", "0<=x<=4294967295"]),
        (["run", "loop", "--seed", "three"], ["--seed", "'three' is not a valid whole number"]),
        (["run", "loop", "--max-scans", "0"], ["--max-scans"]),
        (["run", "loop", "bend"], ["bend"]),
        (["worlds", "loop"], ["loop"]),
        (["reproduce", "--worlds", " , "], ["--worlds", "no name"]),
        (["run", "loop", "--out", "x" * 300], ["cannot write into", "too long"]),
        (["world", "x" * 300], ["too long"]),
        (["report"], ["EPISODE"]),
        (["report", "none.json"], ["cannot read none.json"]),
    ],
)
def test_a_bad_command_line_is_refused_in_one_line_and_nothing_is_written(
    capsys: Capture,
    folder: Path,
    runner: SimpleNamespace,
    arguments: list[str],
    words: list[str],
) -> None:
    assert_refused(capsys, arguments, *words)
    assert tree(folder) == []
    assert runner.calls == []


@pytest.mark.parametrize(
    "name, near", [("rooms", "paper/rooms"), ("paper/romos", "paper/rooms"), ("office", "generated/office")]
)
def test_a_world_that_is_nearly_there_is_named(name: str, near: str) -> None:
    with pytest.raises(SonarExploreError, match=f"unknown world '{name}' .did you mean '{near}'"):
        load_world(name)


def test_a_run_in_a_drawing_says_what_scale_was_assumed(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    for world, told in (("plan.png", True), ("plan.png?resolution=0.02", False), ("paper/rooms", False)):
        assert cli.main(["run", world]) == 0
        assert ("scale: 0.05 m a pixel is assumed" in capsys.readouterr().out) is told


def test_an_unknown_name_is_refused_in_one_line_and_no_folder_stays(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    runner.fail = unknown_name("world", "foor", ["corridor", "loop"])
    assert_refused(capsys, ["run", "foor"], "unknown world 'foor'", "corridor, loop")
    assert_refused(capsys, ["run", "foor", "--out", "a/b/c"], "unknown world 'foor'")
    assert tree(folder) == []


def test_an_error_of_many_lines_is_told_in_one(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    runner.fail = SonarExploreError("first\n  second")
    assert_refused(capsys, ["run", "loop"], "first second")


def test_a_folder_that_cannot_be_made_is_refused_before_the_run(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    (folder / "taken").write_text("a file")
    assert_refused(capsys, ["run", "loop", "--out", "taken"], "cannot write into taken")
    assert_refused(capsys, ["run", "loop", "--out", "taken/below"], "cannot write into taken/below")
    assert runner.calls == []
    assert tree(folder) == ["taken"]


def test_a_folder_that_cannot_be_written_is_refused_before_the_run(
    capsys: Capture, folder: Path, runner: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)  # root may write anywhere
    assert_refused(capsys, ["run", "loop", "--out", "shut"], "cannot write into shut: Permission denied")
    assert runner.calls == []
    assert tree(folder) == []


def test_a_log_that_cannot_be_written_is_refused_before_the_run(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    (folder / "taken").mkdir()
    assert_refused(capsys, ["run", "loop", "--log", "taken"], "cannot write taken")
    assert runner.calls == []
    assert tree(folder) == ["taken"]


def test_an_export_that_cannot_be_written_whole_is_not_begun(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    cli.main(["run", "loop", "--out", "a"])
    capsys.readouterr()
    before = tree(folder)
    (folder / "taken.yaml").mkdir()
    for last in (["--map", "/dev/null/map"], ["--truth", "/dev/null/true.txt"], ["--map", "taken"]):
        assert_refused(capsys, ["export", "a/episode.json", "--tum", "way.txt", *last], "cannot write")
    assert tree(folder) == [*before, "taken.yaml"]


def test_a_failed_run_leaves_the_older_one_as_it_was(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    assert cli.main(["run", "loop", "--out", "kept"]) == 0
    capsys.readouterr()
    before = {path: (folder / path).read_bytes() for path in tree(folder) if path != "kept"}
    runner.fail = SonarExploreError("no")
    assert_refused(capsys, ["run", "loop", "--out", "kept"])
    assert before == {path: (folder / path).read_bytes() for path in tree(folder) if path != "kept"}


def test_ctrl_c_ends_with_130_one_line_and_nothing_written(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    runner.fail = KeyboardInterrupt()
    assert_refused(capsys, ["run", "loop"], "interrupted", status=130)
    assert tree(folder) == []


def test_a_run_writes_the_record_and_the_report_and_says_where(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    assert cli.main(["run", "paper/loop", "--seed", "3", "--noise", "worn"]) == 0
    out, err = capsys.readouterr()
    where = "runs/paper-loop-frontier-chain-worn-3"
    assert tree(folder / where) == ["episode.json", "report.html"]
    assert f"report: {where}/report.html" in out
    assert "nothing left to explore" in out
    assert err == ""
    assert runner.calls == [("paper/loop", "frontier", "chain", "worn", 3, None)]


def test_json_is_one_object_and_nothing_else(capsys: Capture, folder: Path, runner: SimpleNamespace) -> None:
    assert cli.main(["run", "loop", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out).keys() >= SUMMARY_KEYS
    assert out.count("\n") == 1
    assert err == ""


def test_max_scans_reaches_the_runner(capsys: Capture, folder: Path, runner: SimpleNamespace) -> None:
    assert cli.main(["run", "loop", "--json", "--max-scans", "5"]) == 0
    assert runner.calls[0][-1].max_scans == 5


def test_a_world_file_names_a_folder_of_one_level(folder: Path) -> None:
    assert str(default_folder("/data/my world.toml", "my.mod:Policy", "off", "paper", 0)) == (
        "runs/data-my world.toml-my.mod-Policy-off-paper-0"
    )


def test_no_choice_overwrites_the_run_of_another(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    choices: list[list[str]] = [
        [],
        ["--scan", "ring"],
        ["--sensor", "nxt"],
        ["--max-scans", "5"],
        ["--seed", "1"],
    ]
    for choice in choices:
        assert cli.main(["run", "loop", *choice]) == 0
    assert len(list((folder / "runs").iterdir())) == len(choices)


@pytest.mark.parametrize(
    ("world", "named"),
    [
        ("generated/home-4?difficulty=0.9", "generated-home-4-difficulty-0.9"),
        ("plan.png?resolution=0.02&start=1,2,90", "plan.png-resolution-0.02-start-1,2,90"),
        ("C:\\plans\\flat.svg", "C--plans-flat.svg"),
        ("../plan.png", "plan.png"),
    ],
)
def test_what_a_shell_or_a_path_would_read_is_not_in_a_folder_name(world: str, named: str) -> None:
    assert str(default_folder(world, "nearest", "off", "paper", 0)) == f"runs/{named}-nearest-off-paper-0"


def test_the_folder_says_which_world_was_drawn_and_is_not_that_of_the_world_by_name(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    env = ExplorationEnv("generated/hall?difficulty=0.2", "off")
    env.reset(seed=3)
    for world in ("generated/hall?difficulty=0.2", env.world.name):
        assert cli.main(["run", world, "--slam", "off", "--seed", "3"]) == 0
    named = env.world.name.translate(str.maketrans("/?=", "---"))
    made = {path.name for path in (folder / "runs").iterdir()}
    assert made == {f"{named}{drawn}-frontier-off-paper-3" for drawn in ("-drawn", "")}


def test_a_policy_named_like_a_module_of_python_s_own_is_told_so(
    capsys: Capture, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "calendar.py").write_text("class Mine:\n    def choose(self, situation): ...\n", "utf-8")
    assert_refused(capsys, ["run", "paper/corridor", "--agent", "calendar:Mine"], "Python's own")


def test_a_policy_in_the_working_folder_is_found(
    capsys: Capture, folder: Path, runner: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p not in ("", str(folder))])
    (folder / "a_policy_here.py").write_text("class Mine:\n    def choose(self, situation): ...\n", "utf-8")
    assert cli.main(["run", "loop", "--json", "--agent", "a_policy_here:Mine"]) == 0
    assert type(make_agent("a_policy_here:Mine")).__name__ == "Mine"
    capsys.readouterr()


def test_slam_offers_all_there_are(capsys: Capture, folder: Path, runner: SimpleNamespace) -> None:
    from sonar_explore.slam import SLAMS

    assert sorted(CHOICES) == sorted(SLAMS)
    for slam in SLAMS:
        assert cli.main(["run", "loop", "--json", "--slam", slam]) == 0
    capsys.readouterr()
    assert [call[2] for call in runner.calls] == list(SLAMS)
    assert_refused(capsys, ["run", "loop", "--slam", "magic"], "'magic'", *SLAMS)


def test_the_report_is_made_again_from_the_record_alone(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    cli.main(["run", "loop", "--out", "a"])
    first = (folder / "a" / "report.html").read_bytes()
    (folder / "a" / "report.html").unlink()
    assert cli.main(["report", "a/episode.json"]) == 0
    assert (folder / "a" / "report.html").read_bytes() == first
    assert cli.main(["report", "a/episode.json", "--out", "again.html"]) == 0
    assert (folder / "again.html").read_bytes() == first


def test_folders_that_are_missing_are_made_whatever_is_written(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    cli.main(["run", "loop", "--out", "a"])
    assert cli.main(["export", "a/episode.json", "--tum", "b/way.txt", "--map", "c/d/map"]) == 0
    assert cli.main(["report", "a/episode.json", "--out", "e/page.html"]) == 0
    assert {"b/way.txt", "c/d/map.yaml", "c/d/map.pgm", "e/page.html"} <= set(tree(folder))


def test_a_report_into_a_folder_that_cannot_be_is_refused(
    capsys: Capture, folder: Path, runner: SimpleNamespace
) -> None:
    cli.main(["run", "loop", "--out", "a"])
    capsys.readouterr()
    assert_refused(
        capsys, ["report", "a/episode.json", "--out", "a/episode.json/b/page.html"], "cannot write"
    )
