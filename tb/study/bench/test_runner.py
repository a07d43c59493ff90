"""The runner of the benchmark: what is kept, what is done again, and who does it."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from distributed import LocalCluster
from run_command import ended

from vrscan.cli import app as cli
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.engines.tools import repository_root
from vrscan.study.bench import bench_report as report
from vrscan.study.bench import cells, cost, design, design_cost, detect, instrument, runner, tune
from vrscan.study.bench.cells import Cell, plain
from vrscan.study.bench.keep import Keep

SEED = 11
NOTED = "bench_work:noted"


def work(number: int, folder: Path, *, timed: bool = False, **more: str | float) -> Cell:
    parameters = {"number": number, "marks": str(folder / "marks"), **more}
    return Cell(NOTED, parameters, SEED, timed)


def marks(folder: Path) -> list[int]:
    path = folder / "marks"
    return [int(x.split()[0]) for x in path.read_text().splitlines()] if path.exists() else []


def spots(count: int) -> list[Cell]:
    common = {"config": plain(Config()), "lines": 40, "peak": 0.4}
    return [Cell(detect.WORK, {**common, "sigma_px": 1.0 + k}, SEED) for k in range(count)]


@pytest.fixture
def keep(tmp_path: Path) -> Keep:
    return Keep(tmp_path / "kept", "this machine")


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a scheduler with two workers, threads of this process."""
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=":0",
    ) as found:
        yield found.scheduler_address


def test_a_key_depends_on_parameters_seed_and_code_and_on_the_machine_only_if_timed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = work(1, tmp_path)
    same = Cell(first.work, dict(reversed(first.parameters.items())), SEED)
    assert first.key("a") == first.key("b") == same.key()
    timed = work(1, tmp_path, timed=True)
    assert timed.key("a") != timed.key("b")
    keys = {first.key(), work(2, tmp_path).key(), Cell(first.work, first.parameters, 12).key()}
    monkeypatch.setattr(cells, "version", lambda _: "other code")
    assert len(keys | {first.key()}) == 4


def test_a_version_is_that_of_every_file_that_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    version = cells.version.__wrapped__
    before = version(NOTED)
    assert version(NOTED) == before
    monkeypatch.setattr("bench_work.READS", ("scene/scenes/step.toml",))
    other = version(NOTED)
    monkeypatch.setattr("bench_work.READS", ("rtl/trig/divide.sv",))
    assert len({before, other, version(NOTED)}) == 3
    monkeypatch.setattr("bench_work.READS", ("no_such_file.txt",))
    with pytest.raises(FileNotFoundError, match=r"no_such_file\.txt"):
        version(NOTED)


WORKS = (
    detect.WORK,
    tune.WORK,
    cost.WORK,
    design.NOISY,
    design_cost.WORK,
    *(instrument.BUDGET, instrument.FIDELITY, instrument.SPEED, instrument.GROWTH),
)


def versions(root: Path, files: Sequence[str]) -> list[dict[str, str]]:
    """Return the versions of the works in a copy of the repository, then after each file's change.

    One process has them all, and forgets what it has read of the files in between.
    """
    script = f"""
import json, sys
from vrscan.study.bench import cells
print(json.dumps({{work: cells.version(work) for work in {WORKS}}}))
for file in sys.argv[1:]:
    with open(file, "a") as changed:
        changed.write("\\n")
    cells.version.cache_clear()
    cells._closure.cache_clear()
    print(json.dumps({{work: cells.version(work) for work in {WORKS}}}))
"""
    found = subprocess.run(
        [sys.executable, "-c", script, *files],
        env={**os.environ, "PYTHONPATH": str(root / "model")},
        cwd=root,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return [json.loads(line) for line in found.stdout.splitlines()]


def test_a_change_of_any_module_that_is_used_is_another_version(tmp_path: Path) -> None:
    """Used directly or by what is used; and of no other module."""
    for name in ("model", "rtl"):
        shutil.copytree(repository_root() / name, tmp_path / name)
    (tmp_path / "tb").symlink_to(repository_root() / "tb")
    light = {instrument.BUDGET, instrument.FIDELITY, instrument.SPEED, instrument.GROWTH, cost.WORK}
    spots = {detect.WORK, tune.WORK, design.NOISY}
    concerned = {
        "model/vrscan/scene/description.py": light | spots,
        "model/vrscan/scene/scenes/default.toml": light - {cost.WORK},
        "model/vrscan/link/stream.py": set(),
    }
    found = versions(tmp_path, list(concerned))
    for file, before, after in zip(concerned, found[:-1], found[1:], strict=True):
        assert {work for work in WORKS if after[work] != before[work]} == concerned[file], file


def test_a_cell_reads_nothing_that_its_version_does_not_know() -> None:
    """Of modules and of other files, as seen while it is done."""
    script = """
import json, sys
opened = set()
sys.addaudithook(lambda event, args: event == "open" and opened.add(str(args[0])))
from vrscan.data.config import Config
from vrscan.study.bench import cells
work, parameters = json.loads(sys.argv[1])
cells.resolve(work)({"config": cells.plain(Config()), **parameters}, 1)
loaded = [m.__file__ for n, m in sys.modules.items() if n.split(".")[0] == "vrscan" and m.__file__]
print(json.dumps([sorted(opened), loaded]))
"""
    root = repository_root()
    beside = [root / "build", root / ".venv"]
    for work, parameters in (
        (detect.WORK, {"lines": 40, "sigma_px": 2.0, "peak": 0.4}),
        (instrument.BUDGET, {"lines": 64, "scene": "bolt"}),
        (instrument.SPEED, {"lines": 64, "rtl": 16}),
    ):
        done = subprocess.run(
            [sys.executable, "-c", script, json.dumps([work, parameters])],
            env={**os.environ, "PYTHONPATH": str(root / "model")},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        opened, loaded = json.loads(done.stdout.splitlines()[-1])
        read = {Path(name) for name in opened if name.startswith(f"{root}/")}
        read = {x for x in read if not any(map(x.is_relative_to, beside))}
        read = {x for x in read if x.parent.name != "__pycache__"}  # what Python keeps of others
        known = set(cells.files(work).values())
        assert {Path(name) for name in loaded} | read <= known, work
        assert len(loaded) > 50


def test_what_is_kept_is_not_done_again(tmp_path: Path, keep: Keep) -> None:
    first = [work(k, tmp_path) for k in (3, 1, 2)]
    told: list[int] = []
    found = runner.run(first, keep, jobs=2, progress=told.append)
    assert [f["square"] for f in found] == [9, 1, 4]
    assert sorted(marks(tmp_path)) == [1, 2, 3]
    assert told[0] == 0 and told[-1] == 3 and told == sorted(told)
    more = [*first, work(4, tmp_path), work(4, tmp_path), work(5, tmp_path, timed=True)]
    told.clear()
    assert [f["square"] for f in runner.run(more, keep, jobs=1, progress=told.append)] == [
        9, 1, 4, 16, 16, 25
    ]  # fmt: skip
    assert told[0] == 3 and told[-1] == 6
    assert sorted(marks(tmp_path)) == [1, 2, 3, 4, 5]


def test_a_run_that_ended_early_goes_on_where_it_was(tmp_path: Path, keep: Keep) -> None:
    stop = tmp_path / "stop"
    stop.touch()
    wanted = [work(1, tmp_path), work(2, tmp_path, fails=str(stop)), work(3, tmp_path)]
    with pytest.raises(RuntimeError, match="told to"):
        runner.run(wanted, keep, jobs=1)
    before = marks(tmp_path)
    assert 1 in before and 2 not in before
    for file in (tmp_path / "kept").iterdir():  # nothing half-written, nothing temporary
        assert file.suffix == ".json"
        assert json.loads(file.read_text())["figures"]["seed"] == SEED
    stop.unlink()
    assert [f["square"] for f in runner.run(wanted, keep, jobs=1)] == [1, 4, 9]
    assert marks(tmp_path).count(1) == 1


def test_an_interrupt_while_processes_start_is_one_line(tmp_path: Path) -> None:
    """It goes to all of them, as from a terminal."""
    out = tmp_path / "page"
    words = [sys.executable, "-m", "vrscan", "bench", "report", "--quick", "--jobs", "2"]
    with subprocess.Popen(
        [*words, "--seed", str(time.time_ns() % 2**32), "--out", str(out)],
        stderr=subprocess.PIPE,
        text=True,
        cwd=repository_root(),
        start_new_session=True,
    ) as running:
        assert running.stderr is not None
        children = Path(f"/proc/{running.pid}/task/{running.pid}/children")
        while running.poll() is None and len(children.read_text().split()) < 3:  # one tracks others
            time.sleep(0.001)
        os.killpg(running.pid, signal.SIGINT)
        said = running.stderr.read()
    assert running.returncode == cli.EXIT_INTERRUPTED, said
    assert "Traceback" not in said, said
    (line,) = (x for x in said.splitlines() if x.startswith("vrscan:"))
    assert "kept" in line
    assert not out.exists()


@pytest.mark.parametrize("text", ["", '{"figures": ', "[]", '{"figures": 3}', '{"work": "x"}'])
def test_a_damaged_file_is_done_again(tmp_path: Path, keep: Keep, text: str) -> None:
    cell = work(6, tmp_path, timed=True)
    runner.run([cell], keep)
    keep.path(cell).write_text(text)
    assert runner.run([cell], keep) == [{"square": 36, "seed": SEED}]
    assert marks(tmp_path) == [6, 6]
    assert keep.get(cell) == {"square": 36, "seed": SEED}


def test_code_that_changed_meanwhile_is_noticed(
    tmp_path: Path, keep: Keep, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "version", lambda _: "changed")
    with pytest.raises(InputError, match="changed while it ran"):
        runner.run([work(1, tmp_path)], keep, jobs=1)
    assert not list((tmp_path / "kept").iterdir())


def test_processes_and_a_cluster_give_the_same_numbers(tmp_path: Path, cluster: str) -> None:
    wanted = spots(3)
    here = runner.run(wanted, Keep(tmp_path / "here", ""), jobs=2)
    there = runner.run(wanted, Keep(tmp_path / "there", ""), scheduler=cluster)
    assert here == there
    assert len({f["bound_px"] for f in here}) == 3
    direct = [detect.spots(cell.parameters, cell.seed) for cell in wanted]
    assert direct == here
    other = Cell(wanted[0].work, wanted[0].parameters, SEED + 1)
    assert detect.spots(other.parameters, other.seed)["errors"] != here[0]["errors"]


def test_a_cluster_with_other_code_is_an_error(
    tmp_path: Path, keep: Keep, cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "version", lambda _: "newer")
    with pytest.raises(InputError, match="other code"):
        runner.run([work(1, tmp_path)], keep, scheduler=cluster)


def test_a_cluster_without_workers_is_an_error(tmp_path: Path, keep: Keep) -> None:
    empty = LocalCluster(
        n_workers=0, processes=False, protocol="tcp://", host="127.0.0.1", dashboard_address=":0"
    )
    with empty, pytest.raises(InputError, match="has no workers"):
        runner.run([work(1, tmp_path)], keep, scheduler=empty.scheduler_address)


def test_a_cluster_that_goes_away_is_an_error_and_what_it_did_is_kept(
    tmp_path: Path, keep: Keep
) -> None:
    leaving = LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=":0",
    )
    wanted = [work(1, tmp_path), *(work(k, tmp_path, seconds=2.0) for k in (2, 3))]

    def close_after_the_first(done: int) -> None:
        if done == 1:
            leaving.close()

    with pytest.raises(InputError, match="was lost"):
        runner.run(
            wanted, keep, scheduler=leaving.scheduler_address, progress=close_after_the_first
        )
    assert keep.get(wanted[0]) == {"square": 1, "seed": SEED}
    assert len(list((tmp_path / "kept").iterdir())) == 1


def listening(server: socket.socket, answer: bytes) -> Callable[[], None]:
    """Take connections and say something that no scheduler says."""

    def serve() -> None:
        held = []
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            connection.sendall(answer)
            held.append(connection)

    return serve


@pytest.mark.parametrize("kind", ["closed", "nonsense", "unknown_scheme", "silent", "wrong"])
def test_an_address_where_no_scheduler_answers_is_one_line(
    kind: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(runner, "PATIENCE_S", 1.0)
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]
    address = {"nonsense": "here and there", "unknown_scheme": f"gopher://127.0.0.1:{port}"}
    asked = address.get(kind, f"tcp://127.0.0.1:{port}")
    if kind == "closed":
        server.close()
    else:
        answer = b"HTTP/1.1 400 Bad Request\r\n\r\n" if kind == "wrong" else b""
        threading.Thread(target=listening(server, answer), daemon=True).start()
    out = tmp_path / "page"
    monkeypatch.setattr(report, "ALL", ())
    words = ["bench", "report", "--quick", "--out", str(out), "--scheduler", asked]
    assert ended(monkeypatch, *words) == cli.EXIT_BAD_INPUT
    server.close()
    complaint = [x for x in capsys.readouterr().err.splitlines() if x.startswith("vrscan:")]
    assert len(complaint) == 1
    assert "--scheduler" in complaint[0] and asked in complaint[0]
    assert not out.exists()
