"""Reports of the scripts that measure: a JSON text on standard output, and in a file if one is named."""

import argparse
import json
import sys
from pathlib import Path


def report_parser(description: str) -> argparse.ArgumentParser:
    """A parser of the arguments of a script that measures, with the option -o FILE. description: its docstring."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the report to this JSON file, too")
    return parser


def write_report(report: dict, output: Path | None) -> None:
    """Prints a report as JSON and writes it to the file `output` if there is one."""
    text = json.dumps(report, indent=2) + "\n"
    sys.stdout.write(text)
    if output:
        output.write_text(text)
