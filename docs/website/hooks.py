"""What MkDocs asks while it builds the site: which pages there are beside those in `docs/`, and where links lead."""

from collections.abc import Callable
from functools import partial
from typing import Any

from mkdocs.structure.files import File, Files, InclusionLevel

from docs.website import commands, fmus, keys
from docs.website.links import ROOT, Links, pages_elsewhere
from docs.website.markdown import for_the_site

GENERATED: dict[str, Callable[[], str]] = {
    "commands.md": commands.page,
    "keys.md": keys.page,
    **{f"fmus/{slave.__name__}.md": partial(fmus.page, slave) for slave in fmus.SLAVES},
}
"""Pages that are made of the code, by their addresses."""
BEHIND = 1e-6
"""What a hit in a source counts beside one in a page, a thousandfold if it is in its title: pages are found first"""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie beside what they describe, those made of the code, and what pages link to."""
    links = Links(repo_url=config.repo_url)
    for address, path in pages_elsewhere().items():
        files.append(File.generated(config, address, abs_src_path=str(ROOT / path)))
    for address, picture in links.pictures().items():
        files.append(File.generated(config, address, abs_src_path=str(picture)))
    for address, page in GENERATED.items():
        files.append(File.generated(config, address, content=page()))
    for address, text in links.sources().items():
        files.append(File.generated(config, address, content=text, inclusion=InclusionLevel.NOT_IN_NAV))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """The page as a code host shows it, with its links and code blocks as the site has them."""
    address = page.file.src_uri
    if page.file.inclusion.is_not_in_nav():
        page.meta["search"] = {"boost": BEHIND}
    shows_source = page.file.inclusion.is_not_in_nav() or address.endswith(".ipynb")
    return markdown if shows_source else for_the_site(Links(repo_url=config.repo_url).rewritten(markdown, address))


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """A page that was a notebook, with its links as the site has them."""
    address = page.file.src_uri
    return Links(repo_url=config.repo_url).rewritten_html(html, address) if address.endswith(".ipynb") else html
