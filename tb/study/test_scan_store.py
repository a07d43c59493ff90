"""The parts of a long scan on disk: what is found again, and what is not."""

from pathlib import Path

import pytest
from scanners import SCANNERS

from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine
from vrscan.scene.description import load
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner
from vrscan.study.scan_store import PIECE, Piece, Store, name_of


def test_pieces_come_again_in_their_order_and_of_their_scan_only(tmp_path: Path) -> None:
    folder = tmp_path / "parts"
    store = Store(folder, "one")
    for number in (0, 1, 3):  # without 2, 3 does not count
        store.add(number, Piece([number], state=("after", number)))
    again = Store(folder, "one")
    assert again.blocks == 2 * PIECE
    assert [piece.parts for piece in again.pieces()] == [[0], [1]]
    (folder / f".piece-000002.pickle.{16 * '0'}").write_bytes(b"cut off")
    assert len(list(Store(folder, "one").folder.iterdir())) == 4
    assert Store(folder, "two").blocks == 0
    store.remove()
    assert not folder.exists()


def test_what_is_no_piece_is_one_line_of_an_error(tmp_path: Path) -> None:
    store = Store(tmp_path / "parts", "one")
    store.add(0, Piece([], None))
    (store.folder / "piece-000000.pickle").write_bytes(b"")
    with pytest.raises(InputError, match=r"piece-000000\.pickle: no part of a scan"):
        list(store.pieces())
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        Store(tmp_path / "file", "one")


def test_scans_with_other_points_have_other_names() -> None:
    def name(
        scene: str,
        count: int,
        engine: Engine = Engine.FIXED,
        by: str = "default",
        **options: object,
    ) -> str:
        scanner = Scanner(Light(load(scene), SCANNERS[by]), count, frozenset({"shot"}))
        return name_of(scanner, engine, **options)

    same = name("plane", 100, keep=False)
    assert same == name("plane", 100, keep=False)
    others = [
        name("plane", 101, keep=False),
        name("relief", 100, keep=False),
        name("plane", 100, Engine.IDEAL, keep=False),
        name("plane", 100, keep=True),
        *(name("plane", 100, by=other, keep=False) for other in SCANNERS if other != "default"),
    ]
    assert len({same, *others}) == 1 + len(others)
