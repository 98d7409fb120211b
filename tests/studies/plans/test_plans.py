"""Plans cut to size and cluttered, tours with the map known, and the study over them."""

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sonar_explore.cli import main
from sonar_explore.envs.load import load_world
from sonar_explore.envs.room import room_for
from sonar_explore.envs.world import World
from sonar_explore.episodes.run import run_episode
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.geometry import Pose
from sonar_explore.studies.document import plans_section, with_text
from sonar_explore.studies.plans.buildings import cluttered, cropped, plan_files, reachable_m2, toml_of
from sonar_explore.studies.plans.results import load_plans_study, parts_left
from sonar_explore.studies.plans.study import PlanChoices, run_plans
from sonar_explore.studies.plans.tour import COVER, shortest_order, tour_of

RADIUS_M = 0.18


def box(width: float, height: float) -> World:
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    return World(
        name="box",
        title='A "box"',
        walls=np.hstack([corners, np.roll(corners, -1, axis=0)]),
        roughness=np.array([0.0, 0.1, 0.2, 0.3]),
        cylinders=np.zeros((0, 3)),
        start=Pose(width / 2, height / 2, 0.5),
        has_loop=False,
    )


@pytest.mark.parametrize("name", ["paper/loop", "generated/office-3"])
def test_a_cut_plan_is_as_large_as_allowed_and_closed(name):
    world = load_world(name)
    cut = cropped(world, 15.0)
    assert 10.0 < reachable_m2(cut) <= 15.0
    assert cut.start == world.start
    room = room_for(cut.walls, cut.cylinders)
    reach = room.reachable(cut.start.x, cut.start.y, RADIUS_M)
    assert not (reach[[0, -1]].any() or reach[:, [0, -1]].any())


def test_a_small_plan_stays_as_it_is():
    world = load_world("paper/loop")
    assert cropped(world, 100.0) is world


@pytest.mark.parametrize("name", ["paper/rooms", "generated/hall-2", "generated/home-1"])
def test_clutter_leaves_no_place_shut_in(name):
    world = load_world(name)
    full = cluttered(world)
    assert len(full.walls) + len(full.cylinders) > len(world.walls) + len(world.cylinders)
    room = room_for(full.walls, full.cylinders)
    before = room_for(world.walls, world.cylinders).reachable(world.start.x, world.start.y, RADIUS_M)
    after = room.reachable(world.start.x, world.start.y, RADIUS_M)
    boxed_in = before & room.fits(RADIUS_M) & ~after
    assert boxed_in.sum() * room.cell_m**2 < 0.64 * len(full.walls)  # nothing but the insides of boxes
    wide = room.reachable(world.start.x, world.start.y, RADIUS_M + 0.10)
    assert wide.sum() > 0.6 * before.sum()
    assert cluttered(world).walls.tobytes() == full.walls.tobytes()


def test_a_world_comes_back_from_its_file_to_the_bit(tmp_path):
    for world in (box(3.0, 2.0), load_world("generated/hall-5")):
        path = tmp_path / "world.toml"
        path.write_text(toml_of(world))
        again = load_world(path)
        np.testing.assert_array_equal(again.walls, world.walls)
        np.testing.assert_array_equal(again.cylinders, world.cylinders)
        np.testing.assert_array_equal(again.roughness, world.roughness)
        assert again.title == world.title
        assert (again.start.x, again.start.y) == (world.start.x, world.start.y)
        assert again.start.heading == pytest.approx(world.start.heading)


def test_the_order_visits_everything_once_and_on_a_line_it_is_the_line():
    at = np.array([0.0, 5.0, 1.0, 3.0, 2.0])
    assert shortest_order(np.abs(np.subtract.outer(at, at))) == [0, 2, 4, 3, 1]
    places = np.random.default_rng(0).uniform(0, 10, (25, 2))
    cost = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    order = shortest_order(cost)
    assert order[0] == 0 and sorted(order) == list(range(25))
    crossing = [
        (i, j)
        for i in range(1, 23)
        for j in range(i + 1, 24)
        if cost[order[i - 1], order[j]] + cost[order[i], order[j + 1]]
        < cost[order[i - 1], order[i]] + cost[order[j], order[j + 1]] - 1e-9
    ]
    assert not crossing


def test_a_tour_sees_enough_and_is_no_shorter_than_the_way_to_its_farthest_view():
    world = load_world("paper/rooms")
    tour = tour_of(world)
    scorer = Scorer(world)
    places = np.array([(world.start.x, world.start.y), *tour.views])
    assert scorer.explored_fraction(places) == pytest.approx(tour.seen) and tour.seen >= COVER
    assert tour.length_m >= np.hypot(*(places - places[0]).T).max()
    assert all(world.clearance(places) > RADIUS_M)


def test_a_room_seen_from_its_start_needs_no_tour():
    assert tour_of(box(2.0, 2.0)).length_m == 0.0


def test_what_a_scan_left_out_is_named_with_its_area():
    record = run_episode("paper/rooms", slam="truth", seed=0, config=None)
    stopped = replace_steps(record, 2)
    parts = parts_left(stopped, "paper/rooms")
    scorer = Scorer(load_world("paper/rooms"))
    seen = scorer.explored_fraction(np.array([s.true_pose[:2] for s in stopped.steps]))
    left = (1.0 - seen) * scorer.reachable_area_m2
    assert 0.8 * left < sum(p.area_m2 for p in parts) <= left + 1e-9
    assert parts == sorted(parts, key=lambda p: -p.area_m2)
    assert all(p.drift_m < 1e-5 for p in parts)


def replace_steps(record, count: int):
    return msgspec.structs.replace(record, steps=record.steps[:count])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    data = tmp_path_factory.mktemp("plans")
    (data / "sub").mkdir()
    (data / "sub" / "box.toml").write_text(toml_of(box(4.0, 3.0)))
    (data / "sub" / "notes.json").write_text('{"no": "plan"}')
    out = tmp_path_factory.mktemp("study")
    chosen = PlanChoices(
        data=data,
        generated=2,
        seeds=1,
        noise="paper",
        slam="truth",
        whole=False,
        jobs=1,
        max_scans=3,
        out=out,
    )
    return chosen, run_plans(chosen)


def test_plans_bare_and_with_clutter_and_generated_ones_are_run(study):
    _, found = study
    assert [run.group for run in found.runs] == ["plans", "plans with clutter", "generated", "generated"]
    assert all(run.summary and run.summary.scans <= 3 and run.tour_m >= 0.0 for run in found.runs)


def test_every_failure_has_a_cause_and_a_picture(study):
    chosen, found = study
    failures = found.failures()
    assert failures
    page = (chosen.out / "index.html").read_text()
    assert page.count("<img") == len(failures) == len(list((chosen.out / "failures").glob("*.png")))
    assert not re.search(r"(src|href)=\"https?:", page)
    section = with_text(
        "<!-- explore-plans -->old<!-- end of explore-plans -->", found.kind, plans_section(found)
    )
    assert all(f"### {run.building}, seed" in section for run in failures) and "old" not in section


def test_a_file_that_is_no_plan_is_left_out_and_named(study):
    chosen, found = study
    assert len(found.unread) == 1 and "notes.json" in found.unread[0]
    assert "notes.json" in (chosen.out / "index.html").read_text()


def test_the_documents_show_pictures_of_generated_buildings_alone(study):
    section = plans_section(study[1])
    ours = [run.building for run in study[1].failures() if run.group == "generated"]
    assert ours and section.count("![") == len(ours)


def test_only_runs_that_explored_enough_count_for_the_cost(study):
    runs = study[1].runs
    assert any(run.ratio is None for run in runs if run.summary and run.summary.explored_fraction < 0.97)
    for run in runs:
        s = run.summary
        enough = s is not None and s.explored_fraction >= 0.97
        assert run.ratio == (pytest.approx(s.path_length_m / run.tour_m) if s and enough else None)


def test_taken_up_again_it_runs_nothing_and_finds_the_same(study):
    chosen, found = study
    before = {p: p.stat().st_mtime_ns for p in (chosen.out / "episodes").rglob("*.*")}
    kept = load_plans_study(chosen.out / "results.json")
    assert msgspec.json.encode(run_plans(chosen)) == msgspec.json.encode(found) == msgspec.json.encode(kept)
    assert {p: p.stat().st_mtime_ns for p in (chosen.out / "episodes").rglob("*.*")} == before
    more = replace(chosen, generated=3)
    assert len(run_plans(more).runs) == 5
    assert {p: t for p, t in before.items() if p.stat().st_mtime_ns == t} == before


def test_an_image_that_a_map_file_names_is_no_plan_of_its_own(tmp_path):
    for name in ("a.yaml", "a.pgm", "b.png", "README.md"):
        (tmp_path / name).write_text("x")
    assert [p.name for p in plan_files(tmp_path)] == ["a.yaml", "b.png"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "no folder 'nowhere'"),
        (
            ["--slam", "magic", "--generated", "1"],
            "chain, grid-pf, literal, off, scan-match, smoothed, truth",
        ),
        (["--noise", "loud"], "ideal, paper, worn"),
        (["--generated", "0"], "nothing to run"),
    ],
)
def test_a_wrong_choice_is_one_line_and_leaves_nothing(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SONAR_EXPLORE_DATA", raising=False)
    assert main(["explore-plans", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1
    assert not list(Path().iterdir())
