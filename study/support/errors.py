"""The one exception a user may see: a sentence that names the file, the value and what would be right."""

from collections.abc import Generator
from contextlib import contextmanager


class StudyError(Exception):
    """Input that cannot be used, or a run that cannot be completed; the command line prints it and exits with 2."""


class DivergenceError(StudyError):
    """A simulation left the range of finite numbers.

    Attributes
    ----------
    time : float
        Time in seconds at which the first non-finite sample stands.
    """

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
    """Refuse what does not hold.

    Raises
    ------
    StudyError
        With the sentence, which says what was given and what would be right.
    """
    if not holds:
        raise StudyError(sentence)
