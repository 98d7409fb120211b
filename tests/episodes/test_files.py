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
    assert "but of 0.0.1; run the episode again" in refused(tmp_path, older)


def test_a_broken_record_of_this_version_says_what_is_missing_and_nothing_of_versions(content, tmp_path):
    said = refused(tmp_path, {**content, "summary": {}})
    assert "`world`" in said and "version" not in said


def test_a_record_without_a_scan_is_none(content, tmp_path):
    assert "without a scan" in refused(tmp_path, {**content, "steps": []})


def test_the_summary_says_which_sonar_and_which_scan_it_was(content):
    config = ExplorationConfig(scan="ring", max_scans=1).with_sensor("nxt")
    summary = run_episode("paper/corridor", config=config).summary
    assert (summary.sensor, summary.scan) == ("nxt", "ring")
    assert (content["summary"]["sensor"], content["summary"]["scan"]) == ("amigobot", "turn")
