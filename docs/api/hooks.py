"""What the site has beside docs/: the README as its first page, a page for each folder of results/.

All links are written as the repository needs them. Here they are led to where the same thing is in
the site. What the site does not have, such as a source file, keeps its text alone; a link to what
is nowhere stays, so that the build reports it.
"""

from __future__ import annotations

import re
from pathlib import Path
from posixpath import dirname, join, normpath, relpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\[([^\]]*)\]\((?!\w+:)([^)#\s]+)(#[^)\s]*)?\)")
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "docs/examples": "api/examples.md",
    "docs/example-package": "api/example-package.md",
}


def in_site(path: str) -> str:
    """Where a file or folder of the repository would be in the site."""
    for place, page in PAGES.items():
        if path == place or path.startswith(f"{place}/"):
            return page
    path = re.sub(r"^(results/[^/]+)(/table\.md)?$", r"\1/index.md", path)
    return path.removeprefix("docs/")


def on_config(config: MkDocsConfig) -> None:
    """Give each folder of results/ its line in the navigation."""
    folders = sorted(path.name for path in (ROOT / "results").iterdir() if path.is_dir())
    config.nav.append({"Results": [{name: f"results/{name}/index.md"} for name in folders]})


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Add what is outside of docs/."""
    others = [ROOT / name for name in PAGES if name.endswith(".md")]
    others += [path for path in sorted((ROOT / "results").rglob("*")) if path.is_file()]
    for path in others:
        place = in_site(path.relative_to(ROOT).as_posix())
        files.append(File.generated(config, place, abs_src_path=str(path)))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead a page's links to the site's pages; show what else is in a folder of results/."""
    source = Path(page.file.abs_src_path)
    here, there = dirname(source.relative_to(ROOT).as_posix()), dirname(page.file.src_uri)

    def led(link: re.Match[str]) -> str:
        text, target, anchor = link.groups(default="")
        path = normpath(join(here, target))
        if not (ROOT / path).exists():
            return link[0]
        place = in_site(path)
        found = files.get_file_from_path(place)
        if found is None or found.inclusion.is_excluded():
            return text
        return f"[{text}]({relpath(place, there or '.')}{anchor})"

    if re.fullmatch(r"results/[^/]+/index\.md", page.file.src_uri):
        markdown += beside(source, markdown)
    return LINK.sub(led, markdown)


def beside(source: Path, text: str) -> str:
    """Figures that the text does not show yet, and links to the other files of its folder."""
    figures = sorted(source.parent.glob("figures/*.png"))
    shown = [f"![{path.stem}](figures/{path.name})" for path in figures if path.name not in text]
    others = sorted(path.name for path in source.parent.iterdir() if path.is_file())
    listed = [f"- [{name}]({name})" for name in others if name != source.name]
    parts = ["\n## Figures" if shown else "", *shown, "## Files", "\n".join(listed)]
    return "\n\n".join(part for part in parts if part) + "\n"
