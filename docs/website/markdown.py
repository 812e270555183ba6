"""The Markdown of the pages, which code hosts read, as the generator of the site reads it."""

import re
import textwrap

TITLED = re.compile(r"^```(\w+) (\S+)$", re.MULTILINE)
"""The beginning of a code block with the name of its file."""
INDENTED = re.compile(r"(?<=\n\n)(?:    .*(?:\n|\Z))+")
COMMAND = re.compile(r"(?:quadcosim|make|pip|python3?|\.venv/\S+|\.|cc|dask|git) ")
"""How a block of commands begins."""


def for_the_site(markdown: str) -> str:
    """`markdown` with the names of files above their code blocks, and with blocks of commands coloured."""
    return INDENTED.sub(_coloured, TITLED.sub(r'```\1 title="\2"', markdown))


def _coloured(block: re.Match[str]) -> str:
    text = textwrap.dedent(block[0])
    return f"```sh\n{text}```\n" if COMMAND.match(text) else block[0]
