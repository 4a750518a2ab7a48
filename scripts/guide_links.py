#!/usr/bin/env python3
"""Builds the guide with mdBook and checks its pages: each link to a file or heading leads somewhere within the book.

  scripts/guide_links.py [MDBOOK]      MDBOOK: the program, if it is not on the path

Links to other sites are not followed.
"""
import re
import subprocess
import sys
import tempfile
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote


class Page(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self, text):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("href", "src") and value:
                self.links.append(value)
            elif name in ("id", "name") and value:
                self.anchors.add(value)


def wrong_links(book):
    """The links that lead nowhere, as `page: link`."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(book.rglob("*.html"))}
    for path, page in pages.items():
        for link in sorted(set(page.links)):
            if re.match(r"[a-z]+:", link):
                continue
            file, _, anchor = link.partition("#")
            file = unquote(file.split("?")[0])
            to = (path.parent / file).resolve() if file else path
            inside = to.is_relative_to(book)
            if not inside or not to.is_file():
                yield f"{path.relative_to(book)}: {link}"
            elif anchor and to in pages and anchor not in pages[to].anchors:
                yield f"{path.relative_to(book)}: {link}: no such heading"


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "mdbook"
    guide = Path(__file__).resolve().parent.parent / "src" / "guide"
    with tempfile.TemporaryDirectory() as folder:
        book = Path(folder).resolve() / "book"
        subprocess.run([program, "build", guide, "-d", book], check=True, capture_output=True)
        wrong = list(wrong_links(book))
        n = len(list(book.rglob("*.html")))
    for line in wrong:
        print(line)
    print(f"{n} pages, {len(wrong)} links that lead nowhere")
    return 1 if wrong or n < 10 else 0


if __name__ == "__main__":
    sys.exit(main())
