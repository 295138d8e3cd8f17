"""Elements of an HTML page without network access and scripts: style, tables and embedded pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from rso_lidar.picture.style.palette import LIGHT, Scheme
from rso_lidar.picture.style.recolour import recolour

_DOTS = 90  # of a picture [dots per inch]

_STYLE = """

body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: var(--ink); background: var(--paper);
  max-width: 72rem; margin: 2rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .5rem; border-bottom: 1px solid var(--rule); }
h3 { font-size: 1rem; margin: 1.4rem 0 .3rem; }
p.quiet, figcaption { color: var(--quiet); font-size: .9rem; margin: .2rem 0; }
table { border-collapse: collapse; font-size: .88rem; margin: .4rem 0; display: block; overflow-x: auto; }
th, td { text-align: left; padding: .22rem .7rem .22rem 0; border-bottom: 1px solid var(--grid); vertical-align: top; }
th { color: var(--quiet); font-weight: 600; vertical-align: bottom; max-width: 9rem; }
th code { white-space: nowrap; }
td.n { white-space: nowrap; } td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; height: auto; } figure { margin: 1rem 0; }
pre { background: var(--shade); padding: .7rem .9rem; overflow-x: auto; font-size: .82rem; line-height: 1.35; }
code { font-size: .92em; } figcaption code { overflow-wrap: anywhere; } details { margin: .4rem 0; }
summary { cursor: pointer; color: var(--quiet); }
@media print { details { display: none; } h2 { break-after: avoid; } figure { break-inside: avoid; } }
"""


def write_table(heads: Sequence[tuple[str, bool]], rows: Iterable[Sequence[str]]) -> str:
    """Write an HTML table from cells that are HTML already.

    Parameters
    ----------
    heads : word (HTML) of each column, and whether it holds numbers, which are set to the right
    rows : cells (HTML) of each row, as many as there are heads

    Returns
    -------
    str
        A ``<table>`` element.
    """
    kinds = [' class="n"' if number else "" for _, number in heads]
    top = "".join(f"<th{kind}>{word}</th>" for (word, _), kind in zip(heads, kinds, strict=True))
    lines = (
        "<tr>" + "".join(f"<td{kind}>{cell}</td>" for cell, kind in zip(row, kinds, strict=True)) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{top}</tr></thead><tbody>{''.join(lines)}</tbody></table>"


def embed_figure(figure: Any, text: str, caption: str = "", scheme: Scheme = LIGHT) -> str:
    """Embed a figure as a picture.

    Parameters
    ----------
    scheme : `LIGHT` or `DARK`, that of the page; the figure keeps its colours

    Returns
    -------
    str
        A ``<figure>`` element that holds the picture as PNG.
    """
    recolour(figure, scheme)
    with io.BytesIO() as held:
        figure.savefig(held, format="png", dpi=_DOTS)
        coded = base64.b64encode(held.getvalue()).decode()
    under = f"<figcaption>{caption}</figcaption>" if caption else ""
    return f'<figure><img alt="{escape(text)}" src="data:image/png;base64,{coded}">{under}</figure>'


def write_page(title: str, body: Iterable[str], scheme: Scheme = LIGHT) -> str:
    """Write a page.

    Parameters
    ----------
    scheme : `LIGHT` or `DARK`

    Returns
    -------
    str
        A document that needs no other file.
    """
    roles = {name: getattr(scheme, name) for name in ("paper", "ink", "quiet", "rule", "grid", "shade")}
    colours = "".join(f" --{name}: {colour};" for name, colour in roles.items())
    root = f":root {{ color-scheme: {'light' if scheme == LIGHT else 'dark'};{colours} }}"
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{root}{_STYLE}</style></head>\n<body>\n'
        + "\n".join(body)
        + "\n</body></html>\n"
    )
