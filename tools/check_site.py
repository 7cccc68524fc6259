#!/usr/bin/env python3
"""Checks the links within a site: each link, picture and film must be there, and each anchor. Fetches nothing.

    check_site.py FOLDER
"""

import html.parser
import pathlib
import sys
import urllib.parse


class Page(html.parser.HTMLParser):
    """The links of a page, with their lines, and what can be linked to on it."""

    def __init__(self, path):
        super().__init__()
        self.links, self.ids = [], {""}
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id":
                self.ids.add(value)
            elif name in ("href", "src"):
                self.links.append((self.getpos()[0], value))


site = pathlib.Path(sys.argv[1]).resolve()
pages = {path: Page(path) for path in sorted(site.rglob("*.html"))}
links = broken = 0
for path, page in pages.items():
    for line, link in page.links:
        url = urllib.parse.urlsplit(link)
        if url.scheme or url.netloc:
            continue
        links += 1
        target = (path.parent / urllib.parse.unquote(url.path)).resolve() if url.path else path
        there = target.is_file() and target.is_relative_to(site)
        if not there or target in pages and urllib.parse.unquote(url.fragment) not in pages[target].ids:
            broken += 1
            print(f"{path.relative_to(site)}:{line}: '{link}' is not there")
print(f"{len(pages)} pages, {links} links within the site, {broken} broken")
sys.exit(broken > 0 or links == 0)
