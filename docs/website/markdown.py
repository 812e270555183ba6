"""The Markdown of the pages, which code hosts read, as the generator of the site reads it."""

import re

TITLED = re.compile(r"^```(\w+) (\S+)$", re.MULTILINE)
"""The beginning of a code block with the name of its file."""
COMMANDS = re.compile(r"(?:^|(?<=\n\n))(?:    \S.*\n|\n(?=    \S))+", re.MULTILINE)


def for_the_site(markdown: str) -> str:
    """`markdown` with the names of files above their code blocks."""
    return TITLED.sub(r'```\1 title="\2"', markdown)
