"""Importing is light, and has no effect but to register the environments."""

import json
import subprocess
import sys

HEAVY = ("matplotlib", "numba", "scipy", "shapely", "skimage", "networkx", "jinja2", "rich")


def modules_after(statement: str) -> list[str]:
    code = f"import sys, json\n{statement}\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules: list[str] = json.loads(done.stdout)
    return modules


def test_importing_the_package_or_the_command_line_imports_nothing_heavy():
    loaded = modules_after("import sonar_explore.cli")
    assert not [name for name in HEAVY if name in loaded]


def test_the_robots_mind_can_be_imported_without_any_plotting():
    assert "matplotlib" not in modules_after("import sonar_explore.explorer, sonar_explore.agents")


def test_an_environment_needs_neither_pictures_nor_pages_nor_scikit_image():
    loaded = modules_after(
        "from sonar_explore.envs.exploration_env import ExplorationEnv; ExplorationEnv('paper/rooms')"
    )
    unneeded = ("matplotlib", "skimage", "networkx", "jinja2", "rich", "pandas", "sonar_explore.reports")
    assert not [name for name in unneeded if name in loaded]


def test_both_environments_are_registered_by_the_import():
    code = "import gymnasium, sonar_explore; print(*gymnasium.registry)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"sonar_explore/AmigoBot-v0", "sonar_explore/Exploration-v0"} <= set(done.stdout.split())
