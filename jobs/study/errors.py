"""What ends a study early, and with which exit code."""


class InputError(Exception):
    """What the user can mend."""


class RunError(Exception):
    """A run that failed, with its exit code."""

    def __init__(self, code, text):
        super().__init__(text)
        self.code = code
