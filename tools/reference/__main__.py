"""``python -m tools.reference``: writes the committed pages of docs/reference anew."""

from tools.reference.pages import DOCS, texts

for name, text in texts().items():
    path = DOCS / name
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(DOCS.parent))
