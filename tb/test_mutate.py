"""The table of faults: each one's text is there, once; `make mutate` puts them in."""

import pytest
from mutate import FAULTS

from vrscan.engines.tools import repository_root


@pytest.mark.parametrize("file", sorted({fault.file for fault in FAULTS}))
def test_every_fault_has_its_place(file: str) -> None:
    text = (repository_root() / file).read_text()
    for fault in FAULTS:
        if fault.file == file:
            assert text.count(fault.old) == 1, fault.what
            assert fault.old != fault.new, fault.what
            assert (repository_root() / fault.test).is_file(), fault.what
