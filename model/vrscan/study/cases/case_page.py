"""The page docs/hard-cases.md: the catalogue, its outcomes, and errors without a warning."""

from collections.abc import Sequence
from pathlib import Path

from vrscan.engines.tools import installed, repository_root
from vrscan.show.sheet import Column, Sheet, block_of, words
from vrscan.study.cases.case import UNNOTICED_PX, WINDOWS, Case, LineCase, Outcome
from vrscan.study.cases.case_errors import number
from vrscan.study.cases.registry import rooms
from vrscan.study.progress import Progress

PAGE = "docs/hard-cases.md"
ATTACK = "attack"  # the block of the page that another command makes
OFF = "off without a warning"
MODES = {"fit": "fit", "threshold": "one window"}
_HEAD = f"""# Hard cases

What the chain does where a line, a number or a clock is at its worst. Each row is a test: its lines
go through the model, which must do what the row says, and through the RTL, which must give the same
bits; a row of one module names the test of its RTL. `vrscan cases --write` makes this page from
`model/vrscan/study/cases`; `tb/study/cases/test_cases.py` fails when it is stale.

- *Defined result*, *flags* and *error here* are those of the shipped configuration, which fits a
  Gaussian, and the error is the largest over the row's lines; what `window = "threshold"`, the
  paper's one window, makes of them stands behind it where it differs. A spot that is no Gaussian is
  not fitted, and has the position that (8) gives in the second window. A row that says *one window*
  first is about (8) in the one window, and is tried with this alone. What is so *to a step* with
  one window may be off by 0.01 px with a fit.
  An error is *off without a warning* where it is more than {UNNOTICED_PX} px and four of its own
  sigmas, and none of AT_EDGE, SATURATED, RIVAL, ROW_STATISTICS and MIXED is up.
- *As printed* are the paper's equations in float64 on the same lines, with nothing to catch what
  they leave undefined: the row's mean and deviation, a threshold one deviation above the mean, S/N
  of at least 2, (8) with T = N - 1 on raw pixels, (5) even, (3) and (4) with their tangents; for
  counters and times, numbers that do not wrap.
- *RTL* is the elaboration, LineLength x PixelWidth, or the module's test.
"""


def measure(progress: Progress | None = None) -> dict[str, list[Outcome]]:
    """Return the outcomes of every entry, one for each of its windows, by its name.

    Args:
        progress: Called with the number of entries done so far.
    """
    outcomes: dict[str, list[Outcome]] = {}
    for cases in rooms().values():
        for case in cases:
            outcomes[case.name] = [case.outcome(mode) for mode in case.modes]
            if progress is not None:
                progress(len(outcomes))
    return outcomes


def _each(texts: list[str]) -> str:
    """Return the texts for every window; one text where they are equal."""
    if len(set(texts)) == 1:
        return texts[0]
    names = [MODES[mode] for mode in WINDOWS]
    others = (f"{name}: {text}" for name, text in zip(names[1:], texts[1:], strict=True))
    return "; ".join([texts[0], *others])


def _here(outcome: Outcome) -> str:
    """Return the error, and whether a flag warns of it."""
    if not outcome.unnoticed:
        return outcome.here
    return f"{outcome.here}, {OFF} ({len(outcome.unnoticed)})"


def _defined(case: Case) -> str:
    """Return the definition, behind the window if it is about one that is not shipped."""
    alone = case.modes[0] != WINDOWS[0]
    return f"{MODES[case.modes[0]]}: {case.defined}" if alone else case.defined


def _proof(case: Case) -> str:
    if isinstance(case, LineCase):
        return "{} x {}".format(*case.build)
    files = dict.fromkeys(test.split("::")[0] for test in case.rtl)
    if installed():  # without the tests
        return ", ".join(Path(file).stem for file in files)
    tb = repository_root() / "tb"
    places = [next(tb.rglob(file)).relative_to(tb) for file in files]
    return ", ".join(f"[{place.stem}](../tb/{place})" for place in places)


def sheet(cases: Sequence[Case], outcomes: dict[str, list[Outcome]]) -> Sheet[Case]:
    """Return entries as a table."""

    def first(case: Case) -> Outcome:
        return outcomes[case.name][0]

    columns: list[Column[Case]] = [
        words("case", lambda case: case.name),
        words("what breaks", lambda case: case.breaks, wraps=True),
        words("defined result", _defined, wraps=True),
        words("flags", lambda case: _each([o.flags for o in outcomes[case.name]]), wraps=True),
        words(
            "error here", lambda case: _each([_here(o) for o in outcomes[case.name]]), wraps=True
        ),
        words("equations as printed, float64", lambda case: first(case).printed, wraps=True),
        words("RTL", _proof),
    ]
    return Sheet(columns, cases)


def _worst(case: Case, outcomes: dict[str, list[Outcome]], window: str) -> float:
    """Return the largest error without a warning in one window, px; 0 if there is none."""
    found = dict(zip(case.modes, outcomes[case.name], strict=True))
    return max(found[window].unnoticed, default=0.0) if window in found else 0.0


def _beside(case: Case, outcomes: dict[str, list[Outcome]]) -> str:
    """Return what the shipped window makes of lines that are off in the other one."""
    shown = WINDOWS[0] in case.modes  # else it is a statement on one window, and tried with that
    shipped = outcomes[case.name][0] if shown else case.outcome(WINDOWS[0])
    return f"{_here(shipped)}, {'not off' if shipped.flags == 'none' else shipped.flags}"


def _off(outcomes: dict[str, list[Outcome]]) -> str:
    """Return the part on what is off without a warning, the farthest first."""
    shipped, other = WINDOWS

    def listed(window: str, rest: Sequence[Column[Case]]) -> str:
        """Return those off in ``window``, with the error there and more columns."""

        def worst(case: Case) -> float:
            return _worst(case, outcomes, window)

        rows = [case for cases in rooms().values() for case in cases if worst(case)]
        if window == other:
            rows = [case for case in rows if not _worst(case, outcomes, shipped)]
        columns = [
            words("case", lambda case: case.name),
            words(MODES[window], lambda case: number(worst(case), "px")),
            *rest,
        ]
        return Sheet(columns, sorted(rows, key=lambda case: -worst(case))).markdown()

    breaks: Column[Case] = words("what breaks", lambda case: case.breaks)
    untold: Column[Case] = words("why no detector could know", lambda case: case.untold)
    beside: Column[Case] = words("with the fit", lambda case: _beside(case, outcomes))
    return (
        "## Off without a warning\n\nThe farthest first. With the shipped fit, these lines raise "
        f"no flag that would tell a consumer:\n\n{listed(shipped, [breaks, untold])}\n\n"
        "These are of the mode *one window* only: the fit is not off there, or has a flag that "
        f"tells:\n\n{listed(other, [beside, breaks])}\n"
    )


def page(outcomes: dict[str, list[Outcome]], before: str = "") -> str:
    """Return the page.

    Args:
        outcomes: The outcomes of every entry.
        before: The page as it was; what ``vrscan bench attack`` wrote there stays.
    """
    parts = [_HEAD]
    for title, cases in rooms().items():
        table = sheet(cases, outcomes).markdown().replace(OFF, f"**{OFF}**")
        parts.append(f"## {title}\n\n{table}\n")
    text = "\n".join([*parts, _off(outcomes)])
    return f"{text}\n## Under another optics\n\n{block_of(before, ATTACK)}\n"
