"""``vrscan stray``: its output, its files, and what it refuses."""

import csv
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vrscan.cli.app import app

SCENE = """
[stray]
enabled = ["cover", "sensor", "halo"]
lens = { kind = "thin" }
[[target]]
kind = "plane"
position_mm = [0, 0, 400]
"""


def run(*arguments: str):
    return CliRunner().invoke(app, ["stray", *arguments])


def test_tables_and_files(tmp_path: Path) -> None:
    scene = tmp_path / "bare.toml"
    scene.write_text(SCENE)
    files = [tmp_path / name for name in ("budget.csv", "ghosts.csv", "bsdf.png")]
    options = ["--csv", str(files[0]), "--ghost-csv", str(files[1]), "--picture", str(files[2])]
    result = run(str(scene), "--lines", "400", "--tolerance", "0.02", *options)
    assert result.exit_code == 0, result.output
    assert "cover 2 + sensor" in result.output and "or a shift of 0.02 px" in result.output
    assert "camera: digs" not in result.output  # there is no dust in this scene
    assert max(map(len, result.output.splitlines())) <= 120
    with files[0].open() as file:
        causes = [row["cause"] for row in csv.DictReader(file)]
    assert causes == ["camera: roughness", "camera: ghosts", "all together"]
    with files[1].open() as file:
        assert "cover 1 + cover 2" in {row["reflections"] for row in csv.DictReader(file)}
    assert files[2].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("text", "option", "words"),
    [
        ("polish = { roughness_nm = 50 }", [], "the receiver scatters 0."),
        ("", ["--tolerance", "0"], "--tolerance"),
        ("[lens]\nrow_offset_px = 1000", [], "no line brings light"),
        ("", ["--picture", "bsdf.jpg"], "bsdf.jpg"),
    ],
)
def test_bad_input_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, option: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    head = f"[stray]\n{text}\n" if text else ""
    Path("fog.toml").write_text(f'{head}[[target]]\nkind = "plane"\nposition_mm = [0, 0, 400]\n')
    result = run("fog.toml", "--csv", "out.csv", *option)
    assert result.exit_code != 0
    assert words in str(result.exception)
    assert [each.name for each in tmp_path.iterdir()] == ["fog.toml"]
