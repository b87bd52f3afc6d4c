"""What is printed can be shown: by terminals that know no UTF-8, and each message as one line."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

#: ASCII for signs whose name or decomposition does not say it.
SIGNS = {
    **{"−": "-", "–": "-", "·": "*", "×": "x", "÷": "/", "±": "+-", "≤": "<=", "≥": ">=", "∂": "d", "∨": "or"},
    **{"→": "->", "←": "<-", "…": "...", "“": '"', "”": '"', "°": " deg", "µ": "u", "½": "1/2", "━": "-"},
}
#: Categories of Unicode that no line can hold: control characters, line and paragraph ends, bytes that are no text.
_NEVER_SHOWN = {"Cc", "Zl", "Zp", "Cs"}
#: Kinds of signs that turn the direction of all that follows in a line.
_TURNING = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}
_HANDLER = "forcegrasp.in_ascii"


def show_everything() -> None:
    """Has stdout and stderr write what their encoding lacks in ASCII, where Python would raise UnicodeEncodeError."""
    codecs.register_error(_HANDLER, _replace)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # it may be something else within another program
            stream.reconfigure(errors=_HANDLER)


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(in_ascii, error.object[error.start : error.end])), error.end


def in_ascii(character: str) -> str:
    """The nearest that ASCII has: kappa for κ, 2 for ₂, e for é; an escape for bytes that are no text."""
    if character in SIGNS:
        return SIGNS[character]
    words = unicodedata.name(character, "").split()
    if words[:1] == ["GREEK"] and words[2:3] == ["LETTER"]:
        name = words[3].replace("LAMDA", "LAMBDA")
        return name.lower() if words[1] == "SMALL" else name.capitalize()
    plain = "".join(c for c in unicodedata.normalize("NFKD", character) if c.isascii())
    if unicodedata.category(character) == "Cs":
        return ascii(character)[1:-1]
    return plain or ("" if unicodedata.combining(character) else "?")


def in_a_line(text: str) -> str:
    """A message without line breaks, and without what else would steer a terminal; names of files may hold both."""

    def shown(c: str) -> bool:
        return unicodedata.category(c) not in _NEVER_SHOWN and unicodedata.bidirectional(c) not in _TURNING

    return "".join(c if shown(c) else ascii(c)[1:-1] for c in text)
