"""Write docs/conformance.md: `python -m sonar_explore.studies.conformance`."""

from __future__ import annotations

import sys

from sonar_explore.studies.conformance.page import PAGE, conformance_page, problems


def main() -> int:
    """Write the page, or say what keeps it from being made."""
    found = problems()
    for problem in found:
        print(problem, file=sys.stderr)
    if not found:
        PAGE.write_text(conformance_page(), encoding="utf-8")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
