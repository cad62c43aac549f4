# SPDX-License-Identifier: BSD-3-Clause
"""What mkdocs is to do besides: generated pages, and scripts for the pages that need them.

KaTeX comes from Debian's package, mermaid from docs/assets; each is loaded only by pages with
formulas or diagrams, and nothing from other hosts.
"""

from __future__ import annotations

import logging
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.utils import get_relative_url

_log = logging.getLogger("mkdocs.hooks.docs")

ROOT = Path(__file__).resolve().parents[1]
KATEX = Path("/usr/share/javascript/katex")
COMMANDS = "<!-- all commands -->"

#: Pages that are files of the checkout, and where they stand in the site.
PAGES = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}

#: What a browser would load from another host when it shows the page.
FOREIGN = re.compile(r"<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=.(?:https?:)?//[^>]*>")

FORMULAS = ("assets/katex/katex.min.css", "assets/katex/katex.js", "assets/formulas.js")
DIAGRAMS = ("assets/mermaid.min.js",)


def on_files(files: Files, config: Any) -> Files:
    """Add KaTeX and the pages that are made of other files."""
    if not KATEX.is_dir():
        raise PluginError(
            f"{KATEX} does not exist: install the Debian package libjs-katex "
            "(scripts/install_system_packages.sh docs)"
        )
    sources = [KATEX / "katex.min.css", KATEX / "katex.js", *sorted(KATEX.glob("fonts/*.woff2"))]
    for source in sources:
        place = f"assets/katex/{source.relative_to(KATEX)}"
        files.append(File.generated(config, place, abs_src_path=str(source)))
    for name, place in PAGES.items():
        files.append(File.generated(config, place, content=_moved_into_docs(ROOT / name)))
    return files


def _moved_into_docs(path: Path) -> str:
    """Text of a page of the checkout whose links lead into docs/."""
    return re.sub(r"\]\(docs/", "](", path.read_text(encoding="utf-8"))


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put in the reference of the command line; lead links out of docs/ to where pages stand."""
    for name, place in PAGES.items():
        markdown = markdown.replace(f"](../{name}", f"]({place}")
    if COMMANDS not in markdown:
        return markdown
    sys.path.insert(0, str(ROOT / "scripts"))
    from command_reference import reference  # noqa: PLC0415  # needs the installed package

    return markdown.replace(COMMANDS, reference())


def on_page_content(html: str, **_: Any) -> str:
    """Keep the source of diagrams out of the search."""
    return html.replace('<pre class="mermaid">', '<pre class="mermaid" data-search-exclude>')


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Load KaTeX and mermaid where they are needed, before the theme's own scripts."""
    for tag in FOREIGN.findall(output):
        _log.warning("%s loads something from another host: %s", page.file.src_uri, tag)
    wanted = [
        *(FORMULAS if 'class="arithmatex"' in output else ()),
        *(DIAGRAMS if 'class="mermaid"' in output else ()),
    ]
    tags = [_tag(get_relative_url(place, page.url)) for place in wanted]
    # Scripts at the end of the page: the formulas are there then, and the bundle comes later.
    position = output.rindex('<script id="__config"')
    return output[:position] + "".join(tags) + output[position:]


def _tag(url: str) -> str:
    if url.endswith(".css"):
        return f'<link rel="stylesheet" href="{url}">'
    return f'<script src="{url}"></script>'
