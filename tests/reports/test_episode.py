"""The page of one episode."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import msgspec
import pytest
from synthetic_record import synthetic_record

from sonar_explore.episodes.files import load_record, save_record
from sonar_explore.episodes.record import AssociationRecord, ChainRecord, EpisodeRecord, FeatureRecord
from sonar_explore.errors import SonarExploreError
from sonar_explore.reports.charts import ticks
from sonar_explore.reports.colours import CHAIN_COLOURS, chain_colours
from sonar_explore.reports.episode import episode_page, write_episode_report
from sonar_explore.reports.frame import frame_of, scale_bar
from sonar_explore.reports.history import chain_history
from sonar_explore.reports.raster import grid_png

HOSTILE = """</script><script>alert(1)</script><img src=x onerror=alert(2)>"'&{{ 7*7 }}"""


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return synthetic_record()


@pytest.fixture(scope="module")
def page(record: EpisodeRecord) -> str:
    return episode_page(record)


class Elements(HTMLParser):
    """Tags with their attributes, and the text of script elements."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1][0] == "script" and data.strip():
            self.scripts.append(data)


def data_of(page: str) -> Any:
    return json.loads(Elements(page).scripts[0])


def test_every_scan_position_is_on_the_map_with_its_number(record: EpisodeRecord, page: str) -> None:
    frame = frame_of(record)
    for step in record.steps:
        x, y = frame.x(step.pose[0]), frame.y(step.pose[1])
        assert f'<circle class="scan" cx="{x}" cy="{y}"/>' in page
        assert f'<text class="number" x="{x}" y="{y}">{step.index}</text>' in page


def test_every_link_of_every_chain_is_drawn_and_every_root_is_heavy(record: EpisodeRecord, page: str) -> None:
    final = page.split('<g id="final"')[1].split("</g>")[0]
    assert final.count("<line ") == sum(len(chain.links) for chain in record.chains)
    assert len(re.findall(r'class="link c\d root', final)) == len(record.chains)


def test_dangling_chains_are_dashed_and_named(page: str) -> None:
    assert re.search(r'<line class="link c\d root dangling"', page)
    assert ">dangling 9</text>" in page


def test_the_page_opens_no_network(page: str) -> None:
    for _, attributes in Elements(page).tags:
        for name in ("src", "href", "xlink:href", "action", "srcset", "data"):
            value = attributes.get(name) or ""
            assert value.startswith(("data:", "#")) or not value, (name, value)
    assert not re.search(r"url\(|@import|https?://|\bfetch\(|XMLHttpRequest|import\(", page)
    assert "default-src 'none'" in page


def test_every_element_that_the_script_asks_for_is_there(page: str) -> None:
    ids = {attributes.get("id") for _, attributes in Elements(page).tags}
    asked = set(re.findall(r'\$\("([\w-]+)"\)', Elements(page).scripts[1]))
    assert asked
    assert asked <= ids


def test_a_hostile_world_name_stays_text() -> None:
    page = episode_page(synthetic_record(HOSTILE))
    elements = Elements(page)
    assert [tag for tag, _ in elements.tags].count("script") == 2
    assert not any("onerror" in attributes for _, attributes in elements.tags)
    assert "&lt;img src=x onerror=alert(2)&gt;" in page
    assert "{{ 7*7 }}" in page


def test_hostile_names_of_terms_and_outcomes_stay_inside_the_data(record: EpisodeRecord) -> None:
    step = record.steps[0]
    assert step.decision is not None
    candidates = [
        msgspec.structs.replace(c, terms={HOSTILE: 1.0, **c.terms}) for c in step.decision.candidates
    ]
    decision = msgspec.structs.replace(step.decision, candidates=candidates, outcome=HOSTILE)
    steps = [msgspec.structs.replace(step, decision=decision), *record.steps[1:]]
    page = episode_page(msgspec.structs.replace(record, steps=steps))
    assert [tag for tag, _ in Elements(page).tags].count("script") == 2
    assert data_of(page)["scans"][0]["decision"]["outcome"] == HOSTILE


def test_the_same_record_gives_the_same_bytes(record: EpisodeRecord, tmp_path: Path) -> None:
    for name in ("a.html", "b.html"):
        write_episode_report(record, tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_record_read_back_gives_the_same_page(record: EpisodeRecord, page: str, tmp_path: Path) -> None:
    save_record(record, tmp_path / "episode.json")
    assert episode_page(load_record(tmp_path / "episode.json")) == page


def test_sixty_scans_stay_below_two_megabytes(record: EpisodeRecord) -> None:
    steps = [msgspec.structs.replace(record.steps[k % 19], index=k) for k in range(60)]
    assert len(episode_page(msgspec.structs.replace(record, steps=steps))) < 2_000_000


def test_each_scan_carries_its_readings_and_its_decision(record: EpisodeRecord, page: str) -> None:
    scans = data_of(page)["scans"]
    assert len(scans) == len(record.steps)
    assert all(len(scan["fan"]) == 90 for scan in scans)
    decision = record.steps[4].decision
    assert decision is not None
    assert len(scans[4]["decision"]["candidates"]) == len(decision.candidates)
    assert scans[-1]["decision"] is None


def test_each_scan_shows_the_map_that_was_known_then(record: EpisodeRecord, page: str) -> None:
    images = [attributes for tag, attributes in Elements(page).tags if tag == "image"]
    assert [int(image["data-s"] or -1) for image in images] == [step.index for step in record.steps]
    changes = [step.map_change for step in record.steps if step.map_change]
    assert [image["href"] for image in images] == [grid_png(change) for change in changes]


def test_a_scan_that_changed_nothing_of_the_map_draws_nothing(record: EpisodeRecord) -> None:
    steps = [record.steps[0], *(msgspec.structs.replace(s, map_change=None) for s in record.steps[1:])]
    assert episode_page(msgspec.structs.replace(record, steps=steps)).count("<image ") == 1


def test_every_word_that_is_linked_is_explained(page: str) -> None:
    explained = {attributes.get("id") for _, attributes in Elements(page).tags}
    linked = set(re.findall(r'"#(word-[\w-]+)"', page))
    assert {"word-root", "word-adr", "word-ndr"} <= linked <= explained


def test_the_terms_of_a_policy_of_ones_own_are_not_guessed_at(record: EpisodeRecord, page: str) -> None:
    assert "travel: length of the way" in page
    decisions = [
        step.decision
        and msgspec.structs.replace(
            step.decision,
            candidates=[msgspec.structs.replace(c, terms={"mine": 1.0}) for c in step.decision.candidates],
        )
        for step in record.steps
    ]
    steps = [msgspec.structs.replace(s, decision=d) for s, d in zip(record.steps, decisions, strict=True)]
    assert "Here:" not in episode_page(msgspec.structs.replace(record, steps=steps))


def test_chains_side_by_side_have_colours_that_look_apart() -> None:
    chains = [ChainRecord(k, [(0, 0.2 * k, 3, 0.2 * k)], 0, 1.0, False) for k in range(40)]
    colours = chain_colours(chains)
    for k in range(39):
        turn = abs(colours[k] - colours[k + 1])
        assert min(turn, CHAIN_COLOURS - turn) > 1


def test_chains_far_apart_use_every_colour() -> None:
    chains = [ChainRecord(k, [(10 * k, 0, 10 * k + 1, 0)], 0, 1.0, False) for k in range(CHAIN_COLOURS)]
    assert set(chain_colours(chains).values()) == set(range(CHAIN_COLOURS))


def test_the_fan_ends_on_the_walls_that_were_heard(record: EpisodeRecord, page: str) -> None:
    frame = frame_of(record)
    _, y, heard = max(data_of(page)["scans"][0]["fan"], key=lambda end: end[1] * end[2])
    assert heard
    assert abs(y - frame.y(0.0)) < 0.1 * frame.scale  # the corridor's lower wall


def test_an_association_that_was_cut_is_told_from_those_that_were_kept(page: str) -> None:
    associations = data_of(page)["scans"][3]["associations"]
    assert [a["kept"] for a in associations].count(False) == 1
    assert all(a["line"] for a in associations)
    assert re.search(r'<line class="cut" [^>]*data-s="3"', page)


def test_an_absorbed_chain_lives_on_in_the_survivor(record: EpisodeRecord) -> None:
    wall = FeatureRecord("wall", (0, 0, 1, 0), 0.0, 1.0, 0.2)
    kept = [AssociationRecord(0, chain, 0, True, 0.0, 0.0, 1.0) for chain in (0, 1)]
    first = msgspec.structs.replace(
        record.steps[0], index=0, features=[wall, wall], associations=[], new_chains=[0, 1], merges=[]
    )
    second = msgspec.structs.replace(
        first, index=1, features=[wall], associations=kept, new_chains=[], merges=[(1, 0)]
    )
    history = chain_history(msgspec.structs.replace(record, steps=[first, second]))
    assert history.born_in == {(0, 0): 0, (0, 1): 1, (1, 0): 1}
    assert history.final(0) == 1
    assert history.roots == {(0, 0), (0, 1)}


def test_merges_in_a_circle_do_not_hang_the_report(record: EpisodeRecord) -> None:
    step = msgspec.structs.replace(record.steps[0], merges=[(1, 0), (0, 1), (2, 2)])
    steps = [step, *record.steps[1:]]
    assert "</html>" in episode_page(msgspec.structs.replace(record, steps=steps))


def test_a_record_of_one_scan_and_no_chain_has_a_page(record: EpisodeRecord) -> None:
    step = msgspec.structs.replace(
        record.steps[0], features=[], associations=[], new_chains=[], decision=None, trail=[], true_trail=[]
    )
    assert "</html>" in episode_page(msgspec.structs.replace(record, steps=[step], chains=[]))


def test_a_record_without_a_scan_is_refused_in_one_line(record: EpisodeRecord) -> None:
    with pytest.raises(SonarExploreError, match="without a scan"):
        episode_page(msgspec.structs.replace(record, steps=[]))


def test_a_grid_that_cannot_be_unpacked_is_refused_in_one_line(record: EpisodeRecord) -> None:
    grid = msgspec.structs.replace(record.grid, states="!")
    steps = [msgspec.structs.replace(record.steps[0], map_change=grid), *record.steps[1:]]
    with pytest.raises(SonarExploreError, match="grid cannot be unpacked"):
        episode_page(msgspec.structs.replace(record, steps=steps))


@pytest.mark.parametrize("content", [b"", b"{}", b"\xff", b'{"version": 3}', b"[" * 100_000])
def test_a_file_that_is_no_record_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "episode.json"
    path.write_bytes(content)
    with pytest.raises(SonarExploreError, match="is not an episode record") as caught:
        load_record(path)
    assert "\n" not in str(caught.value)


def test_a_failed_write_leaves_the_old_file_and_no_other(
    record: EpisodeRecord, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "episode.json"
    path.write_text("old")
    monkeypatch.setattr(
        "os.replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device"))
    )
    with pytest.raises(SonarExploreError, match="No space left"):
        save_record(record, path)
    assert [p.name for p in tmp_path.iterdir()] == ["episode.json"]
    assert path.read_text() == "old"


@pytest.mark.parametrize("top", [1e-4, 0.03, 0.7, 1.0, 4.9, 20.0, 333.0])
def test_ticks_start_at_zero_hold_the_top_and_are_few(top: float) -> None:
    marks = ticks(top, 5)
    assert marks[0] == 0.0
    assert marks[-1] >= top * (1 - 1e-9)
    assert len(marks) <= 6


def test_the_scale_bar_is_a_round_length(record: EpisodeRecord) -> None:
    assert scale_bar(frame_of(record)) in (0.1, 0.2, 0.5, 1, 2, 5)


def test_a_long_episode_numbers_every_25th_scan_and_a_short_one_every_scan(record: EpisodeRecord) -> None:
    step = record.steps[0]
    steps = [msgspec.structs.replace(step, index=i) for i in range(151)]
    long = episode_page(msgspec.structs.replace(record, steps=steps))
    assert long.count('class="number"') == 7 and long.count('class="number minor"') == 144
    assert 'class="number minor"' not in episode_page(record)
