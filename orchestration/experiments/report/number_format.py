"""Numbers as text."""


def number(value: float) -> str:
    """A number to six digits."""
    return f"{value:.6g}"


def percent(share: float) -> str:
    """A share in percent, to three digits."""
    return f"{100.0 * share:.3g} %"
