"""Tables that are kept: the same arrays again, and none of a file that is not to be trusted."""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from vrscan.data import kept as module
from vrscan.data.kept import Array, kept

NAMES = ("squares", "one")
CALLS: list[float] = []


def _made(scale: float) -> dict[str, Array]:
    CALLS.append(scale)
    squares = scale * np.arange(50_000, dtype=np.float32) ** 2
    return {"squares": squares, "one": np.array(scale)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    found = tmp_path / "tables"
    monkeypatch.setattr(module, "_folder", lambda: found)
    CALLS.clear()
    return found


def same(first: dict[str, Array], second: dict[str, Array]) -> bool:
    return all(
        first[name].dtype == second[name].dtype and np.array_equal(first[name], second[name])
        for name in NAMES
    )


def test_what_is_kept_is_not_made_again(folder: Path) -> None:
    first = kept(_made, 3.0, names=NAMES)
    assert same(kept(_made, 3.0, names=NAMES), first) and CALLS == [3.0]
    kept(_made, 4.0, names=NAMES)
    assert CALLS == [3.0, 4.0] and len(list(folder.iterdir())) == 2
    assert all(file.stat().st_mode & 0o077 == 0 for file in folder.iterdir())


def test_another_code_makes_it_anew(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(_made, 3.0, names=NAMES)
    monkeypatch.setattr(module, "_code", lambda _: "another version of this file")
    kept(_made, 3.0, names=NAMES)
    assert CALLS == [3.0, 3.0]


def _flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def _cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def _empty(file: Path) -> None:
    file.write_bytes(b"")


def _open_to_all(file: Path) -> None:
    np.savez(file, squares=np.zeros(1), one=np.zeros(1))
    file.chmod(0o666)


def _nameless(file: Path) -> None:
    np.savez(file, squares=np.zeros(1))


class Trap:
    """An object whose unpickling leaves a trace."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, ("trapped",)


def _pickled(file: Path) -> None:
    np.savez(file, squares=np.array([Trap()], dtype=object), one=np.zeros(1), allow_pickle=True)


def _bare_pickle(file: Path) -> None:
    file.write_bytes(pickle.dumps(Trap()))


def _link(file: Path) -> None:
    other = file.with_name("other")
    np.savez(other.open("wb"), squares=np.zeros(1), one=np.zeros(1))
    file.unlink()
    file.symlink_to(other)


@pytest.mark.parametrize(
    "spoil",
    [_flip, _cut, _empty, _open_to_all, _nameless, _pickled, _bare_pickle, _link],
    ids=lambda each: each.__name__.strip("_"),
)
def test_a_spoilt_file_is_made_anew(
    folder: Path, spoil: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder.parent)
    wanted = kept(_made, 3.0, names=NAMES)
    (file,) = folder.iterdir()
    spoil(file)
    assert same(kept(_made, 3.0, names=NAMES), wanted)
    assert CALLS == [3.0, 3.0] and not Path("trapped").exists()
    # The file is whole again.
    assert same(kept(_made, 3.0, names=NAMES), wanted) and CALLS == [3.0, 3.0]


def test_another_users_file_is_not_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(_made, 3.0, names=NAMES)
    own = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)
    kept(_made, 3.0, names=NAMES)
    assert CALLS == [3.0, 3.0]


def test_without_a_folder_all_is_made(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.write_text("no folder")
    wanted = kept(_made, 3.0, names=NAMES)
    monkeypatch.setattr(module, "_folder", lambda: None)
    assert same(kept(_made, 3.0, names=NAMES), wanted) and CALLS == [3.0, 3.0]


def test_the_oldest_go(folder: Path) -> None:
    for k in range(module._MOST + 3):
        kept(_made, float(k), names=NAMES)
    assert len(list(folder.iterdir())) == module._MOST


def test_a_process_takes_the_light_of_another(tmp_path: Path) -> None:
    """Cold it tabulates, warm it reads, and the tables are the same to the last bit."""
    code = (
        "import hashlib\n"
        "from vrscan.scene import beam, image, row_profile\n"
        "made = []\n"
        "transform = row_profile.stop_transform\n"
        "def counted(*arguments):\n"
        "    made.append(1)\n"
        "    return transform(*arguments)\n"
        "row_profile.stop_transform = counted\n"
        "cut = beam.cut(beam.Laser())\n"
        "parts = [*image._slices(), *(v for v in vars(cut).values() if hasattr(v, 'tobytes'))]\n"
        "print(len(made) > 0, hashlib.sha256(b''.join(p.tobytes() for p in parts)).hexdigest())\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    cold, warm = (
        subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for _ in range(2)
    )
    assert (cold[0], warm[0]) == ("True", "False")
    assert cold[1] == warm[1]
