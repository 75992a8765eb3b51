"""MkDocs hook: docstrings name code with Sphinx roles such as :func:`simulate`; pages show only the name."""

from __future__ import annotations

import re
from typing import Any

ROLE = re.compile(r":(?:attr|class|data|func|meth|mod):(?=<code>)")


def on_page_content(html: str, **_: Any) -> str:
    """Remove the roles from a page."""
    return ROLE.sub("", html)
