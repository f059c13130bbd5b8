"""Archives as they are downloaded."""

from __future__ import annotations

import io
import zipfile


def archive(entries, path=None):
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in entries:
            packed.writestr(name, content)
    if path is not None:
        path.write_bytes(made.getvalue())
    return made.getvalue()
