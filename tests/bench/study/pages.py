"""Files of the accuracy study: report.md, report.html (pictures embedded), report.json, an SVG and a CSV per chart, a CSV per table."""
import csv
import html
import json
import re

import provenance
from lab import write_whole

STYLE = """body { font: 15px/1.5 sans-serif; max-width: 980px; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; font-size: 13px; }
td, th { border-bottom: 1px solid #ddd; padding: 3px 9px; text-align: right; }
td:first-child, th:first-child { text-align: left; }
pre { background: #f4f4f4; padding: 8px 12px; } figure { margin: 1em 0; } figcaption { color: #555; }
svg { max-width: 100%; height: auto; }
p, li { overflow-wrap: anywhere; } pre, .table { overflow-x: auto; }"""


def write(lab, sections, setting):
    """Writes all files into the lab's folder; returns the path of report.md. setting: command line of the study."""
    files = {}
    for section in sections:
        for item in section.items:
            if item.kind == "chart":
                files[section.file_name(item, "svg")] = item.svg
            if item.kind != "text":
                files[section.file_name(item, "csv")] = format_csv(item.data)
    machine = lab.describe_machine()
    head = ["# What accuracy costs in time", "", f"    {setting}", "", machine, ""]
    findings = [finding for section in sections for finding in section.findings]
    summary = ["## In words", "", *(f"- {finding}" for finding in findings), ""] if findings else []
    files["report.md"] = "\n".join([*head, *summary, *(line for section in sections for line in section.to_markdown())]).rstrip() + "\n"
    files["report.html"] = format_html(sections, setting, machine, findings)
    files["report.json"] = (
        json.dumps(
            {
                "format": 2,
                "measured": provenance.describe(setting),
                "machine": machine,
                "sections": [section.to_json() for section in sections],
            },
            indent=1,
        )
        + "\n"
    )
    for name, text in files.items():
        write_whole(lab.out / name, text)
    return lab.out / "report.md"


def format_csv(rows):
    class Lines(list):
        write = list.append

    lines = Lines()
    table = csv.writer(lines, lineterminator="\n")
    table.writerows([[f"{cell:.10g}" if isinstance(cell, float) else cell for cell in row] for row in rows])
    return "".join(lines)


def to_inline(text):
    """Converts the Markdown subset of the sections: `code`, **bold** and links."""
    text = html.escape(text)
    text = re.sub(r"`([^`]+)`", r"<code>\1</code>", text)
    text = re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", text)
    return re.sub(r"\[([^]]+)\]\(([^)\s]+)\)", r'<a href="\2">\1</a>', text)


def format_html(sections, setting, machine, findings):
    out = [
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><title>What accuracy costs in time</title>',
        f"<style>{STYLE}</style></head><body>",
        "<h1>What accuracy costs in time</h1>",
        f"<pre>{html.escape(setting)}</pre><p>{to_inline(machine)}</p>",
    ]
    if findings:
        out.append("<h2>In words</h2><ul>" + "".join(f"<li>{to_inline(finding)}</li>" for finding in findings) + "</ul>")
    for section in sections:
        out.append(f"<h2>{to_inline(section.title)}</h2>")
        shown = None
        for item in section.items:
            if item.kind == "text":
                out.append(f"<p>{to_inline(item.text)}</p>")
                continue
            if item.kind == "chart" or item.command != shown:
                out.append(f"<pre>{html.escape(item.command)}</pre>")
                shown = item.command
            if item.kind == "chart":
                out.append(f"<figure>{item.svg}<figcaption>{to_inline(item.text)}</figcaption></figure>")
            else:
                head, *rows = item.rows
                out.append(
                    f'<p>{to_inline(item.text)}</p><div class="table"><table><tr>'
                    + "".join(f"<th>{to_inline(cell)}</th>" for cell in head)
                    + "</tr>"
                    + "".join("<tr>" + "".join(f"<td>{to_inline(cell)}</td>" for cell in row) + "</tr>" for row in rows)
                    + "</table></div>"
                )
    return "\n".join(out) + "\n</body></html>\n"
