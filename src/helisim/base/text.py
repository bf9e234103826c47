"""Text from files and people for messages: short, without control characters."""

SHOWN = 80  # characters of a quoted text


def shown(item: object, limit: int = SHOWN) -> str:
    """Return a text, or a `repr`, without control characters, at most `limit` (8 or more) long."""
    text = item if isinstance(item, str) else repr(item)
    if not text.isprintable():
        text = "".join(c if c.isprintable() else " " * c.isspace() for c in text)
    if len(text) <= limit:
        return text
    tail = (limit - 5) // 3
    return f"{text[: limit - 5 - tail]} ... {text[len(text) - tail :]}"


def single_line(text: str) -> str:
    """Return a message without line breaks."""
    return " ".join(text.splitlines())
