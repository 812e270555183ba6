"""Numbers as sentences have them."""


def number(value: float) -> str:
    """To six digits."""
    return f"{value:.6g}"


def percent(share: float) -> str:
    """A share, finer near the ends."""
    return f"{100.0 * share:.3g} %"
