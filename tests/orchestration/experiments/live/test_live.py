"""The page of the paper's flight: its modules by wasmtime, and all of it in a browser."""

import gzip
import importlib.util
import json
import random
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from docs.claim_records import steps
from orchestration.experiments.live import live as writing
from orchestration.experiments.live.live import live
from orchestration.foundation.basics.errors import UsageError
from quadcosim import Scenario, fly
from tests.extent import in_test_all, sample
from tests.orchestration.simulation.engines.wasm.machines import Page, Wasm, hashes_of
from tests.patience import PATIENCE
from tests.places import ROOT

ZIG = pytest.mark.skipif(
    importlib.util.find_spec("ziglang") is None, reason="no compiler for WebAssembly: pip install 'quadcosim[live]'"
)
COLUMNS = ("plant.position.x", "plant.quaternion.w", "plant.thrust")
KNOWN = (  # period, delay, κ; outcome, time of divergence, ultimate bound, as `fly` has them
    ({"timing.period": 0.07}, "settled", None, 0.0012746940253144442),
    ({"timing.period": 0.08}, "diverged", 2.358, None),
    ({"timing.period": 0.08, "controller.coupling": 0.0}, "bounded", None, 0.05187919816550872),
    ({"timing.period": 0.1, "controller.coupling": 0.0}, "diverged", 5.557, None),
    ({"timing.period": 0.001, "controller.coupling": 15.0}, "settled", None, 0.0007417714079406577),
    ({"timing.period": 0.005, "controller.coupling": 15.0}, "diverged", 1.895, None),
    ({"timing.period": 0.01, "timing.delay": 0.04}, "diverged", 5.164, None),
)


@pytest.fixture(scope="module")
def paper():
    return live(Scenario())


def unpacked(page, part):
    """The content of a part of a page."""
    found = re.search(rf'id="{part}" data-size="(\d+)">([^<]*)<', page.html)
    assert found
    codes = [c - 33 - (c > 38) - (c > 60) - (c > 62) for c in found[2].encode()]
    groups = np.array(codes[::2]) * 91 + np.array(codes[1::2])
    bits = groups[:, None] >> np.arange(13) & 1
    packed = np.packbits(bits.astype(np.uint8).ravel(), bitorder="little").tobytes()[: int(found[1])]
    return gzip.decompress(packed)


def machine(page, part):
    document = json.loads(unpacked(page, "system"))
    places = {name: (component, place) for name, component, place, _ in document["columns"]}
    settings = {path: value for path, value, *_ in document["settings"]}
    return Page(Wasm(unpacked(page, part)), settings, places.get, document["objectives"]), document


@ZIG
def test_a_page_is_small_and_asks_nothing_of_a_network(paper):
    assert len(paper.html.encode()) < 200_000
    assert "default-src 'none'" in paper.html
    assert "http" not in re.sub(r"http-equiv", "", paper.html.split('id="system"')[0])
    assert paper._repr_html_().startswith('<iframe sandbox="allow-scripts"')


@ZIG
@pytest.mark.parametrize("part", ["single", "pair"])
def test_its_modules_have_the_rows_of_fly_to_the_bit(paper, part):
    pytest.importorskip("wasmtime")
    page, document = machine(paper, part)
    r = random.Random(3)
    runs = [
        {"timing.period": round(r.uniform(0.002, 0.05), 5), "timing.delay": round(r.uniform(0.0, 0.02), 6),
         "timing.jitter": round(r.uniform(0.0, 0.0019), 7), "timing.command_loss": r.choice([0.0, 0.3]),
         "controller.coupling": r.uniform(0.0, 2.0), "seed": r.randrange(2**40)}
        for _ in range(20)
    ]  # fmt: skip
    flights = fly(Scenario(stop_time=1.5), {path: [run[path] for run in runs] for path in runs[0]}, record=COLUMNS)
    names = [path for path, *_ in document["settings"]]
    found = []
    for first in range(0, len(runs), page.lanes):
        some = runs[first : first + page.lanes]
        set_ = [
            {names[i]: value for path, value in run.items() for i in document["targets"].get(path, [1])} for run in some
        ]
        found += [each[0] for each in page.fly([{**each, "stop_time": 1.5} for each in set_], COLUMNS)]
    assert page.lanes == (1 if part == "single" else 2)
    assert found == hashes_of(flights, COLUMNS)


def wait(page, condition):
    """Wait for a condition in a page, whose policy allows no text that is evaluated there."""
    page.evaluate(f"async () => {{ while (!({condition})) await new Promise(go => setTimeout(go, 30)); }}")


def opened(browser, paper, folder, size, at=""):
    told, asked = [], []
    page = browser.new_page(viewport=size)
    page.set_default_timeout(1e3 * PATIENCE)
    page.on("console", lambda message: told.append(message.text))
    page.on("pageerror", lambda error: told.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(paper.save(folder / "live.html").as_uri() + at)
    page.evaluate("quadcosim.ready")
    page.wait_for_selector("body[data-drawn]")
    return page, told, asked


WIDE = {"width": 1400, "height": 900}


@ZIG
def test_known_answers_come_out_of_the_page_and_it_refuses_in_words(browser, paper, tmp_path):
    page, told, asked = opened(browser, paper, tmp_path, WIDE)
    run = """given => quadcosim.run(given).then(r => [r.outcome, r.divergence_time, r.metrics.ultimate_bound,
             r.sha256, r.rows.length, r.rows[1].length], error => error.message)"""
    for given, *expected in sample(KNOWN, 2):
        assert page.evaluate(run, given)[:3] == expected
    columns = page.evaluate("quadcosim.run({}).then(r => r.columns)")
    flight = fly(Scenario(), {"seed": [0]}, record=columns)
    found = page.evaluate(run, {})
    assert found[3:] == [*hashes_of(flight, columns), 30_001, len(columns) + 1]
    refused = {
        "timing.jitter": (0.02, "less than the period"), "timing.period": (0.0, "a number above 0"),
        "timing.command_loss": (1.5, "at most 1"), "timing.nothing": (1.0, "one of timing.period"),
    }  # fmt: skip
    for path, (value, words) in refused.items():
        assert words in page.evaluate(run, {path: value})
    assert told == []
    assert [url for url in asked if not url.startswith(("file:", "blob:"))] == []


@in_test_all
@ZIG
def test_cells_of_the_map_are_the_single_runs(browser, paper, tmp_path):
    page, _, _ = opened(browser, paper, tmp_path, WIDE)
    wait(page, "quadcosim.map.cells.size > 60")
    wrong = page.evaluate("""async () => {
        const { cells, axes } = quadcosim.map, wrong = [];
        for (const [key, [outcome, value]] of [...cells].slice(0, 30)) {
          const given = { [axes[0].path]: axes[0].at(Math.floor(key / 24)), [axes[1].path]: axes[1].at(key % 24) };
          const single = await quadcosim.run(given);
          const same = single.outcome === outcome && single.metrics.ultimate_bound === value;
          if (!same) wrong.push([given, outcome, value]);
        }
        return wrong;
    }""")
    assert wrong == []


@ZIG
def test_a_key_moves_a_slider_and_the_address_keeps_it(browser, paper, tmp_path):
    page, _, _ = opened(browser, paper, tmp_path, {"width": 390, "height": 800}, "#timing.period=0.08")
    assert page.inner_text("#word") == "diverges"
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.focus("input[name='controller.coupling']")
    page.keyboard.press("Home")
    wait(page, "document.getElementById('word').textContent.startsWith('survives')")
    assert page.evaluate("location.hash") == "#timing.period=0.08&controller.coupling=0"
    assert page.evaluate("quadcosim.command") == "quadcosim run --period 0.08 --set controller.coupling=0"


def verdicts(page):
    """What the page says of the run, of the second law and of the pinned run, when all of them are drawn."""
    page.wait_for_selector("body[data-drawn]")
    found = page.evaluate("""["word", "numbers", "secondverdict", "pinnedverdict"]
        .map(id => document.getElementById(id)).map(element => element.hidden ? "" : element.textContent)""")
    return f"{found[0]} {found[1]}", *found[2:]


@ZIG
def test_steps_of_the_guided_page_show_what_their_claims_say(browser, paper, tmp_path):
    page, _, _ = opened(browser, paper, tmp_path, WIDE)
    for one in steps():
        page.evaluate(
            """at => new Promise(go => {
            if (location.hash.slice(1) === at) go();
            addEventListener("hashchange", go, { once: true }), location.hash = at;
        })""",
            one.at,
        )
        own, second, _ = verdicts(page)
        assert own.startswith(one.verdict)
        assert second.startswith(f"second law: {one.second}" if one.second else "")


@in_test_all
@ZIG
def test_a_second_law_has_the_clock_of_the_first_and_a_pin_has_its_own(browser, paper, tmp_path):
    page, _, _ = opened(browser, paper, tmp_path, {"width": 390, "height": 800}, "#timing.period=0.079")
    page.click("#pin"), page.click("#second")
    page.focus("input[name='second.controller.coupling']")
    page.keyboard.press("Home")
    wait(page, "document.getElementById('secondverdict').textContent.includes('settles in 5.58 s')")
    page.focus("input[name='timing.period']")
    page.keyboard.press("Home")
    wait(page, "document.getElementById('word').textContent.startsWith('settles')")
    shared = page.evaluate("location.hash")
    assert shared == (
        "#timing.period=0.001&second&second.controller.coupling=0&pinned&pinned.timing.period=0.079"
    )  # fmt: skip
    found = verdicts(page)
    assert found[2].startswith("pinned: diverges, at 2.47 s")
    again, _, _ = opened(browser, paper, tmp_path, WIDE, shared)
    assert verdicts(again) == found
    assert again.evaluate("quadcosim.command").splitlines() == [
        "quadcosim run --period 0.001", "quadcosim run --period 0.001 --set controller.coupling=0",
        "quadcosim run --period 0.079",
    ]  # fmt: skip


@ZIG
def test_a_page_works_inside_another(browser, paper, tmp_path):
    outer = tmp_path / "outer.html"
    outer.write_text(f"<!doctype html><meta charset='utf-8'>{paper._repr_html_()}", encoding="utf-8")
    page = browser.new_page()
    page.set_default_timeout(1e3 * PATIENCE)
    page.goto(outer.as_uri())
    inner = page.frame_locator("iframe").locator("#word")
    inner.filter(has_text="settles in 4.98 s").wait_for()


def test_an_installed_package_has_the_page_of_the_paper(monkeypatch, tmp_path, main):
    module = sys.modules[live.__module__]
    shipped = tmp_path / "shipped.html"
    shipped.write_text("the page", encoding="utf-8")
    monkeypatch.setattr(module, "SHIPPED", shipped)
    monkeypatch.setattr(module, "live", None)
    monkeypatch.chdir(tmp_path)
    assert main("live", "--out", "here.html").returncode == 0
    assert (tmp_path / "here.html").read_text(encoding="utf-8") == "the page"


@ZIG
def test_the_page_beside_a_report_begins_with_the_stored_run(main, tmp_path):
    flown = tmp_path / "flown"
    main("run", "--native", "--period", "0.02", "--stop-time", "0.5", "--no-figures", "--out", flown)
    main("report", flown, "--live", "--out", tmp_path / "page.html")
    beside = SimpleNamespace(html=(tmp_path / "page_live.html").read_text(encoding="utf-8"))
    document = json.loads(unpacked(beside, "system"))
    settings = {path: value for path, value, *_ in document["settings"]}
    assert (settings["stop_time"], settings["components.controller.sampling.period"]) == (0.5, 0.02)
    assert document["name"].endswith("flown/scenario.toml")
    for several in ([flown, flown], [tmp_path / "page.html"]):
        done = main("report", *several, "--live", code=2)
        assert "expected the directory of" in done.stderr


def test_what_a_page_cannot_vary_is_named():
    with pytest.raises(UsageError, match=re.escape("timing.period = 0.1:0.01: expected LOW:HIGH")):
        live(Scenario(), {"timing.period": (0.1, 0.01)})
    with pytest.raises(UsageError, match=r"map timing\.delay: .*expected one of timing\.period"):
        live(Scenario(), {"timing.period": (0.01, 0.1)}, ("timing.period", "timing.delay"))


def test_a_page_of_a_file_is_headed_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writing, "module_of", lambda *_: b"")
    path = ROOT / "examples/dc_servo/system.toml"
    assert f"<title>{path}</title>" in live(path).html
