"""The site of the documentation: it builds strictly, its links resolve, and it needs no host."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import browser
import pytest

import vrscan
from vrscan.engines.tools import repository_root


class Reader(HTMLParser):
    """What a page links to, what it fetches, and the names that it has."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.names: set[str] = set()
        self.feed(page.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value is not None}
        self.names |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif "src" in given or tag == "link":
            self.fetched.append(given.get("src") or given["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    mkdocs = Path(sys.executable).parent / "mkdocs"
    done = subprocess.run(
        [mkdocs, "build", "--strict", "--quiet", "--site-dir", folder],
        cwd=repository_root(),
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.xdist_group("site")
def test_every_link_and_picture_is_there(site: Path) -> None:
    pages = {page: Reader(page) for page in site.rglob("*.html") if page.name != "404.html"}
    docs = list((repository_root() / "docs").glob("*.md"))
    assert len(pages) == len(docs) + 4  # README, changelog, virtual board, Python
    for page, read in pages.items():
        for link in read.links + read.fetched:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.is_file() or (target / "index.html").is_file(), f"{page.name}: {link}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].names, f"{page.name}: {link}"


@pytest.mark.xdist_group("site")
def test_nothing_is_fetched_from_another_host(site: Path) -> None:
    for page in site.rglob("*.html"):
        for source in Reader(page).fetched:
            parts = urlsplit(source)
            assert parts.scheme in ("", "data") and not parts.netloc, f"{page.name}: {source}"
        assert 'class="mermaid"' not in page.read_text()  # the theme fetches what draws it
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(https?:)?//", sheet.read_text()), sheet.name


@pytest.mark.xdist_group("site")
def test_every_name_of_the_package_is_documented(site: Path) -> None:
    names = Reader(site / "api.html").names
    for place in vrscan._PLACES.values():
        assert place.replace(":", ".") in names


@browser.NEEDED
@pytest.mark.xdist_group("site")
def test_the_search_finds_in_pages_that_are_files(site: Path) -> None:
    with browser.Browser() as page:
        page.open((site / "usage.html").as_uri())
        page.wait("document.querySelector('[data-md-component=search-result] ol')")
        page.run(
            "document.querySelector('[data-md-toggle=search]').click();"
            "const field = document.querySelector('[data-md-component=search-query]');"
            "field.focus(); field.value = 'laser guard heartbeat';"
            "field.dispatchEvent(new KeyboardEvent('keyup', {bubbles: true}))"
        )
        page.wait("document.querySelector('.md-search-result__link')", 60.0)
        links = page.run(
            "return [...document.querySelectorAll('.md-search-result__link')].map((e) => e.href)"
        )
        assert any("registers.html" in link for link in links)
        assert all((site / unquote(urlsplit(link).path)).exists() for link in links)
        assert page.complaints() == []
