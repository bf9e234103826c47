"""Text from files and people, as it may stand in a message: short, without control characters."""

SHOWN = 80
"""Characters of a text that a message quotes, unless more are asked for."""


def shown(item: object, limit: int = SHOWN) -> str:
    """Return a text without control characters, its middle left out beyond `limit` characters.

    Args:
        item: a text; of anything else its `repr` is shown.
        limit: characters, 8 or more.
    """
    text = item if isinstance(item, str) else repr(item)
    if not text.isprintable():
        text = "".join(c if c.isprintable() else " " * c.isspace() for c in text)
    if len(text) <= limit:
        return text
    tail = (limit - 5) // 3
    return f"{text[: limit - 5 - tail]} ... {text[len(text) - tail :]}"


def single_line(text: str) -> str:
    """Return a message without line breaks, such as a file's name may hold."""
    return " ".join(text.splitlines())
