"""Write docs/figures: `python -m sonar_explore.studies.figures`."""

from __future__ import annotations

from sonar_explore.studies.figures.page import write_figures

if __name__ == "__main__":
    for written in write_figures():
        print(written)
