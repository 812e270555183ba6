"""Links of the pages, which are valid in the repository, converted for the site."""

import posixpath
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
"""The repository."""
ELSEWHERE = (
    "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "fmus/README.md", "tests/reference/README.md", "examples/README.md",
    "examples/*/README.md",
)  # fmt: skip
"""Pages outside of `docs/`, beside what they describe."""
LINK = re.compile(r"(\]\(|^\[(?!\^)[^\]\n]+\]: +)(?![a-z]+:|#|//)([^)\s#]+)", re.MULTILINE)
"""A link to another file, inline or by reference: the text before the address, and the address."""
HREF = re.compile(r'(href=")(?![a-z]+:|#)([^"#]+)')
"""A link in HTML."""
DOCUMENTATION = ("plant_fmu/*.html", "controller_fmu/*/*.html")
"""The documentation of the FMUs, beside their slaves."""
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)
OF_PICTURES = (".png", ".svg")
OF_PAGES = (".md", ".ipynb", ".html")


def address_of(path: str) -> str:
    """The address of a repository's file on the site: `docs/` is its root, and README.md its first page."""
    if path == "README.md":
        return "index.md"
    if path.endswith(".html") and not path.startswith("docs/"):
        return f"fmus/{Path(path).stem}.md"
    if path.startswith("docs/") or path.endswith((*OF_PICTURES, *OF_PAGES)):
        return path.removeprefix("docs/")
    return f"{path}/index.md" if (ROOT / path).is_dir() else f"{path}.md"


def pages_elsewhere() -> dict[str, str]:
    """Paths in the repository of the pages outside `docs/`, by address."""
    return {address_of(path): path for path in _found(ELSEWHERE)}


def documentation() -> dict[str, str]:
    """Paths of the documentation of FMUs, by address."""
    return {address_of(path): path for path in _found(DOCUMENTATION)}


@dataclass(frozen=True, kw_only=True)
class Links:
    """Conversion of links; sources are linked at `repo_url`, or shown on pages if there is none."""

    repo_url: str | None

    def rewritten(self, markdown: str, address: str) -> str:
        """The text of the page at `address` with its links converted."""
        led = self._leading(address)
        return _outside_of_code(LINK, led, self.rewritten_html(markdown, address))

    def rewritten_html(self, html: str, address: str) -> str:
        """The HTML of the page at `address` with its links converted."""
        led = self._leading(address)
        return HREF.sub(lambda match: re.sub(r"\.(md|ipynb)$", ".html", led(match)), html)

    def _leading(self, address: str) -> Callable[[re.Match[str]], str]:
        path = (pages_elsewhere() | documentation()).get(address, f"docs/{address}")
        return lambda match: match[1] + self._to(_target(path, match[2]), posixpath.dirname(address))

    def pictures(self) -> dict[str, Path]:
        """The pictures outside `docs/` that pages show, by address."""
        return {address_of(path): ROOT / path for path in _linked() if path.endswith(OF_PICTURES)}

    def sources(self) -> dict[str, str]:
        """The pages that show linked files and folders of sources, by address."""
        if self.repo_url:
            return {}
        shown = [path for path in _linked() if not path.endswith((*OF_PICTURES, *OF_PAGES))]
        within = [each.relative_to(ROOT).as_posix() for path in shown for each in _files_in(ROOT / path)]
        return {address_of(path): _shown(path) for path in (*shown, *within)}

    def _to(self, target: str, folder: str) -> str:
        if (ROOT / target / "README.md").is_file():
            target += "/README.md"
        if self.repo_url and not target.startswith("docs/") and not target.endswith((*OF_PICTURES, *OF_PAGES)):
            return f"{self.repo_url}/blob/HEAD/{target}"
        return posixpath.relpath(address_of(target), folder or ".")


def _linked() -> list[str]:
    """The targets of links outside `docs/`."""
    targets = {
        _target(page, link)
        for page in _pages()
        for _, link in (HREF if page.endswith(".html") else LINK).findall(
            CODE.sub("", (ROOT / page).read_text("utf-8"))
        )
    }
    return sorted(target for target in targets if not target.startswith("docs/") and (ROOT / target).exists())


def _pages() -> Iterator[str]:
    yield from pages_elsewhere().values()
    yield from documentation().values()
    yield from _found(["docs/**/*.md"])


def _found(patterns: Iterable[str]) -> Iterator[str]:
    for pattern in patterns:
        yield from sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern))


def _target(page: str, link: str) -> str:
    """The path in the repository of a link's target, from the page at a path."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), link))


def _files_in(path: Path) -> list[Path]:
    return sorted(each for each in path.glob("*") if each.suffix in (".toml", ".py")) if path.is_dir() else []


def _shown(path: str) -> str:
    """The page of a source file, or of a folder of them."""
    if (ROOT / path).is_dir():
        files = "".join(f"- [{each.name}]({each.name}.md)\n" for each in _files_in(ROOT / path))
        return f"# {path}/\n\n{files}"
    return f"# {path}\n\n````{Path(path).suffix[1:]}\n{(ROOT / path).read_text('utf-8')}````\n"


def _outside_of_code(pattern: re.Pattern[str], replacement: Callable[[re.Match[str]], str], text: str) -> str:
    """`text` with `pattern` replaced wherever it is not code."""
    pieces, end = [], 0
    for code in CODE.finditer(text):
        pieces += [pattern.sub(replacement, text[end : code.start()]), code[0]]
        end = code.end()
    return "".join([*pieces, pattern.sub(replacement, text[end:])])
