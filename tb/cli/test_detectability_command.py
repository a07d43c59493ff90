"""``vrscan detectability``: its output, its files, and a site of the user's own."""

import csv
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vrscan.cli.app import app


def run(*arguments: str):
    return CliRunner().invoke(app, ["detectability", *arguments])


def test_paper_without_arguments(tmp_path: Path) -> None:
    table, picture = tmp_path / "d.csv", tmp_path / "d.png"
    result = run("--csv", str(table), "--picture", str(picture))
    assert result.exit_code == 0, result.output
    for words in ("12:30, in the sun", "14:30, in shade", "14.0 % at 12:30", "-56.9 %"):
        assert words in result.output
    assert max(map(len, result.output.splitlines())) <= 120
    assert picture.read_bytes().startswith(b"\x89PNG")
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["range_mm"] for row in rows] == ["500", "1000", "1500"] * 2


def test_own_site(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text('title = "Yard"\nrange_mm = [750]\n[sun]\nalbedo = 0.25\n')
    result = run(str(path))
    assert result.exit_code == 0, result.output
    assert "Yard" in result.output
    assert "reflects 0.25 of the band" in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("text", "option", "words"),
    [
        ("[wall]\nreflectance = 2", [], "wall.reflectance = 2"),
        ('[[moment]]\ntime = "2015-06-24T23:00:00+08:00"', [], "below the horizon"),
        ("", ["--picture", "light.jpg"], "light.jpg"),
    ],
)
def test_bad_input_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, option: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("site.toml").write_text(text)
    result = run("site.toml", "--csv", "out.csv", *option)
    assert result.exit_code != 0
    assert words in str(result.exception)
    assert [each.name for each in tmp_path.iterdir()] == ["site.toml"]
