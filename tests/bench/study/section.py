"""A section of the report: text, tables and charts in order of addition; each table and chart has a CSV."""
import dataclasses

import measuring

PICTURES_A_LINE = 3  # in the docs


@dataclasses.dataclass
class Item:
    """kind: "text", "table" or "chart". rows[0]: header on the page; data[0]: header of the CSV."""

    kind: str
    name: str = ""
    text: str = ""  # the text, or the caption
    rows: list = dataclasses.field(default_factory=list)
    data: list = dataclasses.field(default_factory=list)
    svg: str = ""
    command: str = ""
    in_docs: bool = False


class Section:
    def __init__(self, name, title, command):
        """name: for file names and --only; command: reproduces this section."""
        self.name, self.title, self.command = name, title, command
        self.items, self.findings = [], []

    def say(self, text):
        """Adds a paragraph, composed from the measured numbers."""
        self.items.append(Item("text", text=text))

    def conclude(self, text):
        """Adds a sentence that the summary at the top of the report repeats."""
        self.findings.append(text)
        self.say(text)

    def add_table(self, name, rows, caption, data=None, command=None, in_docs=False):
        """rows: as shown, rows[0] is the header; data: for the CSV, all digits (default: rows); in_docs: also on the page in the docs."""
        self.items.append(
            Item(
                "table",
                name,
                caption,
                [list(map(str, row)) for row in rows],
                [list(row) for row in data or rows],
                command=command or self.command,
                in_docs=in_docs,
            )
        )

    def add_chart(self, name, svg, caption, rows, command=None):
        """rows: plotted data for the CSV, rows[0] is the header."""
        self.items.append(Item("chart", name, caption, data=[list(row) for row in rows], svg=svg, command=command or self.command))

    def file_name(self, item, ending):
        return f"{self.name}-{item.name}.{ending}"

    def to_markdown(self, find_picture=lambda name: name):
        """Markdown lines of the section; find_picture: maps a picture's name to its path on the page."""
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

    def to_short_markdown(self, find_picture):
        """The page in the docs: findings, pictures, and the tables that it has, too."""
        lines = [*(f"- {finding}" for finding in self.findings), ""]
        pictures = [f"![{item.text}]({find_picture(self.file_name(item, 'svg'))})" for item in self.items if item.kind == "chart"]
        for first in range(0, len(pictures), PICTURES_A_LINE):
            lines.append(" ".join(pictures[first : first + PICTURES_A_LINE]))
        for item in self.items:
            if item.in_docs:
                lines += ["", item.text, "", *measuring.format_table(item.rows, True).splitlines()]
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
    """Inverse of to_json()."""
    section = Section(value["name"], value["title"], value["command"])
    section.findings = value["findings"]
    section.items = [Item(**item) for item in value["items"]]
    return section
