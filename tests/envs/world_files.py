"""World files in foreign formats, as the tests of the readers write them."""

from pathlib import Path

import numpy as np
import pytest
import skimage.io

from sonar_explore.envs.load import load_world
from sonar_explore.errors import SonarExploreError

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="6m" height="4m" viewBox="0 0 600 400">{}</svg>'
ROOM = '<rect x="10" y="10" width="580" height="380"/>'
MAP = """2D-Map
LineMinPos: 0 0
NumLines: 7
Cairn: RobotHome 1000 1500 90 "" ICON "Home"
LINES
0 0 6000 0
6000 0 6000 4000
6000 4000 0 4000
0 4000 0 0
DATA
3000 2000
3010 2010
5990 1000
5990 1010
"""
YAML = """image: map.pgm
resolution: 0.05
origin: [-1.0, -2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
TOML = (
    'title = "t"\n[start]\nx = 1\ny = 1\n[[wall]]\npoints = [[0, 0], [3, 0], [3, 3], [0, 3]]\nclosed = true\n'
)


def written(tmp_path: Path, name: str, text: str | bytes) -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def map_image(tmp_path: Path, free: int = 254, wall: int = 0, unknown: int = 205) -> Path:
    image = np.full((60, 100), unknown, dtype=np.uint8)
    image[9:51, 9:91] = wall
    image[10:50, 10:90] = free
    skimage.io.imsave(tmp_path / "map.pgm", image, check_contrast=False)
    return tmp_path / "map.pgm"


def error_of(path: str | Path) -> str:
    with pytest.raises(SonarExploreError) as caught:
        load_world(path)
    message = str(caught.value)
    assert "\n" not in message
    return message
