"""What can go wrong, in words for the user."""


class InputError(Exception):
    """The user asked for something that cannot be done; the text says what to change."""


def last_line(text: str, otherwise: str = "no reason given") -> str:
    """The last line of what a child process has said: the reason why it failed."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else otherwise
