"""SVG: the building that is drawn, however it is drawn, or one line."""

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from world_files import ROOM, SVG, error_of, written

from sonar_explore.envs.load import load_world
from sonar_explore.envs.readers.svg_path import flatten, parse_path
from sonar_explore.envs.readers.svg_transform import parse_transform
from sonar_explore.envs.world import World


def svg(tmp_path: Path, inside: str) -> World:
    return load_world(written(tmp_path, "plan.svg", SVG.format(inside)))


def test_an_svg_is_in_metres_with_y_up(tmp_path: Path) -> None:
    inside = ROOM + '<circle cx="300" cy="100" r="20"/><line id="start" x1="100" y1="300" x2="100" y2="200"/>'
    world = svg(tmp_path, inside)
    assert world.bounds == pytest.approx((0.1, 0.1, 5.9, 3.9))
    assert world.cylinders == pytest.approx(np.array([[3.0, 3.0, 0.2]]))
    assert (world.start.x, world.start.y, world.start.heading) == pytest.approx((1.0, 1.0, math.pi / 2))


@pytest.mark.parametrize(
    "shape",
    [
        '<polygon points="200,100 300,100 300,200 200,200"/>',
        '<polyline points="200 100 300 100 300 200 200 200 200 100"/>',
        '<path d="M200,100h100v100H200z"/>',
        '<path d="m 200 100 100 0 0 100 -100 0 Z"/>',
        '<path d="M200 100L300 100 300 200 200 200V100"/>',
        '<g transform="translate(200 100)"><g transform="scale(2)"><rect width="50" height="50"/></g></g>',
        '<rect x="-300" y="100" width="100" height="100" transform="matrix(-1 0 0 1 0 0)"/>',
        '<rect x="100" y="-300" width="100" height="100" transform="rotate(90)"/>',
        '<defs><rect id="r" width="100" height="100"/></defs><use href="#r" x="200" y="100"/>',
        '<rect x="200" y="100" width="100" height="100"/><rect width="9" height="9" style="display: none"/>',
    ],
)
def test_a_square_is_a_square_however_it_is_drawn(tmp_path: Path, shape: str) -> None:
    walls = svg(tmp_path, ROOM + shape).walls[4:]
    faces = shapely.get_parts(shapely.polygonize(list(shapely.linestrings(walls.reshape(-1, 2, 2)))))
    assert len(faces) == 1
    assert faces[0].equals(shapely.box(2.0, 2.0, 3.0, 3.0)) or faces[0].symmetric_difference(
        shapely.box(2.0, 2.0, 3.0, 3.0)
    ).area == pytest.approx(0.0, abs=1e-9)


def test_the_scale_may_be_an_attribute_a_width_or_an_option(tmp_path: Path) -> None:
    room = '<rect x="0" y="0" width="500" height="400"/></svg>'
    said = written(tmp_path, "a.svg", f'<svg data-metres-per-unit="0.02" viewBox="0 0 500 400">{room}')
    assert load_world(said).bounds == pytest.approx((0, 0, 10, 8))
    wide = written(tmp_path, "b.svg", f'<svg width="5000mm" height="4000mm" viewBox="0 0 500 400">{room}')
    assert load_world(wide).bounds == pytest.approx((0, 0, 5, 4))
    none = written(tmp_path, "c.svg", f'<svg width="500" height="400">{room}')
    assert "no scale" in error_of(none)
    for attribute, value in (("viewBox", "0 0 half 9"), ("data-metres-per-unit", "half")):
        broken = error_of(written(tmp_path, "d.svg", f'<svg {attribute}="{value}"></svg>'))
        assert f"{attribute} of <svg> holds no number: 'half'" in broken
    assert "no SVG, for it is no XML" in error_of(written(tmp_path, "e.svg", "<svg"))
    assert load_world(none, resolution_m=0.01).bounds == pytest.approx((0, 0, 5, 4))


@pytest.mark.parametrize("flags", ["0 0", "0 1", "1 0", "1 1"])
def test_an_arc_stays_on_its_circle(flags: str) -> None:
    ((*curves,),) = parse_path(f"M 0 0 A 2 2 0 {flags} 2 2")
    chain = np.vstack([[(0.0, 0.0)], *(flatten(np.array(curve)) for curve in curves)])
    large, sweep = flags.split()
    centre = (2.0, 0.0) if large == sweep else (0.0, 2.0)
    radii = np.hypot(*(chain - centre).T)
    assert radii == pytest.approx(np.full(len(chain), 2.0), abs=1e-3)
    length = np.hypot(*np.diff(chain, axis=0).T).sum()
    assert length == pytest.approx((3 if large == "1" else 1) * math.pi, rel=0.01)


def test_a_curve_is_few_straight_pieces_within_a_centimetre() -> None:
    ((curve,),) = parse_path("M0 0C0 1 1 2 2 2")
    chain = shapely.LineString(np.vstack([[(0.0, 0.0)], flatten(np.array(curve))]))
    t = np.linspace(0, 1, 200)[:, None]
    p = np.array(curve)
    exact = (1 - t) ** 3 * p[0] + 3 * t * (1 - t) ** 2 * p[1] + 3 * t**2 * (1 - t) * p[2] + t**3 * p[3]
    assert shapely.distance(chain, shapely.points(exact)).max() <= 0.01
    assert len(chain.coords) <= 14


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-180, 180))
def test_transforms_apply_from_right_to_left(x: float, y: float, angle: float) -> None:
    both = parse_transform(f"translate({x},{y}) rotate({angle})")
    assert both == pytest.approx(parse_transform(f"translate({x} {y})") @ parse_transform(f"rotate({angle})"))


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ("", "no lines"),
        ("<rect", "plan.svg"),
        ('<path d="M0 0 X"/>', "unknown path command 'X'"),
        ('<path d="L 1 1"/>', "begins with M"),
        ('<path d="M 0 1e99"/>', "too large"),
        ('<path d="M 0 0 A 1 1 0 2 0 1 1"/>', "flag of an arc"),
        ('<rect width="9%" height="1"/>', "no length"),
        ('<g transform="spin(3)"/>', "no transform"),
        ('<polyline points="1,a 2,3"/>', "could not convert"),
        ('<g id="a"><use href="#a"/></g>', "clones counted"),
        ("<g>" * 100 + "</g>" * 100, "nested deeper"),
        ("<g/>" * 30_000, "more than"),
        (ROOM + '<circle id="start" cx="10" cy="10" r="5"/>', "free: ("),
    ],
)
def test_a_broken_svg_is_one_line(tmp_path: Path, inside: str, expected: str) -> None:
    assert expected in error_of(written(tmp_path, "plan.svg", SVG.format(inside)))


def test_entities_that_could_grow_are_refused(tmp_path: Path) -> None:
    bomb = '<!DOCTYPE svg [<!ENTITY a "xx"><!ENTITY b "&a;&a;">]>' + SVG.format("&b;")
    assert "entity 'b' is refused" in error_of(written(tmp_path, "plan.svg", bomb))
    outside = '<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]>' + SVG.format("&a;")
    assert "refused" in error_of(written(tmp_path, "plan.svg", outside))
    short = '<!DOCTYPE svg [<!ENTITY ns "http://ns">]>' + SVG.format(ROOM + '<g a="&ns;"/>')
    assert len(load_world(written(tmp_path, "plan.svg", short)).walls) == 4
