"""Faults of the site in headless Chromium, at the widths of a desk and of a phone; ends with code 1 if there are any.

``python tools/check_site.py [out/docs]`` opens each page that ``make docs`` has built and lists errors of the console,
what axe-core (Deque Systems) finds of the rules of WCAG 2.1 AA (contrast, names of links and frames, texts for
pictures, languages), pages that scroll sideways, and boxes that cut off what is in them. It needs ``make web``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from measure_browser import launch  # noqa: E402

AXE = ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js"

#: Width and height of windows, in CSS pixels.
WINDOWS = ((1280, 900), (390, 844))

#: Lists pages that scroll sideways, and boxes that cut off text, but for those that scroll or end it in dots.
CLIPPED = """() => {
  const found = [];
  const width = document.documentElement.scrollWidth;
  if (width > innerWidth + 1) found.push(`the page is ${width} pixels wide`);
  for (const box of document.querySelectorAll("article *")) {
    const style = getComputedStyle(box);
    const hides = (overflow) => overflow === "hidden" || overflow === "clip";
    if (!box.innerText || style.display === "inline" || style.textOverflow === "ellipsis") continue;
    if (box.clientWidth < 2 || box.closest(".visually-hidden, .sr-only, details:not([open])")) continue;
    const wide = hides(style.overflowX) && box.scrollWidth > box.clientWidth + 1;
    const high = hides(style.overflowY) && box.scrollHeight > box.clientHeight + 1;
    const name = `<${box.tagName.toLowerCase()} class="${box.className}">`;
    if (wide || high) found.push(`${name} cuts off "${box.innerText.slice(0, 40)}"`);
  }
  return found;
}"""

RULES = {
    "runOnly": {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]},
    "iframes": False,
    "preload": False,
}


def faults_of(page: Page, path: Path) -> list[str]:
    """Open a file and list what is wrong with it."""
    found: list[str] = []

    def told(message: Any) -> None:
        if message.type == "error":
            found.append(f"console: {message.text}")

    def thrown(error: Any) -> None:
        found.append(f"exception: {error}")

    page.on("console", told)
    page.on("pageerror", thrown)
    page.goto(path.as_uri())
    page.add_script_tag(path=AXE)
    for violation in page.evaluate("rules => axe.run(document, rules)", RULES)["violations"]:
        for node in violation["nodes"]:
            found.append(f"{violation['id']}: {node['html'][:120]}")
    found += page.evaluate(CLIPPED)
    page.remove_listener("console", told)
    page.remove_listener("pageerror", thrown)
    return found


def main() -> int:
    """Check each page of the site at each width."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", nargs="?", type=Path, default=ROOT / "out" / "docs")
    site = parser.parse_args().site.resolve()
    apart = {"live", "_static", "_modules", "_downloads"}
    pages = [path for path in sorted(site.rglob("*.html")) if apart.isdisjoint(path.relative_to(site).parts[:-1])]
    if not pages or not AXE.is_file():
        missing = "axe-core is not installed; make web" if pages else f"no site in {site}; make docs"
        print(f"tools/check_site.py; {missing}", file=sys.stderr)
        return 2
    count = 0
    with sync_playwright() as playwright:
        browser = launch(playwright, "swiftshader")
        for width, height in WINDOWS:
            page = browser.new_page(viewport={"width": width, "height": height})
            for path in pages:
                for fault in faults_of(page, path):
                    count += 1
                    print(f"{path.relative_to(site)} at {width}: {fault}")
            page.close()
        browser.close()
    print(f"{len(pages)} pages at {' and '.join(str(width) for width, _ in WINDOWS)} pixels: {count} faults")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
