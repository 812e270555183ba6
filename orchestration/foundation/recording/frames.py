"""A recording as pandas tables."""

from typing import TYPE_CHECKING

import numpy as np

from orchestration.foundation.basics.times import seconds
from orchestration.foundation.recording.recording import KINDS, About, Recording, events_of, rows_of

if TYPE_CHECKING:
    import pandas as pd


def units_of(about: About) -> dict[str, str]:
    """The units of the columns that have one."""
    return {name: words["unit"] for name, words in about.items() if "unit" in words}


def signals(recording: Recording, about: About) -> "pd.DataFrame":
    """A row for each instant, indexed by `time` [s]; the units are in `attrs["units"]`, by column."""
    import pandas as pd

    table = pd.DataFrame(rows_of(recording), columns=list(recording.columns)).set_index("time")
    table.attrs["units"] = units_of(about)
    return table


def events(recording: Recording) -> "pd.DataFrame":
    """A row for each event in order of time: `time` [s], `event`, its object (`what`) and the index `sample`."""
    import pandas as pd

    events = events_of(recording)
    time, kind, what, sample = events.table.T
    words, names = np.array(KINDS, dtype=object), np.array([*events.names], dtype=object)
    table = pd.DataFrame({"time": seconds(time), "event": words[kind], "what": names[what], "sample": sample})
    table.attrs["units"] = {"time": "s"}
    return table
