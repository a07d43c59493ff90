"""Where RTL and build products are: in a clone, and in an installed package."""

from pathlib import Path

import pytest

from vrscan.data.errors import InputError
from vrscan.engines import tools


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a package that carries one RTL file, with an empty cache beside it."""
    folder = tmp_path / "site-packages" / "vrscan"
    (folder / "hardware" / "rtl" / "trig").mkdir(parents=True)
    (folder / "hardware" / "rtl" / "trig" / "divide.sv").touch()
    monkeypatch.setattr(tools, "_PACKAGE", folder)
    monkeypatch.setattr(tools, "_CARRIED", folder / "hardware")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return folder


def test_a_clone_builds_in_itself() -> None:
    root = tools.repository_root()
    assert not tools.installed()
    assert tools.hardware_root() == root
    assert tools.build_folder() == root / "build"
    assert (root / "scripts" / "setup.sh").is_file()
    assert tools.rtl_module("divide") == root / "rtl" / "trig" / "divide.sv"


def test_an_installed_package_carries_the_rtl_and_builds_in_the_users_cache(package: Path) -> None:
    assert tools.installed()
    assert tools.rtl_module("divide") == package / "hardware" / "rtl" / "trig" / "divide.sv"
    assert tools.build_folder() == package.parents[1] / "cache" / "vrscan"
    assert tools.build_folder().is_dir()
    assert [each.name for each in package.iterdir()] == ["hardware"]


def test_an_installed_package_is_no_repository(package: Path) -> None:
    with pytest.raises(InputError, match="this needs a clone of the repository") as caught:
        tools.repository_root()
    assert str(package) in str(caught.value)


def test_a_cache_that_cannot_be_made_is_named(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (package.parents[1] / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(package.parents[1] / "file"))
    with pytest.raises(InputError, match=r"file/vrscan: cannot make the folder"):
        tools.build_folder()
