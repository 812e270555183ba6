"""The answers on the pages of their commands: each key of `--json` with the docstring of its attribute."""

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial

from docs.website.tables import inline_html, table
from orchestration.experiments.limits.evaluation import Evaluation
from orchestration.experiments.limits.limit_result import Limit
from orchestration.foundation.basics.attribute_docs import attribute_docs
from orchestration.quadrotor.flight.hover_limit import Margin
from orchestration.systems.schedule.responses import Responses, Spread
from orchestration.theory.certificates.margin import Certified
from orchestration.theory.exact.expect import Expected


def section(records: Mapping[str, type]) -> str:
    """The Markdown of a table for each record, by its title."""
    tables = (f"### {title}\n\n{_table(record)}" for title, record in records.items())
    return "\n## Keys of the answers\n\n" + "".join(tables)


def _table(record: type) -> str:
    docs = attribute_docs(record.__module__, record.__name__)
    keys = [field.name for field in dataclasses.fields(record)]
    texts = [docs[key].text if key in docs else "" for key in keys]
    rows = [(f"<code>{key}</code>", inline_html(text[:1].upper() + text[1:])) for key, text in zip(keys, texts)]
    return table(rows, columns=("Key", "Meaning"))


SECTIONS: dict[str, Callable[[], str]] = {
    "how_far.md": partial(
        section,
        {
            "`limit`": Limit,
            "`limit`, each of `tried`": Evaluation,
            "`margin`": Margin,
            "`margin --of`": Certified,
            "`expect`": Expected,
        },
    ),
    "computers.md": partial(
        section,
        {
            "`schedule`, each of `tasks` and `messages`": Responses,
            "`schedule`, each of `response` and `latency`": Spread,
        },
    ),
}
"""Continuation of the text of pages, by address."""
