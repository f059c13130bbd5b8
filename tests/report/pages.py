"""Pages as a browser shows them and as a script reads them."""

from __future__ import annotations

import base64
import io
import json
import re
import zlib

import numpy as np
from matplotlib.image import imread

from tests.browser import Browser

MEGABYTE = 10**6


EVIL = (
    "</script><script>window.hacked=1</script><!--<img src=x onerror='window.hacked=2'>%data% &"
    " \u2028 é"
)


def replay_of(page: str) -> dict:
    """The replay of a page, as its script reads it, without the signs that say how columns are
    packed.
    """
    (text,) = re.findall(r'<script type="text/plain" id="data">(.*?)</script>', page)
    return json.loads(re.sub(rb'[+@]":', b'":', zlib.decompress(base64.b64decode(text))))


def asked_for(browser: Browser) -> list[str]:
    """Addresses besides the pictures that are in the page itself."""
    return [address for address in browser.requests if not address.startswith("data:image/svg")]


def picture(png: bytes) -> np.ndarray:
    """Red, green and blue of each point, 0 to 255."""
    return 255 * imread(io.BytesIO(png))[..., :3]


def middle(browser: Browser, element: str) -> tuple[float, float]:
    """Scrolls an element into the window; the point in its middle."""
    browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    browser.evaluate(f"document.getElementById('{element}').scrollIntoView({{block: 'center'}})")
    x, y = browser.evaluate(
        "(({ x, y, width, height }) => [x + width / 2, y + height /"
        f" 2])(document.getElementById('{element}').getBoundingClientRect())"
    )
    return x, y
