# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A tiny comparison: what it leaves, that it can be taken up again, and what it says of the goals."""

import re
from dataclasses import replace

import msgspec
import pytest

from sonar_explore.cli import main
from sonar_explore.episodes.record import Stats
from sonar_explore.studies.compare import jobs
from sonar_explore.studies.compare.accuracy import Accuracy
from sonar_explore.studies.compare.jobs import ARMS, DriveOutcome, drive_jobs, finished_drive
from sonar_explore.studies.compare.page import STYLES
from sonar_explore.studies.compare.results import Comparison, comparison_of
from sonar_explore.studies.compare.study import run_comparison
from sonar_explore.studies.compare.tables import accuracy_table, goal_lines
from sonar_explore.studies.study import Choices


def choices(out, **changes):
    given = {"seeds": 1, "noise": "paper,worn", "worlds": ("paper/corridor",), "jobs": 1, "max_scans": 4}
    return Choices(**{**given, "out": out, **changes})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compare")
    return folder, run_comparison(choices(folder), closed_loop_seeds=1)


def test_every_slam_is_in_the_table_of_every_odometry_and_the_page_opens_with_no_network(finished):
    folder, found = finished
    for noise in ("paper", "worn"):
        rows = accuracy_table(found, noise).rows
        assert [row[1] for row in rows if row[0] == "corridor"] == list(ARMS)
    html = (folder / "index.html").read_text()
    assert all(f">{slam}</text>" in html for slam in STYLES)
    assert "http:" not in html and "https:" not in html
    assert len(re.findall("^### Odometry", (folder / "table.md").read_text(), re.MULTILINE)) == 2


def test_the_results_come_back_from_their_file(finished):
    folder, found = finished
    read = msgspec.json.decode((folder / "results.json").read_bytes(), type=Comparison)
    assert msgspec.json.encode(read) == msgspec.json.encode(found)
    assert [row.success.n for row in found.closed_loop["worn"]] == [1] * 6


def test_what_is_finished_is_not_run_again_and_other_configurations_are_noticed(finished, monkeypatch):
    folder, found = finished
    monkeypatch.setattr(jobs, "compared", lambda *_: pytest.fail("it is run again"))
    assert run_comparison(choices(folder), closed_loop_seeds=1) == found
    job = drive_jobs(("paper/corridor",), ("paper",), 1, choices(folder, max_scans=5).base)[0]
    outcome, current = finished_drive(job, folder)
    assert outcome is not None and not current


def test_a_drive_that_raises_is_said_and_ends_nothing(tmp_path, monkeypatch):
    def fails(*_):
        raise ValueError("no such\nthing")

    monkeypatch.setattr(jobs, "compared", fails)
    found = run_comparison(choices(tmp_path))
    assert not found.rows and len(found.errors) == 1 and "no such thing" in found.errors[0]
    assert "no such thing" in (tmp_path / "table.md").read_text()


def test_half_a_file_is_no_outcome(tmp_path):
    job = drive_jobs(("paper/corridor",), ("paper",), 1, choices(tmp_path).base)[0]
    (tmp_path / job.path).parent.mkdir(parents=True)
    (tmp_path / job.path).write_text('{"world": "pap')
    assert finished_drive(job, tmp_path) == (None, False)


def arm(mean, final=0.02, gap=0.01, update_ms=5.0):
    error = Stats(mean, 2 * mean, final)
    return Accuracy(error, error, mean / 2, gap, 0.04, 10, 1, update_ms, [(0.0, 0.0, 0.0)])


def drives(smoothed, chain=0.1, worn=None, grid_ms=60.0):
    """Ten drives in a loop with these mean errors; the oracle's is 0.05 m."""
    out = []
    for noise in ("paper", "worn"):
        mine = smoothed if noise == "paper" or worn is None else worn
        arms = {name: arm(0.5) for name in ARMS}
        arms |= {"oracle": arm(0.05), "smoothed": arm(mine), "chain": arm(chain)}
        arms |= {"grid-pf": arm(0.5, update_ms=grid_ms)}
        out += [DriveOutcome("paper/loop", noise, s, "f", [(0.0, 0.0)], 9.0, arms, None) for s in range(10)]
    return out


def lines(outcomes):
    found = comparison_of(
        outcomes, worlds=["paper/loop"], noises=["paper", "worn"], seeds=10, base=choices(None).base
    )
    return "\n".join(goal_lines(found))


def test_goals_that_are_reached_are_said_to_be_and_missed_ones_as_well():
    good = lines(drives(0.06))
    assert (
        "within 1.25 of the oracle's mean error, by median and 95th percentile: reached in all worlds" in good
    )
    assert "(loop 1.20 and 1.20)" in good and "(loop 2.00 and 2.00)" in good
    assert "ahead of 4 of 4 baselines" in good and "12.0 times as long" in good and ": reached (0.060" in good
    bad = lines(drives(0.09, chain=0.11, worn=0.2))
    assert bad.count("reached in 0 of 1 worlds") == 2
    assert "missed (0.200 m against 0.110 m)" in bad


def test_an_unknown_odometry_is_one_line_on_stderr(tmp_path, capsys):
    assert main(["compare", "--noise", "paper,wet", "--seeds", "1", "--out", str(tmp_path / "x")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "wet" in said
    assert not (tmp_path / "x").exists()


def test_a_job_is_run_again_when_the_robot_changes():
    base = choices(None).base
    job = drive_jobs(("paper/loop",), ("paper",), 1, base)[0]
    other = drive_jobs(("paper/loop",), ("paper",), 1, replace(base, alternate_spin=False))[0]
    worn = drive_jobs(("paper/loop",), ("worn",), 1, base)[0]
    assert len({job.fingerprint, other.fingerprint, worn.fingerprint}) == 3
