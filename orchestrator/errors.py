"""What can go wrong, in words for the user."""


class InputError(Exception):
    """The user asked for something that cannot be done; the text says what to change."""
