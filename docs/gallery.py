"""Make docs/gallery.md and its pictures: `python docs/gallery.py`."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from sonar_explore.envs.load import load_world, shipped_worlds
from sonar_explore.envs.plan_picture import draw_plan
from sonar_explore.envs.survey import DOOR_MAX_M, survey
from sonar_explore.envs.world import World
from sonar_explore.wording import counted

DOCS = Path(__file__).parent
GENERATED = (
    *("generated/office-3?difficulty=0.2", "generated/office-1", "generated/office-9?difficulty=0.9"),
    *("generated/home-0?difficulty=0.2", "generated/home-2", "generated/home-3?difficulty=0.9"),
    *("generated/maze-1?difficulty=0.2", "generated/maze-2", "generated/maze-3?difficulty=0.9"),
    *("generated/hall-1?difficulty=0.2", "generated/hall-1", "generated/hall-3?difficulty=0.9"),
)
COLUMNS = 3
COLOURS = 96
"""Of a picture's palette: keeps it small."""
HEAD = """# Gallery

Made by `python docs/gallery.py`. Blue is what the robot's disc can reach, the orange arrow where it starts. Narrow
passages are those up to {door:.1f} m wide between roomier places; loops are blocks of 1 m2 or more to drive round.
`sonar-explore world NAME --out picture.png` draws a larger picture, of your own file as well.
"""


def main() -> None:
    """Draw what is shown, and write the page."""
    (DOCS / "gallery").mkdir(exist_ok=True)
    parts = [
        HEAD.format(door=DOOR_MAX_M),
        "## Shipped\n",
        table(shipped_worlds()),
        "\n## Generated\nFour kinds, any seed, difficulty 0 to 1, 0.5 if not said; see [worlds](worlds.md).\n",
        table(GENERATED),
    ]
    (DOCS / "gallery.md").write_text("\n".join(parts), encoding="utf-8")


def table(names: tuple[str, ...]) -> str:
    """A table of pictures, three in a row, each with its figures below."""
    cells = [cell(load_world(name)) for name in names]
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [cells[i : i + COLUMNS] for i in range(0, len(cells), COLUMNS)]
    lines = ["| " * COLUMNS + "|", "|---" * COLUMNS + "|", *("| " + " | ".join(row) + " |" for row in rows)]
    return "\n".join(lines) + "\n"


def cell(world: World) -> str:
    """A picture and its figures."""
    found = survey(world)
    file = DOCS / "gallery" / (world.name.replace("/", "-").partition("?")[0] + f"{hardness(world)}.png")
    small_picture(world, file)
    return (
        f"![{world.name}](gallery/{file.name})<br>`{world.name}`<br>{world.title}<br>"
        f"{found.free_area_m2:.0f} m2, {counted(found.doors, 'narrow passage')}, {counted(found.loops, 'loop')}"
    )


def hardness(world: World) -> str:
    """The difficulty in a file's name."""
    return world.name.partition("?difficulty=")[2].replace("0.", "-d")


def small_picture(world: World, file: Path) -> None:
    """The plan alone, 360 pixels wide, few colours."""
    figure = Figure(figsize=(3.6, 3.0), layout="constrained")
    axes = figure.add_subplot()
    draw_plan(axes, world)
    axes.set_axis_off()
    figure.savefig(file, dpi=100)
    Image.open(file).convert("RGB").quantize(COLOURS).save(file, optimize=True)


if __name__ == "__main__":
    main()
