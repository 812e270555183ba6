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
values = [0.01, 0.02, 0.03, 0.05]
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
values = [0.01, 0.03]
[starts]
count = 2
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
evaluations = 3
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


def _command(name: str, words: str, *old: str, needs: str = "", resumes: bool = False, once: bool = False) -> Command:
    return Command(name, tuple(words.split()), old, tuple(needs.split()), resumes, once)


BEFORE = {
    "flight": ("run", "--native", "--stop-time", "0.05", "--out", "flight"),
    "store": ("sweep", "study.toml", "--out", "store"),
}
"""Commands whose folders others start from"""

COMMANDS = (
    _command("new", "new controller hover", once=True),
    _command("examples", "examples", once=True),
    _command("export-c", f"export-c {TANK / 'TankController'} --out .", "TankController.c", "TankController.h"),
    _command("export CSV", "export flight --out csv", "csv/signals.csv", "csv/events.csv", needs="flight"),
    _command("export MAT", "export flight --out . --format mat", "flight.mat", needs="flight"),
    _command("report", "report flight --out a.html", "a.html", needs="flight"),
    _command("plot", "plot flight --out . --figure errors", "errors.png", "errors.svg", needs="flight"),
    _command("show", f"show {TANK / 'system.toml'} --out a.png", "a.png"),
    _command("schedule", f"schedule {ROOT / 'examples/autopilot/flight.toml'} --until 0.02 --out a.png", "a.png"),
    _command("build", f"build {TANK / 'TankController'} --out .", "TankController.fmu"),
    _command("ssp", "ssp --native --out a.ssp", "a.ssp", "a.timing.toml"),
    _command("run", "run --native --stop-time 0.1 --out flight", needs="flight"),
    _command("sweep", "sweep study.toml --out results", needs="study.toml", resumes=True),
    _command(
        "sweep workers",
        "sweep study.toml --out results --workers 2 --engine compiled",
        needs="study.toml",
        resumes=True,
    ),
    _command(
        "export study",
        "export study.toml --out store",
        "store/runs.csv",
        "store/runs.parquet",
        needs="study.toml store",
    ),
    _command("draw", "draw study.toml --out store", needs="study.toml store"),
    _command("compare", "compare laws.toml --out results --no-figures", needs="laws.toml", resumes=True),
    _command("tune", "tune gains.toml --out gains", needs="gains.toml", resumes=True),
    _command("limit", "limit --native --stop-time 1 --of delay --from 0.01 --to 0.03 --scan 0.01 --out results"),
)
