"""The page docs/hard-cases.md: the catalogue, its outcomes, and errors without a warning."""

from collections.abc import Callable, Iterator

from vrscan.engines.tools import repository_root
from vrscan.study.cases.case import UNNOTICED_PX, Case, LineCase, Outcome
from vrscan.study.cases.case_errors import number
from vrscan.study.cases.registry import WINDOWS, rooms

PAGE = "docs/hard-cases.md"
MODES = {"threshold": "one pass", "two_pass": "two passes"}
HEADINGS = (
    "case", "what breaks", "defined result", "flags", "error here",
    "equations as printed, float64", "RTL",
)  # fmt: skip

_HEAD = f"""# Hard cases

What the chain does where a line, a number or a clock is at its worst. Each row is a test: its lines
go through the model, which must do what the row says, and through the RTL, which must give the same
bits; a row of one module names the test of its RTL. `vrscan cases --write` makes this page from
`model/vrscan/study/cases`; `tb/study/cases/test_cases.py` fails when it is stale.

- *Defined result*, *flags* and *error here* are those of the shipped configuration, one pass, and
  the error is the largest over the row's lines; what `window = "two_pass"` makes of them stands
  behind it where it differs.
  An error is *off without a warning* where it is more than {UNNOTICED_PX} px and four of its own
  sigmas, and none of AT_EDGE, SATURATED, RIVAL and ROW_STATISTICS is up.
- *As printed* are the paper's equations in float64 on the same lines, with nothing to catch what
  they leave undefined: the row's mean and deviation, a threshold one deviation above the mean, S/N
  of at least 2, (8) with T = N - 1 on raw pixels, (5) even, (3) and (4) with their tangents; for
  counters and times, numbers that do not wrap.
- *RTL* is the elaboration, LineLength x PixelWidth, or the module's test.
"""


def measure(progress: Callable[[int], None] | None = None) -> dict[str, list[Outcome]]:
    """Return the outcomes of every entry, one for each mode of the window, by its name.

    Args:
        progress: Called with the number of entries done so far.
    """
    outcomes: dict[str, list[Outcome]] = {}
    for cases in rooms().values():
        for case in cases:
            modes = WINDOWS if isinstance(case, LineCase) else WINDOWS[:1]
            outcomes[case.name] = [case.outcome(mode) for mode in modes]
            if progress is not None:
                progress(len(outcomes))
    return outcomes


def _each(texts: list[str]) -> str:
    """Return the texts for every mode of the window; one text where they are equal."""
    if len(set(texts)) == 1:
        return texts[0]
    names = [MODES[mode] for mode in WINDOWS]
    others = (f"{name}: {text}" for name, text in zip(names[1:], texts[1:], strict=True))
    return "; ".join([texts[0], *others])


def _here(outcome: Outcome) -> str:
    """Return the error, and whether a flag warns of it."""
    if not outcome.unnoticed:
        return outcome.here
    return f"{outcome.here}, **off without a warning** ({len(outcome.unnoticed)})"


def _proof(case: Case) -> str:
    if isinstance(case, LineCase):
        return "{} x {}".format(*case.build)
    files = dict.fromkeys(test.split("::")[0] for test in case.rtl)
    tb = repository_root() / "tb"
    places = [next(tb.rglob(file)).relative_to(tb) for file in files]
    return ", ".join(f"[{place.stem}](../tb/{place})" for place in places)


def cells(case: Case, outcomes: list[Outcome]) -> tuple[str, ...]:
    """Return an entry's row."""
    return (
        case.name,
        case.breaks,
        case.defined,
        _each([outcome.flags for outcome in outcomes]),
        _each([_here(outcome) for outcome in outcomes]),
        outcomes[0].printed,
        _proof(case),
    )


def _row(texts: tuple[str, ...]) -> str:
    return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"


def _unnoticed(outcomes: dict[str, list[Outcome]]) -> Iterator[str]:
    """Return the rows of the errors without a warning, the largest first."""
    rows = []
    for cases in rooms().values():
        for case in cases:
            found = outcomes[case.name]
            if not any(outcome.unnoticed for outcome in found):
                continue
            worst = [max(outcome.unnoticed, default=0.0) for outcome in found]
            rows.append((max(worst), case, worst))
    for _, case, worst in sorted(rows, key=lambda row: -row[0]):
        yield _row((case.name, *(number(w, "px") if w else "-" for w in worst), case.breaks))


def page(outcomes: dict[str, list[Outcome]]) -> str:
    """Return the page."""
    parts = [_HEAD]
    for title, cases in rooms().items():
        table = [_row(HEADINGS), "|" + "---|" * len(HEADINGS)]
        table += [_row(cells(case, outcomes[case.name])) for case in cases]
        parts.append(f"## {title}\n\n" + "\n".join(table) + "\n")
    rows = list(_unnoticed(outcomes))
    if rows:
        modes = [MODES[mode] for mode in WINDOWS]
        table = [_row(("case", *modes, "what breaks")), "|" + "---|" * (len(modes) + 2), *rows]
        parts.append(
            "## Off without a warning\n\nThe farthest first, by the window's mode. None of these "
            "lines raises a flag that would tell a consumer.\n\n" + "\n".join(table) + "\n"
        )
    return "\n".join(parts)
