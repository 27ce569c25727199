"""The error of the package, which compiled code raises too."""


class ArgumentError(ValueError):
    """An argument has a value that is not allowed: the error of all classes and functions. The
    message is one line.
    """

    def __init__(self, message: str):
        super().__init__(shorten(" ".join(message.split()), 300))


def shorten(text: str, longest: int) -> str:
    """Replace the middle of a long text by dots."""
    if len(text) <= longest:
        return text
    part = (longest - 3) // 2
    return f"{text[:part]}...{text[-part:]}"
