"""What MkDocs is told beside mkdocs.yml: the pages of the site that do not lie in docs.

README, changelog and the virtual board's page lie where a reader of the repository looks for them,
and the page of the Python names is made of ``vrscan.__all__``.
"""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import vrscan

ROOT = Path(__file__).parents[1]
ELSEWHERE = {
    "index.md": "README.md",
    "changelog.md": "CHANGELOG.md",
    "virtual-board.md": "tb/board/README.md",
}
WORKER = "iframe-worker.js"
LINK = re.compile(r"\[([^\]]+)\]\(((?:\.\./)+[^)]+)\)")


def on_files(files: Files, /, *, config: MkDocsConfig) -> Files:
    """Add the pages that do not lie in docs."""
    for name, place in ELSEWHERE.items():
        text = (ROOT / place).read_text()
        text = text.replace("](../../docs/", "](").replace("](docs/", "](")
        files.append(File.generated(config, name, content=text))
    files.append(File.generated(config, "api.md", content=python_names()))
    files.append(File.generated(config, WORKER, abs_src_path=str(ROOT / "scripts" / WORKER)))
    return files


def on_page_markdown(markdown: str, /, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links that leave docs lead to the site's page, or be their text where there is none."""
    pages = {place: name for name, place in ELSEWHERE.items()}

    def led(link: re.Match[str]) -> str:
        place, _, anchor = link[2].removeprefix("../").partition("#")
        if place not in pages:
            return link[1]
        return f"[{link[1]}]({pages[place]}{'#' * bool(anchor)}{anchor})"

    return LINK.sub(led, markdown)


def python_names() -> str:
    """Return the page of what ``import vrscan`` offers, functions first."""
    places = dict(sorted(vrscan._PLACES.items(), key=lambda each: (each[0][0].isupper(), each[0])))
    entries = (
        f"::: {place.replace(':', '.')}\n    options:\n      heading: {name}\n"
        f"      toc_label: {name}\n"
        for name, place in places.items()
    )
    words = (
        "# Python\n\n`import vrscan` offers these names. "
        "[The notebook](example.ipynb) goes from a scene to points and their errors.\n"
    )
    return "\n".join([words, *entries])
