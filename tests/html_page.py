"""A page as its tables, figures and addresses."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """The cells of each row, the figures and the addresses of a page, every element closed."""

    EMPTY = ("meta", "link", "br", "img")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.figures: list[str] = []
        self.addresses: list[str] = []
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.seen.add(tag)
        if tag not in self.EMPTY:
            self.open.append(tag)
        if tag == "figure":
            self.figures.append(given["id"])
        self.addresses += [given[name] for name in ("src", "href") if name in given]
        assert not any(name.startswith("on") for name in given)  # no handler runs
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.seen.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data
