"""What a terminal is shown: any text may come from a file, and a terminal obeys some characters."""

import re
from contextlib import AbstractContextManager, redirect_stdout
from typing import Any, TextIO, cast

# Control characters but for the end of a line and the tabulator, marks that turn the direction of writing, and bytes of
# file names that are no text.
OBEYED = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def harmless(text: str) -> str:
    """The text with a question mark for each character that a terminal would obey instead of showing it."""
    return OBEYED.sub("?", text)


def on_a_line(text: str) -> str:
    """The same with spaces for tabulators and ends of lines, for which no font of a picture has a sign."""
    return re.sub(r"[\t\n]", " ", harmless(text))


class _Shown:
    """A stream that shows text: harmless, and with a question mark for what its encoding lacks."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text, never failing for the characters in it; gives their number."""
        text = harmless(text)
        try:
            return self.stream.write(text)
        except UnicodeEncodeError:
            encoding = self.stream.encoding or "ascii"
            return self.stream.write(text.encode(encoding, errors="replace").decode(encoding))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def shown_on(stream: TextIO) -> AbstractContextManager[object]:
    """Within the block, what is printed goes to this stream as a terminal may be shown it."""
    return redirect_stdout(cast(TextIO, _Shown(stream)))
