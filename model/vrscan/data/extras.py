"""Libraries that only some of the package needs, and what to install where one is missing.

A detector needs numpy and pydantic alone. All else comes with an extra of the package, as in
``pip install "vrscan[scene]"``, and is imported by what uses it, so its absence shows only there.
"""

import contextlib
from collections.abc import Iterator

from vrscan.data.errors import InputError

# The names by which libraries are imported, and what pip has to be told.
BRINGS = {
    "PIL": "vrscan[scene]",
    "bokeh": "vrscan[view]",
    "dask": "vrscan[study]",
    "distributed": "vrscan[study]",
    "embreex": "vrscan[scene]",
    "filelock": "vrscan[sim]",
    "jinja2": "vrscan[study]",
    "laspy": "vrscan[formats]",
    "lazrs": "vrscan[formats]",
    "loky": "vrscan[scene]",
    "matplotlib": "vrscan[study]",
    "mcap": "vrscan[formats]",
    "mcap_ros2": "vrscan[formats]",
    "pandas": "vrscan[scene]",
    "platformdirs": "vrscan[sim]",
    "pvlib": "vrscan[scene]",
    "pye57": "vrscan[formats]",
    "rerun": "vrscan[rerun]",
    "rich": "vrscan[cli]",
    "scipy": "vrscan[scene]",
    "serial": "vrscan[link]",
    "tornado": "vrscan[view]",
    "trimesh": "vrscan[scene]",
    "typer": "vrscan[cli]",
}


class MissingError(InputError, ImportError):
    """A library is not installed; the text is one line that says how to install it."""


def missing(what: str, brings: str) -> MissingError:
    """Return the error of something that is not installed.

    Args:
        what: Its name, for the message.
        brings: What pip has to be told to install.
    """
    return MissingError(f'{what} is missing: pip install "{brings}"')


@contextlib.contextmanager
def named() -> Iterator[None]:
    """Turn the failed import of a library of ``BRINGS`` into the line that says what to install.

    Raises:
        MissingError: instead of the ``ModuleNotFoundError``.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in BRINGS:
            raise
        raise missing(library, BRINGS[library]) from error
