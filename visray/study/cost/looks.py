"""How the page of a report of costs looks: its style, its tables, and the script that sorts them."""

import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from math import isfinite
from typing import Any

CSS = """
:root { color-scheme: light dark; --ink: #1d2127; --soft: #5c6570; --paper: #fff; --line: #dfe3e8; --mark: #fff3b8;
  --today: #dcebfa; --shade: #0004 }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e8eb; --soft: #a2abb5; --paper: #16191d; --line: #363c44; --mark: #4d430f;
    --today: #17324d; --shade: #000c }
}
body { font: 16px/1.55 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 2.5rem auto 5rem;
  max-width: 960px; padding: 0 1.2rem; overflow-wrap: anywhere }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 } h2 { font-size: 1.25rem; margin: 3rem 0 .6rem }
.soft, figcaption { color: var(--soft); font-size: .9rem } .lead { font-size: 1.1rem }
.warn { border-left: 4px solid #D55E00; padding: .3rem 1rem }
figure { margin: 1.5rem 0 } figure svg { width: 100%; height: auto; background: #fff; border-radius: 6px }
.scroll { overflow: auto; max-height: 85vh; border: 1px solid var(--line); border-width: 0 1px 1px;
  background: linear-gradient(to right, var(--paper) 24px, transparent) left, linear-gradient(to left,
  var(--paper) 24px, transparent) right, linear-gradient(to right, var(--shade), transparent) left,
  linear-gradient(to left, var(--shade), transparent) right; background-repeat: no-repeat;
  background-size: 48px 100%, 48px 100%, 16px 100%, 16px 100%; background-attachment: local, local, scroll, scroll }
.scroll::-webkit-scrollbar { width: 10px; height: 10px }
.scroll::-webkit-scrollbar-thumb { background: var(--soft); border-radius: 5px }
.scroll::-webkit-scrollbar-corner, .scroll::-webkit-scrollbar-track { background: var(--line) }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; overflow-wrap: normal }
.note { margin: 0 0 .4rem } thead th { position: sticky; top: 0; background: var(--paper) }
th, td { text-align: left; vertical-align: top; padding: .3rem .5rem; border-bottom: 1px solid var(--line) }
tbody th { position: sticky; left: 0; background: var(--paper) }
th { font-weight: 600 } .n { white-space: nowrap } .turned { font-weight: 600; background: var(--mark) }
tbody tr.today > * { background: var(--today) }
th button { font: inherit; color: inherit; background: none; border: 0; padding: 0; text-align: left; cursor: pointer }
th[aria-sort=ascending] button::after { content: " ↑" } th[aria-sort=descending] button::after { content: " ↓" }
dt { font-weight: 600 } dd { margin: 0 0 .6rem }
"""
TODAY = ' class="today"'
# Columns are sorted by the number of a cell where it has one, else by its text; what has none goes last.
SORT = """
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  const key = (row, i) => { const c = row.cells[i], k = c.dataset.key; return k === undefined ? c.innerText : +k; };
  const order = (a, b) => typeof a === typeof b ? (a > b) - (a < b) : typeof a === "number" ? -1 : 1;
  heads.forEach((head, i) => {
    const button = document.createElement("button");
    button.append(...head.childNodes);
    head.append(button);
    button.onclick = () => {
      const sign = head.ariaSort === "ascending" ? -1 : 1;
      heads.forEach(h => h.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      body.append(...[...body.rows].sort((a, b) => sign * order(key(a, i), key(b, i))));
    };
  });
}
"""


def document(title: str, body: str) -> str:
    """A whole HTML page, of a title as text and a body as HTML."""
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    shown = f"<body><main>{body}</main><script>{SORT}</script></body>"
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{CSS}</style></head>{shown}</html>\n'


def cell(text: Any, key: float | None = None, turned: bool = False, head: bool = False) -> str:
    """A cell of a table; key: the number that it is sorted by."""
    text = str(text)
    # What is short stays on one line; settings may be long.
    kinds = " ".join(["n"] * (len(text) < 26) + ["turned"] * turned)
    marks = (f' class="{kinds}"' if kinds else "") + (
        f' data-key="{key:.9g}"' if key is not None and isfinite(key) else ""
    )
    return f'<th scope="row"{marks}>{escape(text)}</th>' if head else f"<td{marks}>{escape(text)}</td>"


def table(caption: str, heads: Iterable[str], rows: Iterable[tuple[Sequence[str], bool]], kind: str = "") -> str:
    """A table; its rows are of cells, and today's default or not."""
    top = "".join(f'<th scope="col">{escape(h)}</th>' for h in heads)
    body = "".join(f"<tr{TODAY if today else ''}>{''.join(cells)}</tr>" for cells, today in rows)
    # Above what scrolls, not in it: there a caption is as wide as the table, and cut off where that is.
    name = f"t{hashlib.sha256(caption.encode()).hexdigest()[:8]}"
    note = f'<p class="soft note" id="{name}">{escape(caption)}</p>'
    # What scrolls must be reached by keyboard too.
    scroll = f'<div class="scroll" role="region" aria-labelledby="{name}" tabindex="0">'
    shown = f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody>"
    return f'{note}{scroll}<table class="{kind}" aria-describedby="{name}">{shown}</table></div>'
