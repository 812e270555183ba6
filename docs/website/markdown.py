"""The Markdown of the pages, converted from that of code hosts to that of the site generator."""

import re
import textwrap

TITLED = re.compile(r"^```(\w+) (\S+)$", re.MULTILINE)
"""The first line of a code block with the name of its file."""
INDENTED = re.compile(r"(?<=\n\n)(?:    .*(?:\n|\Z))+")
COMMAND = re.compile(r"(?:quadcosim|make|pip|python3?|\.venv/\S+|\.|cc|dask|git) ")
"""The start of a block of commands."""


def for_the_site(markdown: str) -> str:
    """`markdown` with file names as titles of code blocks, and with highlighted blocks of commands."""
    return INDENTED.sub(_coloured, TITLED.sub(r'```\1 title="\2"', markdown))


def _coloured(block: re.Match[str]) -> str:
    text = textwrap.dedent(block[0])
    return f"```sh\n{text}```\n" if COMMAND.match(text) else block[0]
