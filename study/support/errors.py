"""The one exception a user may see: a sentence that names the file, the value and what was expected."""

from collections.abc import Generator
from contextlib import contextmanager


class StudyError(Exception):
    """Input that cannot be used, or a run that cannot be completed; the command line prints it and exits with 2."""


class DivergenceError(StudyError):
    """A simulation left the range of finite numbers; ``time`` is that of its first non-finite sample in seconds."""

    def __init__(self, message: str, time: float) -> None:
        super().__init__(message)
        self.time = time


@contextmanager
def at(where: object) -> Generator[None, None, None]:
    """Begin the sentence of a fault with the place where its value stands."""
    try:
        yield
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None


def expect(holds: object, sentence: str) -> None:
    """Refuse what does not hold, with a sentence that says what was given and what was expected."""
    if not holds:
        raise StudyError(sentence)
