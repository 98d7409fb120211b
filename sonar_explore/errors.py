"""The one root of every error that a user can cause and mend."""

from collections.abc import Iterable


class SonarExploreError(Exception):
    """Bad input: its message is one line that says what is wrong and what is possible."""


def unknown_name(what: str, name: object, known: Iterable[str]) -> SonarExploreError:
    """The error for a name that is not in a registry; lists the names that are."""
    return SonarExploreError(f"unknown {what} {str(name)!r}; known: {', '.join(sorted(known))}")
