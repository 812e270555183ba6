"""`terminalsAndIcons.xml` of FMI 3.0: variables of a slave that are connected together."""

from typing import Any
from xml.etree.ElementTree import Element, SubElement

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
"""Its path in an FMU."""


def to_xml(slave: Any) -> Element | None:
    """The terminals of a `Slave` class; None if it has none.

    Two terminals of one name are connected by the names of their variables (matching rule plug).
    """
    names = dict.fromkeys(v.terminal for v in slave.variables if v.terminal is not None)
    if not names:
        return None
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    listed = SubElement(root, "Terminals")
    for name in names:
        terminal = SubElement(listed, "Terminal", name=name, matchingRule="plug")
        for variable in slave.variables:
            if variable.terminal == name:
                SubElement(
                    terminal,
                    "TerminalMemberVariable",
                    variableName=variable.name,
                    memberName=variable.name,
                    variableKind="signal",
                )
    return root
