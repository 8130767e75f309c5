"""Reads jobs and other JSON files."""
import json
import os
import pathlib
import re
import stat

from errors import InputError

MAX_BYTES = 16 << 20


def read_text(path, what, remedy):
    """The text of a regular file of limited size. InputError with the remedy."""
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: not a regular file; {remedy}")
        if status.st_size > MAX_BYTES:
            raise InputError(f"{path}: a {what} of {status.st_size} bytes; at most {MAX_BYTES} are read")
        return pathlib.Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot read the {what}: {error}; {remedy}") from None


def parse(text, path, remedy):
    """Parses JSON. InputError with the line."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}: not valid JSON: {error.msg}; {remedy}") from None
    except (ValueError, RecursionError) as error:  # e.g. thousands of digits or brackets
        raise InputError(f"{path}: not valid JSON: {error}; {remedy}") from None


def read_job(path):
    """The object of a job. Its content is checked by carillon-precompute."""
    remedy = "give a job of carillon-precompute"
    job = parse(strip_comments(read_text(path, "job", remedy)), path, remedy)
    if not isinstance(job, dict):
        raise InputError(f"{path}: a job is a JSON object")
    return job


def strip_comments(text):
    """Removes // comments outside strings."""
    return re.sub(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*', lambda match: match.group(1) or "", text)
