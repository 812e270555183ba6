"""Hooks of MkDocs that add pages beside those in `docs/`, and rewrite links."""

from collections.abc import Callable
from functools import partial
from typing import Any

from mkdocs.structure.files import File, Files, InclusionLevel

from docs.claim_records import LIVE
from docs.website import answers, commands, fmus, keys, rules
from docs.website.links import ROOT, Links, pages_elsewhere
from docs.website.markdown import for_the_site
from quadcosim import live

GENERATED: dict[str, Callable[[], str]] = {
    f"fmus/{slave.__name__}.md": partial(fmus.page, slave) for slave in fmus.SLAVES
}
"""Pages generated from the code, by address."""
CONTINUED: dict[str, Callable[[], str]] = {
    "commands.md": commands.section,
    "keys.md": keys.section,
    "validation.md": rules.section,
    **answers.SECTIONS,
}
"""Sections generated from the code at the end of pages in `docs/`, by address."""
BEHIND = 1e-6
"""Search weight of sources relative to pages, so that pages are found first even if the title of a source matches"""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages outside of `docs/`, those generated from the code, the page that runs, and linked files."""
    links = Links(repo_url=config.repo_url)
    if (old := files.get_file_from_path(LIVE)) is not None:
        files.remove(old)
    files.append(File.generated(config, LIVE, content=live().html))
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
    """The Markdown of a page, with links and code blocks converted for the site."""
    address = page.file.src_uri
    shows_source = page.file.inclusion.is_not_in_nav() and address not in pages_elsewhere()
    if shows_source:
        page.meta["search"] = {"boost": BEHIND}
    if shows_source or address.endswith(".ipynb"):
        return markdown
    continued = CONTINUED[address]() if address in CONTINUED else ""
    return for_the_site(Links(repo_url=config.repo_url).rewritten(markdown + continued, address))


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """The HTML of a notebook's page, with links converted for the site."""
    address = page.file.src_uri
    return Links(repo_url=config.repo_url).rewritten_html(html, address) if address.endswith(".ipynb") else html
