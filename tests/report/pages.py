"""Pages as a browser shows them and as a script reads them."""

from __future__ import annotations

import io
import json
import re

import numpy as np
from matplotlib.image import imread

from tests.browser import Browser

MEGABYTE = 10**6


EVIL = (
    "</script><script>window.hacked=1</script><!--<img src=x onerror='window.hacked=2'>%data% &"
    " \u2028 é"
)


def embedded(page: str) -> dict:
    """The data of a page, as its script reads it."""
    (text,) = re.findall(
        r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL
    )
    return json.loads(text)


def picture(png: bytes) -> np.ndarray:
    """Red, green and blue of each point, 0 to 255."""
    return 255 * imread(io.BytesIO(png))[..., :3]


def middle(browser: Browser, element: str) -> tuple[float, float]:
    """Scrolls an element into the window; the point in its middle."""
    browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    browser.evaluate(f"byId('{element}').scrollIntoView({{block: 'center'}})")
    x, y = browser.evaluate(
        "(({ x, y, width, height }) => [x + width / 2, y + height /"
        f" 2])(byId('{element}').getBoundingClientRect())"
    )
    return x, y
