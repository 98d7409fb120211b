"""Numbers in sentences."""


def counted(n: int, what: str) -> str:
    """A number and what it counts.

    >>> counted(1, "scan"), counted(0, "scan")
    ('1 scan', '0 scans')
    """
    return f"{n} {what}" if n == 1 else f"{n} {what}s"
