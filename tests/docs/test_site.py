"""The site is built strictly from the repository: nothing comes from elsewhere, and no link leads nowhere."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import pytest

from docs.website.links import LINK, ROOT, Links, documentation, pages_elsewhere
from docs.website.markdown import for_the_site
from tests.extent import WHOLE

REMOTE = re.compile(r'<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)="(?:https?:)?//[^"]*"')
LOCAL = re.compile(r'\b(?:src|href)="(?![a-z]+:|//|#)([^"#?]+)')


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site; where the strict build fails, so do all tests here."""
    if not WHOLE:
        pytest.skip("in make test-all, and in make site")
    pytest.importorskip("ziglang", reason="no compiler for WebAssembly: pip install 'quadcosim[live]'")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def pages(site: Path) -> dict[str, str]:
    """The text of each page by its address."""
    found = {path.relative_to(site).as_posix(): path.read_text("utf-8") for path in site.rglob("*.html")}
    return {address: text for address, text in found.items() if address != "404.html"}


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    assert {address: found for address, text in pages(site).items() if (found := REMOTE.findall(text))} == {}


def test_every_link_within_the_site_leads_to_a_file(site: Path) -> None:
    """The strict build looks at Markdown; this looks at what came of it, tables written as HTML among it."""
    broken = [
        (address, link)
        for address, text in pages(site).items()
        for link in LOCAL.findall(text)
        if not (site / address).parent.joinpath(unquote(link)).is_file()
    ]
    assert broken == []


def test_every_picture_says_what_it_shows(site: Path) -> None:
    silent = [
        (address, tag)
        for address, text in pages(site).items()
        for tag in re.findall(r"<img\b[^>]*>", text)
        if not re.search(r'\balt="[^"]+"', tag)
    ]
    assert silent == []


def test_the_search_has_what_is_made_of_the_code(site: Path) -> None:
    index = (site / "search" / "search_index.js").read_text("utf-8")
    for word in ("--burst-length", "delay_jitter", "gain.disturbance", "save_run"):
        assert word in index


def test_the_search_finds_pages_before_sources(site: Path) -> None:
    index = json.loads((site / "search" / "search_index.js").read_text("utf-8").partition("=")[2].strip().rstrip(";"))
    boosts = {entry["location"].partition("#")[0]: entry.get("boost", 1.0) for entry in index["docs"]}
    sources = [boost for place, boost in boosts.items() if place.endswith((".py.html", ".toml.html", ".c.html"))]
    assert len(sources) > 10
    assert max(sources) < 1e-3
    assert [boosts[page] for page in ("api.html", "commands.html", "figures.html", "timing.html")] == [1.0] * 4


@pytest.mark.parametrize("page", [*pages_elsewhere().values(), *documentation().values()])
def test_links_of_pages_elsewhere_lead_to_files_in_the_repository_too(page: str) -> None:
    for _, link in LINK.findall((ROOT / page).read_text("utf-8")):
        assert (ROOT / page).parent.joinpath(link).exists(), link


def test_sources_are_linked_where_they_are_published() -> None:
    links = Links(repo_url="https://host/owner/name")
    text = links.rewritten("[loader](../fmu_kit/loader.c) [page](timing.md#events) `[a](b)`", "systems.md")
    published = "https://host/owner/name/blob/HEAD/fmu_kit/loader.c"
    assert text == f"[loader]({published}) [page](timing.md#events) `[a](b)`"
    assert links.sources() == {}


def test_a_code_block_keeps_the_name_of_its_file() -> None:
    assert for_the_site("```toml mine.toml\nx = 1\n```\n") == '```toml title="mine.toml"\nx = 1\n```\n'


def test_blocks_of_commands_are_coloured_and_equations_are_not() -> None:
    assert (
        for_the_site("text\n\n    quadcosim run  # fly\n\nmore") == "text\n\n```sh\nquadcosim run  # fly\n```\n\nmore"
    )
    assert for_the_site("text\n\n    L = 2 k\n\nmore") == "text\n\n    L = 2 k\n\nmore"
