"""Errors of the API name arguments, those of the command line its flags."""

from typing import Any

import pytest

import quadcosim
from orchestration.foundation.basics.errors import in_python
from quadcosim import Result, Scenario, UsageError
from tests.commands import Main

EXPECTED = {
    "--of peroid: did you mean period? expected one of a": "of = peroid: did you mean period? expected one of a",
    "--from 1 --to 0: expected finite numbers": "first = 1, last = 0: expected finite numbers",
    "--of x: expected --from and --to": "of = x: expected first and last",
    "--time-limit: expected without --in-process": "time_limit: expected without in_process",
    "--run and --flights: expected a study": "run and flights: expected a study",
    "as quadcosim build --native makes them, for --engine batch": (
        "as quadcosim build --native makes them, for engine batch"
    ),
    "a -- b, x--y": "a -- b, x--y",
}


@pytest.mark.parametrize("text", EXPECTED)
def test_flags_are_named_as_arguments(text: str) -> None:
    assert in_python(text) == EXPECTED[text]


def test_the_api_names_the_argument_and_the_command_its_flag(main: Main) -> None:
    with pytest.raises(UsageError, match=r"^of = peroid: did you mean period\? expected one of"):
        quadcosim.limit(Scenario(), "peroid")
    with pytest.raises(UsageError, match=r"^of = plant.mass: expected first and last, between which"):
        quadcosim.limit(Scenario(), "plant.mass")
    assert "--of peroid: did you mean period? expected one of" in main("limit", "--of", "peroid", code=2).stderr
    with pytest.raises(UsageError, match=r"^of = peroid: "):  # and after it as before
        quadcosim.limit(Scenario(), "peroid")


@pytest.mark.parametrize("function", ["run", "limit", "sweep"])
def test_an_engine_that_there_is_not_is_refused_with_those_there_are(function: str) -> None:
    request = {"name": "one", "base": Scenario(), "axes": [{"name": "seed", "values": [1]}]}
    with pytest.raises(UsageError, match=r"^engine = gpu: expected one of .*python, compiled"):
        getattr(quadcosim, function)(request if function == "sweep" else Scenario(), engine="gpu")


@pytest.mark.parametrize(("of", "name"), [("signals", "plant.positon.x"), ("metrics", "position_rms")])
def test_a_name_that_a_result_does_not_have_is_answered_with_its_names(of: str, name: str, result: Result) -> None:
    with pytest.raises(UsageError, match=rf"there is no {name}; did you mean"):
        getattr(result, of)[name]
    assert name not in getattr(result, of)


def test_a_name_that_differs_by_capitals_only_is_proposed_first(result: Result) -> None:
    with pytest.raises(UsageError, match=r"did you mean plant\.position\.x or plant\.position\.[yz]"):
        result.signals["plant.position.X"]


@pytest.mark.parametrize("argument", ["outputs", "record"])
def test_a_name_alone_is_no_list_of_names(argument: str) -> None:
    name: Any = "position_rmse"
    with pytest.raises(UsageError, match=f"{argument} = 'position_rmse': expected a list of names"):
        quadcosim.fly(Scenario(stop_time=0.05), {"seed": [0, 1]}, **{argument: name})


def test_text_that_could_be_a_number_is_in_quotes() -> None:
    period: Any = "0.01"
    with pytest.raises(UsageError, match=r"period = '0\.01': expected a positive number"):
        quadcosim.Timing(period=period)
