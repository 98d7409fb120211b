"""Figures 5 to 12 can be drawn, and come out the same every time."""

from itertools import islice

import numpy as np
import pytest

from sonar_explore.slam.link_graph import ANGLE_MARGIN_RAD
from sonar_explore.studies.figures.moments import Moment, moments
from sonar_explore.studies.figures.page import FIGURES, write_figures


@pytest.fixture(scope="module")
def moment() -> Moment:
    """The most telling of the first few scans."""
    return max(islice(moments(), 5), key=lambda m: m.rank)


def test_the_chains_are_those_that_the_scan_met(moment):
    assert {a.association.chain for a in moment.update.associations} <= {c.id for c in moment.chains}
    assert all(link.scan < moment.update.index for c in moment.chains for link in c.links)


def test_the_window_of_figure_7_is_the_one_that_slam_used(moment):
    adr, fits = moment.adr_rad, moment.update.link_graphs.angle_fits
    window = np.abs(adr).mean() + ANGLE_MARGIN_RAD
    assert (fits == (np.abs(adr[None, :] - adr[:, None]) <= window + 1e-9)).all()


def test_all_figures_are_drawn_and_the_same_each_time(moment, tmp_path):
    first, second = (write_figures(tmp_path / name, moment) for name in ("a", "b"))
    assert len(first) == len(FIGURES) == 8
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]
    assert all(f"figure-{n:02d}.svg" in (tmp_path / "a/README.md").read_text() for n in FIGURES)
