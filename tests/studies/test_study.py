"""A tiny study: what it leaves, that it can be taken up again, and that nothing stops it."""

import base64
import gzip
import os
import re
from pathlib import Path

import msgspec
import pytest

from sonar_explore.cli import main
from sonar_explore.studies import episode, runner
from sonar_explore.studies.document import with_section
from sonar_explore.studies.jobs import Job, Variant, jobs_of
from sonar_explore.studies.reproduce import run_reproduction
from sonar_explore.studies.results import load_study
from sonar_explore.studies.runner import plan, run_jobs
from sonar_explore.studies.store import load_record_packed, record_path
from sonar_explore.studies.study import Choices

ARMS = ("chain", "off")


def choices(out: Path, **changes) -> Choices:
    given = {"seeds": 2, "noise": "paper", "worlds": ("paper/corridor",), "jobs": 1, "max_scans": 3}
    return Choices(**{**given, "out": out, **changes})


def jobs(out: Path, **changes) -> list[Job]:
    c = choices(out, **changes)
    return jobs_of(c.worlds, [Variant(a, slam=a) for a in ARMS], range(c.seeds), c.noise, c.base)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """(folder, study), two seeds in both arms."""
    folder = tmp_path_factory.mktemp("study")
    return folder, run_reproduction(choices(folder), ARMS)


def times(folder: Path) -> dict[Path, int]:
    return {p: p.stat().st_mtime_ns for p in (folder / "episodes").rglob("*.*")}


def test_both_arms_of_a_seed_meet_the_same_luck(finished):
    folder, _ = finished
    for seed in range(2):
        paths = [record_path(folder / f"episodes/{arm}/paper-corridor/{seed:04d}.json") for arm in ARMS]
        first, second = (load_record_packed(path) for path in paths)
        assert first.steps[0].scan_ranges_m == second.steps[0].scan_ranges_m
        assert first.config == second.config


def test_the_results_say_what_was_run_and_how_each_episode_ended(finished):
    folder, study = finished
    assert msgspec.json.encode(load_study(folder / "results.json")) == msgspec.json.encode(study)
    assert [(r.world, r.variant, r.success.n) for r in study.rows] == [("paper/corridor", a, 2) for a in ARMS]
    assert all(o.summary.scans == 3 and o.error is None for o in study.outcomes)
    assert study.config["max_scans"] == 3
    assert study.rows[0].causes == {"unexplored": 2}


def test_the_table_says_plainly_that_the_goal_is_missed(finished):
    text = (finished[0] / "table.md").read_text()
    assert "missed in 1 of 1" in text and "explored 2" in text
    assert len(re.findall(r"^\| corridor", text, re.MULTILINE)) == 2


def test_a_rerun_runs_nothing(finished):
    folder, study = finished
    before = times(folder)
    assert run_reproduction(choices(folder), ARMS) == study
    assert times(folder) == before


def test_every_link_of_every_page_leads_to_a_file_and_none_to_the_network(finished):
    folder, _ = finished
    for page in ("index.html", "figure-14.html"):
        html = (folder / page).read_text()
        links = set(re.findall(r'href="([^"#]+)"', html))
        assert not [t for t in links if not t.startswith("data:") and not (folder / t).exists()]
        assert "http:" not in html and "https:" not in html
    squares = (folder / "figure-14.html").read_text()
    assert all(
        f"episodes/{arm}/paper-corridor/000{seed}.html" in squares for arm in ARMS for seed in range(2)
    )


def test_the_packed_page_holds_the_report(finished):
    html = (finished[0] / "episodes/chain/paper-corridor/0000.html").read_text()
    packed = re.search(r'packed = "([^"]+)"', html).group(1)
    assert "A straight corridor" in gzip.decompress(base64.b64decode(packed)).decode()


def test_more_seeds_run_only_what_is_missing(finished):
    folder, _ = finished
    todo = plan(jobs(folder, seeds=3), folder, with_record=True)
    assert [job.seed for job in todo.left] == [2, 2] and len(todo.done) == 4 and todo.outdated == 0


def test_another_configuration_is_noticed(finished):
    folder, _ = finished
    todo = plan(jobs(folder, max_scans=4), folder, with_record=True)
    assert (todo.outdated, len(todo.left), todo.done) == (4, 4, ())


def test_half_a_file_is_no_outcome(finished, tmp_path):
    job = jobs(tmp_path, seeds=1)[0]
    (tmp_path / job.path).parent.mkdir(parents=True)
    (tmp_path / job.path).write_text('{"world": "paper/corr')
    todo = plan([job], tmp_path, with_record=False)
    assert todo.left == (job,) and todo.outdated == 0


def test_an_exception_is_recorded_and_ends_nothing(tmp_path, monkeypatch):
    run = episode.run_episode

    def fails_at_seed_0(world, **arguments):
        if arguments["seed"] == 0:
            raise ValueError("a wall\nof <no> length")
        return run(world, **arguments)

    monkeypatch.setattr(episode, "run_episode", fails_at_seed_0)
    study = run_reproduction(choices(tmp_path), ["chain"])
    failed, fine = study.outcomes
    assert failed.summary is None and failed.error.startswith("ValueError: a wall of <no> length (")
    assert fine.summary is not None
    assert study.rows[0].causes == {"unexplored": 1, "exception": 1}
    assert "of &lt;no&gt; length" in (tmp_path / "figure-14.html").read_text()


def test_a_study_in_which_everything_raised_still_has_its_pages(tmp_path, monkeypatch):
    def fails(*_, **__):
        raise ValueError("no")

    monkeypatch.setattr(episode, "run_episode", fails)
    study = run_reproduction(choices(tmp_path), ARMS)
    assert [row.causes for row in study.rows] == [{"exception": 2}] * 2
    assert (tmp_path / "index.html").exists()


def test_an_interrupt_leaves_what_is_done(tmp_path):
    def stop(outcome):
        raise KeyboardInterrupt

    todo = jobs(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run_jobs(todo, tmp_path, processes=1, keep_record=False, on_done=stop)
    assert len(plan(todo, tmp_path, with_record=False).done) == 1


def test_processes_give_the_same_outcomes_each_with_one_thread(finished, tmp_path, monkeypatch):
    seen = {}
    pool = runner._pool

    def watched(processes):
        seen.update({name: os.environ[name] for name in runner.ONE_THREAD})
        return pool(processes)

    monkeypatch.setattr(runner, "_pool", watched)
    outcomes = run_jobs(jobs(tmp_path, seeds=1), tmp_path, processes=2, keep_record=False)
    assert set(seen.values()) == {"1"}
    known = {(o.variant, o.seed): o for o in finished[1].outcomes}
    for found in outcomes:
        pair = (found.summary, known[found.variant, found.seed].summary)
        first, second = (msgspec.structs.replace(summary, wall_time_s=0.0) for summary in pair)
        assert first == second


def test_the_page_of_the_docs_takes_the_table_and_keeps_the_rest(finished):
    page = "a\n<!-- reproduce -->\nold\n<!-- end of reproduce -->\nz\n"
    new = with_section(page, finished[1])
    assert (
        new.startswith("a\n") and new.endswith("\nz\n") and "old" not in new and "| corridor | chain |" in new
    )
    assert with_section(new, finished[1]) == new


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--worlds", "paper/moon"], "paper/corridor"),
        (["--arms", "magic"], "chain, grid-pf, literal"),
        (["--noise", "loud"], "ideal, paper, worn"),
    ],
)
def test_a_wrong_name_is_one_line_and_makes_no_folder(arguments, words, tmp_path, capsys):
    assert main(["reproduce", "--out", str(tmp_path / "out"), *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not (tmp_path / "out").exists()
