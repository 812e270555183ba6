"""What fits an annotation as it is: Pydantic accepts it, with the same result; all else is left to Pydantic."""

import copy
import json
import math
import random
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
import pytest

from orchestration.experiments.comparison.file import ComparisonFile
from orchestration.experiments.studies.study_file import StudyFile
from orchestration.foundation.basics import records, typed_tables
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.fitting import Before, MisfitError, fitted
from orchestration.foundation.basics.records import Scalar
from orchestration.foundation.basics.typed_tables import parsed
from orchestration.quadrotor.scenarios.file import ScenarioFile
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.file import SystemTable
from tests.places import ROOT

HINTS = [
    bool, int, float, str, Any, Path, None, int | None, float | str | None, float | Sampling, tuple[int, ...] | bool,
    tuple[float, float], tuple[str, ...], list[int | str], dict[str, Any], Mapping[str, float], Literal["a", "b"],
    Scalar, Mapping[str, Scalar], list[Scalar | dict[str, Any]], float | dict[str, float], Sampling, Sampling | None,
    Annotated[Path | None, Before(lambda value: Path(value) if isinstance(value, str) else value)], Path | str,
]  # fmt: skip
ATOMS = [
    None, True, False, 0, -1, 3, 2**53 + 1, 2**64, 0.5, -0.0, math.inf, math.nan, "", "a", "c", "1", Path("a"),
    np.float64(1.0), np.int64(2), np.bool_(True), Sampling(period=1.0), b"a", (), [], {},
]  # fmt: skip


def values(generator: random.Random) -> Iterator[Any]:
    yield from ATOMS
    while True:
        some = [generator.choice(ATOMS[:17]) for _ in range(generator.randrange(1, 3))]
        yield generator.choice([tuple(some), some, {"a": some[0]}, {3: some[0]}, [{"a": some[0]}], {"a": {"b": some}}])


def same(one: Any, other: Any) -> bool:
    return type(one) is type(other) and repr(one) == repr(other)


@pytest.mark.parametrize("hint", HINTS)
def test_what_fits_is_what_pydantic_makes_of_it(hint: Any) -> None:
    config = pydantic.ConfigDict(strict=True, arbitrary_types_allowed=True)
    adapter = pydantic.TypeAdapter(hint, config=None if hint is Sampling else config)
    accepted = 0
    for _, value in zip(range(300), values(random.Random(str(hint)))):
        for from_file in (False, True):
            try:
                found = fitted(value, hint, from_file=from_file)
            except MisfitError:
                continue
            accepted += 1
            strict = adapter.validate_json(json.dumps(value)) if from_file else adapter.validate_python(value)
            assert same(found, strict), (value, from_file)
    assert accepted, hint


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in items:
        yield (*at, key)
        yield from places(one, (*at, key))


def damaged(document: dict[str, Any], generator: random.Random) -> dict[str, Any]:
    """A document in which a value is replaced or missing, or a key has another name."""
    result: Any = copy.deepcopy(document)
    *path, last = generator.choice([*places(result)])
    within = result
    for key in path:
        within = within[key]
    how = generator.choice(["replaced", "replaced", "removed", "renamed"])
    if how == "replaced":
        within[last] = copy.deepcopy(generator.choice([0, -1, 2.5, True, "a", "x.csv", [1, 2], {"a": 1}, [], 2**64]))
    else:
        value = within.pop(last)
        if how == "renamed" and isinstance(within, dict):
            within[f"{last}x"] = value
    return result


def described(value: Any) -> Any:
    if isinstance(value, typed_tables.Table):
        return type(value), sorted(value.given), described(value.as_dict())
    if isinstance(value, (list, tuple)):
        return type(value), [described(one) for one in value]
    if isinstance(value, Mapping):
        return {key: described(one) for key, one in value.items()}
    return described(vars(value)) if records.is_record(type(value)) else (type(value), repr(value))


def outcome(document: dict[str, Any], shape: Any) -> Any:
    try:
        return described(parsed(document, shape))
    except Exception as error:
        return type(error), str(error)


@pytest.mark.parametrize(
    ("path", "shape"),
    [
        ("examples/three_servos/can.toml", SystemTable),
        ("orchestration/quadrotor/scenarios/system.toml", SystemTable),
        ("examples/references/gusts.toml", ScenarioFile),
        ("examples/quadrotor/study.toml", StudyFile),
        ("examples/quadrotor/comparison.toml", ComparisonFile),
    ],
)
def test_a_document_and_its_damages_give_what_they_give_by_pydantic(
    path: str, shape: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    document, generator = read_toml(ROOT / path, "file"), random.Random(path)
    parsed(document, shape)
    documents = [document, *(damaged(document, generator) for _ in range(60))]
    found = [outcome(one, shape) for one in documents]

    def left_to_pydantic(*args: Any, **kwargs: Any) -> Any:
        raise MisfitError

    for module in (records, typed_tables):
        monkeypatch.setattr(module, "fitted", left_to_pydantic)
    assert found == [outcome(one, shape) for one in documents]
