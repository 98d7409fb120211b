"""The elements of an SVG file, and the lengths that their attributes give."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from sonar_explore.errors import SonarExploreError

MAX_ELEMENTS = 20_000
MAX_DEPTH = 64
MAX_ENTITY = 200
"""Characters; some editors write the addresses of their namespaces as entities."""
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
USER_UNITS = {"": 1.0, "px": 1.0, "pt": 96 / 72, "pc": 16.0} | {k: m * 96 / 0.0254 for k, m in METRES.items()}
LENGTH = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(px|pt|pc|mm|cm|m|in|)\s*")


@dataclass
class Element:
    """A tag without its namespace, its attributes, and what it holds."""

    tag: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)

    def number(self, name: str, default: float = 0.0) -> float:
        """An attribute that is a length, in user units."""
        text = self.attributes.get(name, "")
        if not text.strip():
            return default
        return length(text, USER_UNITS, f"{name} of <{self.tag}>")

    @property
    def hidden(self) -> bool:
        """Whether its own attributes take it, and all inside it, out of the drawing."""
        style = self.attributes.get("style", "").replace(" ", "")
        return self.attributes.get("display") == "none" or "display:none" in style


def parse_xml(path: Path, data: bytes) -> Element:
    """The elements of an XML file; entities that could grow, and depth without end, are refused."""
    root = Element("", {})
    open_elements, count = [root], 0

    def begin(tag: str, attributes: dict[str, str]) -> None:
        """An element opens."""
        nonlocal count
        count += 1
        if count > MAX_ELEMENTS or len(open_elements) > MAX_DEPTH:
            raise ValueError(f"more than {MAX_ELEMENTS} elements, or nested deeper than {MAX_DEPTH}")
        element = Element(_local(tag), {_local(key): value for key, value in attributes.items()})
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def entity(name: str, _: bool, value: str | None, *__: str | None) -> None:
        """An entity is declared: one that is short and plain is let pass."""
        if value is None or len(value) > MAX_ENTITY or "&" in value:
            raise ValueError(f"the entity {name[:40]!r} is refused")

    parser = expat.ParserCreate()
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise SonarExploreError(f"{path.name}: no SVG, for it is no XML: {error}") from None
    except (ValueError, LookupError) as error:
        raise SonarExploreError(f"{path.name}: {' '.join(str(error).split())}") from None
    return root.children[0]


def _local(name: str) -> str:
    return name.rpartition(":")[2]


def length(text: str, units: dict[str, float], what: str) -> float:
    """A number and its unit, as a multiple of what the units are told in; `what` is named in the error."""
    match = LENGTH.fullmatch(text)
    if match is None or abs(value := float(match.group(1)) * units[match.group(2)]) > 1e9:
        raise ValueError(f"{what} is no length: {text[:40]!r}")
    return value
