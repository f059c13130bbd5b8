"""How pictures are sent; the number is JPEG's quality."""

from typing import Literal

Encoding = Literal["raw", "png", "jpeg90", "jpeg80"]
