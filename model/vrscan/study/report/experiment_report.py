"""The results of the virtual experiment beside the paper's and beside what they have to be."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table as RichTable

# Name in results.json: what it is, the paper's figure, and the limit, above which it is missed.
LIMITS = {
    "coarse_mean_mm": ("coarse: mean absolute error in z on the relief, mm", "0.30", 0.15),
    "plane_percent": ("planes, mean of 60 periods over the field, % of range", "0.2", 0.05),
    "points_percent_rms": ("single points, rms, % of range", "-", 0.1),
    "drift_urad": ("angle after a drift of the mirror, urad rms", "-", 20.0),
    "index_mrad": ("index mark, mrad", "0.06", 0.01),
    "pitch_mm": ("pitch of the bolt, mm", "5", 0.02),
    "bust_points": ("points of the bust, one pan", "280966", 280_966.0),
}


def passes(name: str, value: float) -> bool:
    """Return whether a result keeps its limit; the pitch's is a distance from 5 mm."""
    limit = LIMITS[name][2]
    if name == "pitch_mm":
        return abs(value - 5.0) <= limit
    return value >= limit if name == "bust_points" else value <= limit


def table(found: Mapping[str, Any]) -> RichTable:
    """Return the results as a table."""
    shown = RichTable(title=f"Virtual experiment, seed {found['seed']}")
    for heading in ("result", "paper", "limit", "here", ""):
        shown.add_column(heading, justify="left" if heading == "result" else "right")
    for name, (what, paper, limit) in LIMITS.items():
        value = float(found[name])
        wanted = "5.00 +- 0.02" if name == "pitch_mm" else f"{limit:g}"
        mark = "ok" if passes(name, value) else "missed"
        shown.add_row(what, paper, wanted, f"{value:.4g}" if value < 1e4 else f"{value:.0f}", mark)
    return shown


def planes(rows: Sequence[Mapping[str, Any]]) -> RichTable:
    """Return the errors of planes as a table."""
    shown = RichTable(title="Planes")
    columns = {
        "z_mm": ("z, mm", "{:g}"),
        "focus_mm": ("focus, mm", "{:.1f}"),
        "count": ("points", "{}"),
        "mean_mm": ("mean error, mm", "{:+.4f}"),
        "overlaid_mm": ("periods overlaid, mm", "{:.4f}"),
        "plane_percent": ("over the field, %", "{:.4f}"),
        "points_percent": ("points rms, %", "{:.4f}"),
        "width_mm": ("width, mm", "{:.0f}"),
    }
    for heading, _ in columns.values():
        shown.add_column(heading, justify="right")
    for row in rows:
        shown.add_row(*(form.format(row[name]) for name, (_, form) in columns.items()))
    return shown
