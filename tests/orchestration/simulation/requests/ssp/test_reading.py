"""Reading SSP 1.0: components, nested systems, transformations, units, parameter sets, and additional timing."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from fmu_kit.archive import write_archive
from orchestration.components.fmi.read_description import read_model
from orchestration.simulation.requests.request import load_request
from orchestration.simulation.requests.ssp import document, writing
from orchestration.systems.system.check import check
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.model import System
from quadcosim import Scenario, UsageError
from tests.commands import Main
from tests.orchestration.experiments.studies.common import one_line
from tests.orchestration.systems.system.described import described

NAMES = """xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
 xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations" """
UNITS = """<ssd:Units>
<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
<ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit></ssd:Units>"""
STEP = """<ssd:DefaultExperiment startTime="0.0" stopTime="4.0"><ssd:Annotations>
<ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="0.01"/>
</osp:Algorithm></ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"""


TRIPLE = '<ssc:LinearTransformation factor="3.0"/>'
BOOLEAN = """<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>
</ssc:BooleanMappingTransformation>"""


def component(name: str, connectors: str = "", bindings: str = "", source: str | None = None, **more: str) -> str:
    """One element; `connectors` as `in x:m out y`."""
    kinds = {"in": "input", "out": "output", "par": "parameter"}
    words = connectors.split()
    made = ""
    for kind, text in zip(words[::2], words[1::2], strict=True):
        connector, _, unit = text.partition(":")
        real = f'<ssc:Real unit="{unit}"/>' if unit else "<ssc:Real/>"
        made += f'<ssd:Connector name="{connector}" kind="{kinds[kind]}">{real}</ssd:Connector>'
    made = f"<ssd:Connectors>{made}</ssd:Connectors>" if made else ""
    bound = f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""
    attributes = "".join(f' {key}="{value}"' for key, value in more.items())
    return f'<ssd:Component name="{name}" source="{source or name + ".fmu"}"{attributes}>{made}{bound}</ssd:Component>'


def wire(start: str, end: str, inside: str = "", **more: str) -> str:
    """A connection of ELEMENT.CONNECTOR; `.CONNECTOR` is of the system itself."""
    text = ""
    for which, (element, _, connector) in (("start", start.partition(".")), ("end", end.partition("."))):
        text += f' {which}Element="{element}"' if element else ""
        text += f' {which}Connector="{connector}"'
    text += "".join(f' {key}="{value}"' for key, value in more.items())
    return f"<ssd:Connection{text}>{inside}</ssd:Connection>"


def values(text: str, prefix: str = "", mapping: str = "") -> str:
    """A binding with an inline set, as `name=1.5 other=2:mm`."""
    made = ""
    for item in text.split():
        name, _, rest = item.partition("=")
        value, _, unit = rest.partition(":")
        unit = f' unit="{unit}"' if unit else ""
        made += f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{unit}/></ssv:Parameter>'
    mapped = f'<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{mapping}</ssm:ParameterMapping>'
    mapped = f"{mapped}</ssd:ParameterMapping>" if mapping else ""
    attribute = f' prefix="{prefix}"' if prefix else ""
    return (
        f'<ssd:ParameterBinding{attribute}><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="s">'
        f"<ssv:Parameters>{made}</ssv:Parameters>"
        f"</ssv:ParameterSet></ssd:ParameterValues>{mapped}</ssd:ParameterBinding>"
    )


def system(elements: str, wires: str = "", name: str = "top", connectors: str = "", bindings: str = "") -> str:
    made = component("x", connectors, bindings).partition(">")[2].removesuffix("</ssd:Component>")
    connections = f"<ssd:Connections>{wires}</ssd:Connections>" if wires else ""
    return f'<ssd:System name="{name}">{made}<ssd:Elements>{elements}</ssd:Elements>{connections}</ssd:System>'


def structure(top: str, experiment: str = STEP, units: str = UNITS) -> str:
    head = f'<ssd:SystemStructureDescription {NAMES} name="top" version="1.0">'
    return f'<?xml version="1.0" encoding="UTF-8"?>{head}{top}{units}{experiment}</ssd:SystemStructureDescription>'


@pytest.fixture
def loaded(tmp_path: Path) -> Callable[..., System]:
    """Reads a document that lies beside FMUs plant and law, with a file of timing."""
    described(
        tmp_path, "plant", inputs={"u": "Real N"}, outputs={"x": "Real m", "v": "Real"}, parameters={"mass": "Real"}
    )
    law = {"k": "Real", "limit": "Real mm"}
    described(tmp_path, "law", inputs={"x": "Real mm", "v": "Real"}, outputs={"u": "Real N discrete"}, parameters=law)

    def load(text: str, timing: str | None = None) -> System:
        (tmp_path / "loop.ssd").write_text(text, encoding="utf-8")
        if timing is None:
            request = load_request(tmp_path / "loop.ssd")
        else:
            (tmp_path / "timing.toml").write_text(timing, encoding="utf-8")
            request = load_request(tmp_path / "loop.ssd", tmp_path / "timing.toml")
        assert isinstance(request, System)
        return request

    return load


PLANT, LAW = component("plant", "in u:N out x:m out v"), component("law", "in x:mm in v out u:N")
WIRES = wire("plant.x", "law.x") + wire("plant.v", "law.v") + wire("law.u", "plant.u")
LOOP = system(PLANT + LAW, WIRES)
Loaded = Callable[..., System]


def wires(read: System) -> dict[str, tuple[str, float, float]]:
    """By end: start, scale and offset."""
    return {end: (start, x.scale, x.offset) for x in read.connections for start, end in zip(x.start, x.end)}


def test_a_suppressed_conversion_leaves_the_value_with_any_units(loaded: Loaded) -> None:
    suppressed = LOOP.replace('endConnector="x"', 'endConnector="x" suppressUnitConversion="true"')
    assert wires(loaded(structure(LOOP)))["law.x"] == ("plant.x", 1000.0, 0.0)
    read = loaded(structure(suppressed))
    assert wires(read)["law.x"] == ("plant.x", 1.0, 0.0)
    models = {name: read_model(Path(part.fmu)) for name, part in read.components.items()}
    check(read, models)


# -- structure --------------------------------------------------------------------------------------------


def test_components_and_connections_are_read_with_units_converted(loaded: Loaded, tmp_path: Path) -> None:
    read = loaded(structure(LOOP))
    assert {name: Path(c.fmu) for name, c in read.components.items()} == {
        "plant": tmp_path / "plant.fmu",
        "law": tmp_path / "law.fmu",
    }
    assert wires(read) == {
        "law.x": ("plant.x", pytest.approx(1000.0), 0.0),
        "law.v": ("plant.v", 1.0, 0.0),
        "plant.u": ("law.u", 1.0, 0.0),
    }
    assert [x.name for x in read.connections] == ["law_to_plant", "plant_to_law", "plant_to_law_2"]
    assert read.stop_time == 4.0
    assert {c.step for c in read.components.values()} == {0.01}


def test_a_transformation_adds_to_units_unless_those_are_suppressed(loaded: Loaded) -> None:
    linear = '<ssc:LinearTransformation factor="2.0" offset="0.5"/>'
    for suppressed, expected in (("false", (2000.0, 500.0)), ("true", (2.0, 0.5))):
        changed = wire("plant.x", "law.x", linear, suppressUnitConversion=suppressed)
        read = loaded(structure(system(PLANT + LAW, changed)))
        assert wires(read)["law.x"] == ("plant.x", *map(pytest.approx, expected))


def test_a_connection_may_be_written_backwards_as_kinds_give_its_direction(loaded: Loaded) -> None:
    read = loaded(structure(system(PLANT + LAW, wire("plant.u", "law.u"))))
    assert wires(read) == {"plant.u": ("law.u", 1.0, 0.0)}


def test_components_of_nested_systems_are_named_by_their_path(loaded: Loaded) -> None:
    half = '<ssc:LinearTransformation factor="0.5"/>'
    inner = system(
        LAW.replace('name="law"', 'name="core"'),
        wire(".pos", "core.x", half) + wire(".speed", "core.v") + wire("core.u", ".force"),
        name="box 1",
        connectors="in pos:m in speed out force:N",
    )
    outer = wire("plant.x", "box 1.pos") + wire("plant.v", "box 1.speed") + wire("box 1.force", "plant.u")
    read = loaded(structure(system(PLANT + inner, outer)))
    assert list(read.components) == ["plant", "box_1_core"]
    assert wires(read) == {
        "box_1_core.x": ("plant.x", pytest.approx(500.0), 0.0),
        "box_1_core.v": ("plant.v", 1.0, 0.0),
        "plant.u": ("box_1_core.u", 1.0, 0.0),
    }


def linear(factor: float, offset: float) -> str:
    return f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'


def test_transformations_through_systems_are_applied_in_the_direction_of_values(loaded: Loaded) -> None:
    inner = system(LAW, wire(".speed", "law.v", linear(10.0, 1.0)), name="box", connectors="in speed")
    read = loaded(structure(system(PLANT + inner, wire("plant.v", "box.speed", linear(2.0, 3.0)))))
    assert wires(read) == {"box_law.v": ("plant.v", 20.0, 31.0)}  # 10 (2 v + 3) + 1, and not 2 (10 v + 1) + 3


def test_the_outermost_value_for_an_input_is_used_with_all_its_conversions(loaded: Loaded) -> None:
    law = component("law", "in x:mm in v out u:N", values("v=1"))
    inner = system(
        law, wire(".speed", "law.v", linear(10.0, 1.0)), name="box", connectors="in speed", bindings=values("speed=2")
    )
    outer = wire(".wish", "box.speed", linear(2.0, 3.0))
    within = loaded(structure(system(inner, outer, connectors="in wish")))
    assert within.components["box_law"].parameters["v"] == 21.0  # of its system: 10 · 2 + 1
    both = loaded(structure(system(inner, outer, connectors="in wish", bindings=values("wish=5"))))
    assert both.components["box_law"].parameters["v"] == 131.0  # 10 (2 · 5 + 3) + 1


def test_an_input_that_a_source_feeds_has_no_value_of_the_ssp(loaded: Loaded) -> None:
    law = component("law", "in x:mm in v out u:N", values("v=1 k=2"))
    fed = '[sources.wish]\nto = ["law.v"]\nconstant = 7.0\n'
    assert loaded(structure(system(law))).components["law"].parameters == {"v": 1.0, "k": 2.0}
    read = loaded(structure(system(law)), fed)
    assert read.components["law"].parameters == {"k": 2.0}
    assert read.sources["wish"].constant == 7.0


# -- parameters -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("top", "inner", "expected"),
    [
        ("", values("k=1.5"), {"k": 1.5}),
        ("", values("k=1.5") + values("k=2.5"), {"k": 2.5}),
        (values("law.k=3.5"), values("k=1.5"), {"k": 3.5}),
        (values("k=3.5", prefix="law."), "", {"k": 3.5}),
        ("", values("limit=2.0:m"), {"limit": pytest.approx(2000.0)}),
        ("", values("gain=2", mapping='<ssm:MappingEntry source="gain" target="k"/>'), {"k": 2.0}),
        (
            "",
            values("gain=2", mapping=f'<ssm:MappingEntry source="gain" target="k">{TRIPLE}</ssm:MappingEntry>'),
            {"k": 6.0},
        ),
    ],
    ids=["of the component", "the last", "of the system", "with a prefix", "a unit", "mapped", "and transformed"],
)
def test_parameters_are_taken_from_where_they_are_bound(
    top: str, inner: str, expected: dict[str, float], loaded: Loaded
) -> None:
    law = component("law", "in x:mm in v out u:N", inner)
    read = loaded(structure(system(PLANT + law, WIRES, bindings=top)))
    assert read.components["law"].parameters == expected


def test_a_parameter_set_may_be_a_separate_file(loaded: Loaded, tmp_path: Path) -> None:
    (tmp_path / "my set.ssv").write_text(
        f'<ssv:ParameterSet {NAMES} version="1.0" name="s"><ssv:Parameters><ssv:Parameter name="k">'
        '<ssv:Real value="7.5"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>'
    )
    law = component("law", "in x:mm in v out u:N", '<ssd:ParameterBinding source="my%20set.ssv"/>')
    read = loaded(structure(system(PLANT + law, WIRES)))
    assert read.components["law"].parameters == {"k": 7.5}


def test_a_parameter_of_a_system_reaches_what_it_is_connected_to(loaded: Loaded) -> None:
    law = component("law", "in x:mm par k")
    top = system(
        law, wire(".gain", "law.k") + wire(".x", "law.x"), connectors="par gain in x:m", bindings=values("gain=4 x=2")
    )
    assert loaded(structure(top)).components["law"].parameters == {"k": 4.0, "x": pytest.approx(2000.0)}


# -- additional timing ------------------------------------------------------------------------------------

TIMING = """
stop_time = 2.0
seed = 3
[components.law]
sampling = { period = 0.02 }
parameters = { k = 9.0 }
[[connections]]
name = "bus"
from = ["law.u"]
to = ["plant.u"]
delay = 0.004
[[connections]]
name = "speed"
from = ["plant.v"]
to = ["law.v"]
loss = 0.1
[objectives]
peak = "max(plant.x)"
"""


def test_a_second_file_has_the_timing_that_ssp_lacks(loaded: Loaded) -> None:
    law = component("law", "in x:mm in v out u:N", values("k=1.5 limit=3"))
    read = loaded(structure(system(PLANT + law, WIRES)), TIMING)
    assert (read.stop_time, read.seed, read.objectives) == (2.0, 3, {"peak": "max(plant.x)"})
    assert (read.components["plant"].step, read.components["law"].step) == (0.01, None)
    assert read.components["law"].sampling == Sampling(period=0.02)
    assert read.components["law"].parameters == {"k": 9.0, "limit": 3.0}
    assert [(x.name, x.end, x.delay, x.loss) for x in read.connections] == [
        ("bus", ("plant.u",), 0.004, 0.0),
        ("speed", ("law.v",), 0.0, 0.1),
        ("plant_to_law", ("law.x",), 0.0, 0.0),
    ]


def test_two_components_stand_for_all_signals_between_them(loaded: Loaded) -> None:
    plain = structure(LOOP.replace(":mm", "").replace('unit="mm"', 'unit="m"'))
    read = loaded(plain, '[[connections]]\nfrom = "plant"\nto = "law"\ndelay = 0.5\n')
    assert [(x.start, x.delay) for x in read.connections] == [(("plant.x", "plant.v"), 0.5), (("law.u",), 0.0)]


def test_the_timing_may_name_its_ssp_and_is_then_a_system_file(loaded: Loaded, tmp_path: Path) -> None:
    expected = loaded(structure(LOOP), TIMING)
    (tmp_path / "system.toml").write_text(f'ssp = "loop.ssd"\n{TIMING}')
    assert load_request(tmp_path / "system.toml") == expected


@pytest.mark.parametrize(
    ("timing", "message"),
    [
        ("[components.lew]\nstep = 1.0\n", "components.lew: the SSP has no such component; expected one of plant, law"),
        (
            '[[connections]]\nfrom = ["law.u"]\nto = ["plant.v"]\n',
            "connections.0: law.u -> plant.v is not in the SSP, or named before; expected of law.u -> plant.u, ",
        ),
        ('[[connections]]\nfrom = ["law.u"]\nto = ["plant.u"]\nscale = 2.0\n', "connections.0: has scale or offset"),
        ('[[connections]]\nfrom = ["law.u"]\n', "connections.0: expected from and to"),
        ('[[connections]]\nfrom = "plant"\nto = "law"\n', "connections.0: its signals are converted differently"),
        ("steps = 1\n", "steps: no such key; expected one of stop_time, "),
        ("[components.law]\nstep = 1.0\nsampling = { period = 1.0 }\n", "components.law.step = 1.0: expected none"),
    ],
)
def test_wrong_timing_is_one_line(timing: str, message: str, loaded: Loaded, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        loaded(structure(LOOP), timing)
    assert one_line(refused.value).startswith(f"{tmp_path / 'timing.toml'}: {message}")


# -- rejections -------------------------------------------------------------------------------------------


def one(**more: str) -> str:
    """A document with one component."""
    return structure(system(component("a", **more)))


def loop(*connections: str) -> str:
    return structure(system(PLANT + LAW, "".join(connections)))


def laws(*names: str) -> str:
    return structure(system("".join(LAW.replace('name="law"', f'name="{name}"') for name in names)))


LATE, ENDLESS = STEP.replace('startTime="0.0"', 'startTime="1.0"'), STEP.replace('stopTime="4.0"', "")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<ssd:", "expected a readable SSD document of SSP 1.0: "),
        (structure(LOOP).replace("Elements>", "Elephants>"), "expected a valid SSD document of SSP 1.0: "),
        (structure(LOOP, experiment=""), "components.plant: the SSP does not say how it is stepped"),
        (structure(LOOP, experiment=ENDLESS), "stop_time: the SSP has no DefaultExperiment"),
        (structure(LOOP, experiment=LATE), "DefaultExperiment.startTime = 1"),
        (one(source="none.fmu"), "source none.fmu: there is no such file in the SSP"),
        (one(source="http://a.b/c.fmu"), "source http://a.b/c.fmu: expected a file"),
        (one(source="law.fmu", implementation="ModelExchange"), "a: is for model exchange"),
        (one(source="x.ssp", type="application/x-ssp-package"), "a: is of type application/x-ssp"),
        (loop(wire("plant.x", "law.y")), "connection to law.y: there is no such connector"),
        (loop(wire("plant.x", "law.u")), "connection of plant.x (output) and law.u (output)"),
        (loop(wire("plant.x", "law.x"), wire("plant.x", "law.x")), "connection to law.x: is connected already"),
        (loop(wire("law.u", "law.x")), "connection law.u -> law.x, from N to mm: these are units of different"),
        (loop(wire("plant.x", "law.v", BOOLEAN)), "a BooleanMappingTransformation: only linear"),
        (laws("law", "law"), "the system: has two elements of one name"),
        (laws("law", "l w", "l_w"), "l w and l_w: would be named l_w"),
    ],
)
def test_unsupported_elements_are_rejected_by_name_in_one_line(
    text: str, message: str, loaded: Loaded, tmp_path: Path
) -> None:
    with pytest.raises(UsageError) as refused:
        loaded(text)
    assert one_line(refused.value).removeprefix(f"{tmp_path / 'loop.ssd'}: ").startswith(message)


@pytest.mark.parametrize("content", [b"no archive", None])
def test_an_archive_that_is_none_or_has_no_structure_is_rejected(
    content: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(document, "_cache", lambda: tmp_path / "cache")
    path = tmp_path / "loop.ssp"
    if content is None:
        write_archive(path, {"other.txt": b""}, first="other.txt")
    else:
        path.write_bytes(content)
    with pytest.raises(UsageError, match=r"loop.ssp: expected an SSP archive"):
        load_request(path)


# -- a round -------------------------------------------------------------------------------------------------


def test_the_quadrotor_s_ssp_is_the_quadrotor_with_its_timing_on_top(
    built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main
) -> None:
    monkeypatch.setattr(document, "_cache", lambda: tmp_path / "cache")
    scenario = Scenario().with_fmus(plant=built["QuadrotorPlant"], controller=built["UnifiedController"])
    scenario = scenario.with_changes(stop_time=0.2, timing={"plant_interval": 0.005, "clock": "fmu"})
    path = writing.write(scenario, tmp_path / "loop.ssp")
    timing = tmp_path / "timing.toml"
    timing.write_text(
        '[components.controller]\nsampling = { period = 0.01, clock = "fmu" }\n'
        'parameters = { mass = 1.0 }\n[objectives]\nend = "last(plant.position.x)"\n'
    )
    read = load_request(path, timing)
    assert isinstance(read, System)
    expected = scenario.as_system()
    assert {(s, e) for x in read.connections for s, e in zip(x.start, x.end)} == {
        (s, e) for x in expected.connections for s, e in zip(x.start, x.end)
    }
    assert {name: Path(c.fmu).read_bytes() for name, c in read.components.items()} == {
        name: Path(c.fmu).read_bytes() for name, c in expected.components.items()
    }
    (tmp_path / "flight.toml").write_text(scenario.to_toml())
    ends = [
        json.loads(main("run", *given, "--json").stdout)
        for given in ((path, timing), (tmp_path / "flight.toml", "--out", tmp_path / "flown", "--no-figures"))
    ]
    from orchestration import load_run

    assert ends[0]["end"] == float(load_run(tmp_path / "flown").signals["plant.position.x"][-1])
