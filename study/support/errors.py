"""The one exception a user may see: a sentence that names the file, the value and what would be right."""


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
