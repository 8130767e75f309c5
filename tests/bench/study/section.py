"""A section of the report: words, tables and charts in the order in which they were added; each table and chart has a CSV next to it."""
import dataclasses

import measuring


@dataclasses.dataclass
class Item:
    """kind: "text", "table" or "chart". rows[0] is the head of what a page shows, data[0] that of its CSV."""

    kind: str
    name: str = ""
    text: str = ""  # of a text; the caption of the others
    rows: list = dataclasses.field(default_factory=list)
    data: list = dataclasses.field(default_factory=list)
    svg: str = ""
    command: str = ""


class Section:
    def __init__(self, name, title, command):
        """name: a word that file names and --only take; command: the one that makes this section again."""
        self.name, self.title, self.command = name, title, command
        self.items, self.findings = [], []

    def say(self, text):
        """A paragraph. It follows from the numbers: sections make their sentences."""
        self.items.append(Item("text", text=text))

    def conclude(self, text):
        """A sentence that also stands in the summary at the head of the report."""
        self.findings.append(text)
        self.say(text)

    def add_table(self, name, rows, caption, data=None, command=None):
        """rows: what the page shows, rows[0] the head; data: the same for the CSV with all digits (default: rows)."""
        self.items.append(
            Item(
                "table",
                name,
                caption,
                [list(map(str, row)) for row in rows],
                [list(row) for row in data or rows],
                command=command or self.command,
            )
        )

    def add_chart(self, name, svg, caption, rows, command=None):
        """rows: what is drawn, rows[0] the head; it goes into the CSV next to the picture."""
        self.items.append(Item("chart", name, caption, data=[list(row) for row in rows], svg=svg, command=command or self.command))

    def file_name(self, item, ending):
        return f"{self.name}-{item.name}.{ending}"

    def to_markdown(self, find_picture=lambda name: name):
        """The section as lines; find_picture: from a picture's name to its path in the page."""
        lines = [f"## {self.title}", ""]
        shown = None
        for item in self.items:
            if item.kind == "chart" or (item.kind == "table" and item.command != shown):
                lines += [f"    {item.command}", ""]
                shown = item.command
            if item.kind == "text":
                lines += [item.text, ""]
            elif item.kind == "table":
                lines += [item.text, "", *measuring.format_table(item.rows, True).splitlines(), ""]
            else:
                lines += [f"![{item.text}]({find_picture(self.file_name(item, 'svg'))})", "", item.text, ""]
        return lines

    def to_json(self):
        return {
            "name": self.name,
            "title": self.title,
            "command": self.command,
            "findings": self.findings,
            "items": [dataclasses.asdict(item) for item in self.items],
        }


def read_section(value):
    """The opposite of to_json()."""
    section = Section(value["name"], value["title"], value["command"])
    section.findings = value["findings"]
    section.items = [Item(**item) for item in value["items"]]
    return section
