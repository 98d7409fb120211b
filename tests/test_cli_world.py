"""`sonar-explore world`: what was read, as text, as JSON and as a picture."""

import json
from pathlib import Path

import pytest

from sonar_explore import cli

Capture = pytest.CaptureFixture[str]


def test_it_says_what_was_read(capsys: Capture) -> None:
    assert cli.main(["world", "paper/rooms"]) == 0
    out = capsys.readouterr().out
    for words in (
        "Three rooms on a corridor",
        "9.0 x 8.7 m",
        "49, 64 m together; 2 columns",
        "3 no wider than 1.1 m",
    ):
        assert words in out
    assert "warning" not in out


def test_json_is_one_object_and_nothing_else(capsys: Capture) -> None:
    assert cli.main(["world", "paper/open-loop", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["has_loop"] and found["loops"] == 1 and found["closed"] and found["warnings"] == []
    assert found["reached_share"] > 0.98
    assert found["free_area_m2"] == pytest.approx(39.03, abs=0.01)


def test_the_narrowest_door_is_as_wide_as_it_is_drawn(capsys: Capture) -> None:
    assert cli.main(["world", "paper/rooms", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["narrowest_passage_m"] == pytest.approx(0.83, abs=0.06)


def test_a_picture_is_written(capsys: Capture, tmp_path: Path) -> None:
    assert cli.main(["world", "generated/home-3", "--out", str(tmp_path / "home.png")]) == 0
    assert (tmp_path / "home.png").read_bytes().startswith(b"\x89PNG")
    assert "picture: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("room", "expected"),
    [
        ("points = [[0, 0], [400, 0], [400, 300], [0, 300]]\nclosed = true", "is the scale right"),
        ("points = [[0, 0], [4, 0], [4, 3], [0, 3]]", "the walls do not close"),
        ("points = [[0.8, 0], [4, 0], [4, 3], [0.8, 3]]\nclosed = true", "free: ("),
    ],
)
def test_it_warns(capsys: Capture, tmp_path: Path, room: str, expected: str) -> None:
    file = tmp_path / "my.toml"
    file.write_text(f'title = "t"\n[start]\nx = 1\ny = 1\n[[wall]]\n{room}\n')
    assert cli.main(["world", str(file)]) == 0
    out = capsys.readouterr().out
    assert "warning" in out and expected in out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["none.svg"], "no world file"),
        (["foor"], "unknown world 'foor'"),
        (["generated/castle"], "generated/office"),
        (["paper/rooms?start=0.1,0.1"], "free: ("),
        (["plan.png?start=nan,1"], "is no place in metres"),
        (["paper/rooms?start=1,1e400"], "is no place in metres"),
        (["paper/rooms", "--out", "/dev/null/picture.png"], "cannot write"),
        (["paper/rooms", "--out", "picture.xyz"], "cannot write the picture"),
        ([], "FILE"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], expected: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["world", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and expected in err
