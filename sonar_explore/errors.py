"""The one root of every error that a user can cause and mend."""

from collections.abc import Iterable


class SonarExploreError(Exception):
    """Bad input: its message is one line that says what is wrong and what is possible."""


def unknown_name(
    what: str, name: object, known: Iterable[str], *, hidden: Iterable[str] = ()
) -> SonarExploreError:
    """The error for a name that is not in a registry; lists the names that are, and says which one is near.

    Of names in folders, such as `paper/rooms`, the last part is held against the name's own. `hidden` may be near too,
    but is not listed.
    """
    names = sorted(known)
    near = _nearest(str(name), (*names, *hidden))
    hint = f" (did you mean {near!r}?)" if near else ""
    return SonarExploreError(f"unknown {what} {str(name)!r}{hint}; known: {', '.join(names)}")


def _nearest(name: str, names: Iterable[str]) -> str | None:
    """The name that is most like this one, None where none is."""
    from difflib import get_close_matches

    by_last = {other.rpartition("/")[2].casefold(): other for other in names}
    close = get_close_matches(name.rpartition("/")[2].casefold(), by_last, n=1)
    return by_last[close[0]] if close else None
