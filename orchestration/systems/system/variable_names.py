"""The two parts of a variable's name in a system, COMPONENT.VARIABLE."""


def component_of(variable: str) -> str:
    """The component of COMPONENT.VARIABLE."""
    return variable.partition(".")[0]


def variable_of(variable: str) -> str:
    """The variable of COMPONENT.VARIABLE."""
    return variable.partition(".")[2]
