"""What was measured where: machine and versions above, figures that are no timings below."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from pathlib import Path

import pytest

FIGURES: list[str] = []


@pytest.fixture
def figure():
    """Note a line for the end of the report."""
    return FIGURES.append


def pytest_report_header() -> list[str]:
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [
            line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line
        ]
        cpu = models[0] if models else cpu
    names = ("sonar-explore", "numpy", "numba", "scipy", "scikit-image", "shapely", "gymnasium", "ir-sim")
    versions = []
    for name in names:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{name} absent")
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    return [
        f"machine: {cpu}, {os.cpu_count()} cores, load {load:.1f}",
        f"system: {platform.platform()}, Python {platform.python_version()}",
        "versions: " + ", ".join(versions),
    ]


def pytest_terminal_summary(terminalreporter) -> None:
    for line in FIGURES:
        terminalreporter.write_line(line)
