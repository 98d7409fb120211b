"""The paper's tests hear the same synthetic rooms as the tests of the package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "slam"))
