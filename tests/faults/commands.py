"""The commands whose calls fail, each with the files that it starts from."""

from dataclasses import dataclass

from tests.places import EXAMPLES, ROOT

TANK = EXAMPLES / "water_tank"
_FLIGHT = """
[base]
stop_time = 0.2
[base.timing]
plant_interval = 0.005
[base.controller]
fmu = "native/UnifiedController"
[base.plant]
fmu = "native/QuadrotorPlant"
max_internal_step = 0.005
"""
STUDY = f"""{_FLIGHT}
[[axes]]
name = "period"
sets = ["timing.period"]
values = [0.01, 0.03]
"""
COMPARISON = f"""name = "laws"
{_FLIGHT}
[[controllers]]
name = "unified"
[[controllers]]
name = "geometric"
fmu = "native/GeometricController"
[axis]
name = "period"
sets = ["timing.period"]
values = [0.01]
[starts]
count = 1
"""
TUNING = f"""name = "gains"
{_FLIGHT}
[cost]
of = "position_rmse"
bad = 10.0
[starts]
count = 1
judged = 1
[search]
periods = [0.05]
evaluations = 2
seeds = [1]
[[parameters]]
name = "eta"
sets = ["controller.gain.eta"]
start = 2.0
stop = 30.0
scale = "logarithmic"
[[parameters]]
name = "attitude"
sets = ["controller.gain.attitude"]
start = 2.0
stop = 60.0
scale = "logarithmic"
"""
TEXTS = {"study.toml": STUDY, "laws.toml": COMPARISON, "gains.toml": TUNING}
"""Files that a command may start from, by name"""


@dataclass(frozen=True)
class Command:
    """A command in a folder of its own."""

    name: str
    words: tuple[str, ...]
    old: tuple[str, ...] = ()
    """Files that it replaces"""
    needs: tuple[str, ...] = ()
    """Files of `TEXTS`, and folders that the commands `BEFORE` have written"""
    resumes: bool = False
    """Whether what it has done stays, if the rest fails, and is not done again"""
    once: bool = False
    """Whether it refuses to replace what it has written"""
    beside: str | None = None
    """The folder beside which it keeps a run that cannot take its place"""


def _command(
    name: str, words: str, *old: str, needs: str = "", resumes: bool = False, once: bool = False,
    beside: str | None = None,
) -> Command:  # fmt: skip
    return Command(name, tuple(words.split()), old, tuple(needs.split()), resumes, once, beside)


@dataclass(frozen=True)
class Before:
    """A command whose folder others start from."""

    words: tuple[str, ...]
    killed_at: int = 0
    """The number of the write at which it is killed; 0: it ends"""


def _before(words: str, killed_at: int = 0) -> Before:
    return Before(tuple(words.split()), killed_at)


_RUN = "run --native --no-figures --stop-time 0.05"
RUN = tuple(_RUN.split())
BEFORE = {
    "flight": _before(f"{_RUN} --out flight"),
    "paused": _before(f"{_RUN} --pause-at 0.02 --out paused"),
    "store": _before("sweep study.toml --out store"),
    "half": _before("sweep study.toml --out half --engine compiled", killed_at=60),
    "hover": _before("new controller hover --c"),
    "results": _before("tune gains.toml --out gains --engine compiled", killed_at=20),
}
"""By the folder that it makes"""

_INTEGRATOR = EXAMPLES / "double_integrator/system.toml"
_LIMIT = f"limit {_INTEGRATOR} --of connections.command.delay --from 0.01 --to 0.03 --scan 0.02"
_MARGIN = f"margin {_INTEGRATOR} --of connections.command.delay_jitter"
COMMANDS = (
    _command("new", "new controller hover", once=True),
    _command("examples", "examples", once=True),
    _command("connect", f"connect {TANK / 'Tank.fmu'} {TANK / 'TankController.fmu'} --out system.toml", once=True),
    _command("export-c", f"export-c {TANK / 'TankController'} --out .", "TankController.c", "TankController.h"),
    _command("export CSV", "export flight --out csv", "csv/signals.csv", "csv/events.csv", needs="flight"),
    _command("export MAT", "export flight --out . --format mat", "flight.mat", needs="flight"),
    _command("report", "report flight --out a.html", "a.html", needs="flight"),
    _command("report study", "report store --out a.html", "a.html", needs="store"),
    _command("plot", "plot flight --out . --figure errors", "errors.png", "errors.svg", needs="flight"),
    _command("film", "plot flight --film a.gif", "a.gif", needs="flight"),
    _command("show", f"show {TANK / 'system.toml'} --out a.png", "a.png"),
    _command("schedule", f"schedule {ROOT / 'examples/autopilot/flight.toml'} --until 0.02 --out a.png", "a.png"),
    _command("build", f"build {TANK / 'TankController'} --out .", "TankController.fmu"),
    _command("ssp", "ssp --native --out a.ssp", "a.ssp", "a.timing.toml"),
    _command("run", "run --native --no-figures --stop-time 0.1 --out flight", needs="flight", beside="flight"),
    _command("run with figures", f"run {TANK / 'system.toml'} --out flight", needs="flight", beside="flight"),
    _command("run, paused", f"{_RUN} --pause-at 0.02 --out flight", once=True, beside="flight"),
    _command(
        "run, resumed", "run --no-figures --resume paused --out paused", needs="paused", once=True, beside="paused"
    ),
    _command("sweep", "sweep study.toml --out store", needs="study.toml", resumes=True),
    _command(
        "sweep workers",
        "sweep study.toml --out store --workers 2 --engine compiled",
        needs="study.toml",
        resumes=True,
    ),
    _command("sweep, resumed", "sweep study.toml --out half --engine compiled", needs="study.toml half", resumes=True),
    _command(
        "export study",
        "export study.toml --out store",
        "store/runs.csv",
        "store/runs.parquet",
        needs="study.toml store",
    ),
    _command("draw", "draw study.toml --out store", needs="study.toml store"),
    _command("compare", "compare laws.toml --out laws --no-figures --engine compiled", needs="laws.toml", resumes=True),
    _command("tune", "tune gains.toml --out gains --engine compiled", needs="gains.toml", resumes=True),
    _command(
        "tune, resumed", "tune gains.toml --out gains --engine compiled", needs="gains.toml results", resumes=True
    ),
    _command("limit", f"{_LIMIT} --out limits"),
    _command("margin", f"{_MARGIN} --out a.json", "a.json"),
    _command(
        "margin --and",
        f"{_MARGIN} --and components.controller.sampling.jitter --out region",
        "region/1.json",
        "region/region.png",
    ),
    _command("live", f"live {_INTEGRATOR} --out a.html", "a.html"),
    _command("wrap", "wrap hover/hover.toml", "hover/Hover.fmu", needs="hover"),
    _command("interop", f"interop {_INTEGRATOR} --tool libcosim --stop-time 0.2 --out agreement"),
)
