"""A record is read back whole, or one line says why not."""

import json

import msgspec
import pytest

from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.files import load_record
from sonar_explore.episodes.run import run_episode
from sonar_explore.errors import SonarExploreError


@pytest.fixture(scope="module")
def content():
    record = run_episode("paper/corridor", config=ExplorationConfig(max_scans=1))
    return json.loads(msgspec.json.encode(record))


def refused(tmp_path, content):
    path = tmp_path / "episode.json"
    path.write_text(json.dumps(content))
    with pytest.raises(SonarExploreError) as error:
        load_record(path)
    return str(error.value)


def test_a_record_of_another_version_that_cannot_be_read_says_which_version_wrote_it(content, tmp_path):
    older = {**content, "version": "0.0.1", "summary": {}}
    said = refused(tmp_path, older)
    assert "by version 0.0.1;" in said and "run the episode again" in said


def test_a_record_of_an_older_format_says_what_it_lacks_and_what_to_do(content, tmp_path):
    lacking = {key: value for key, value in content["steps"][0].items() if key != "map_change"}
    said = refused(tmp_path, {**content, "steps": [lacking]})
    assert "older state of the code" in said and "run the episode again" in said and "`map_change`" in said


@pytest.mark.parametrize("other", [{}, [], {"version": "0.0.1"}])
def test_what_is_no_record_at_all_is_not_taken_for_an_old_one(other, tmp_path):
    assert "is not an episode record: " in refused(tmp_path, other)


def test_a_record_without_a_scan_is_none(content, tmp_path):
    assert "without a scan" in refused(tmp_path, {**content, "steps": []})


def test_the_summary_says_which_sonar_and_which_scan_it_was(content):
    config = ExplorationConfig(scan="ring", max_scans=1).with_sensor("nxt")
    summary = run_episode("paper/corridor", config=config).summary
    assert (summary.sensor, summary.scan) == ("nxt", "ring")
    assert (content["summary"]["sensor"], content["summary"]["scan"]) == ("amigobot", "turn")
