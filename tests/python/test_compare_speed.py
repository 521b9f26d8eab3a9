# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison of speed: what it writes, and what it makes of differences. No test depends on
how long anything takes."""

import copy
import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest
import supple
import supple.geometry
from supple_training.compare import (
    against,
    contender,
    difference,
    kernels,
    machine,
    report,
    runner,
    shapes,
    tasks,
)
from supple_training.compare.__main__ import app
from typer.testing import CliRunner

SIZE = 500
MESH = runner.Mesh("torus", SIZE)


def settings(**changed) -> runner.Settings:
    return runner.Settings(
        **{"meshes": (MESH,), "threads": (1,), "runs": 1, "limit": 300.0, **changed}
    )


def invoke(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


# --- meshes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [SIZE, 3000])
def test_torus_is_closed_irregular_of_area_one_and_always_the_same(size):
    case = shapes.bumpy_torus(size)
    assert abs(len(case.vertices) - size) < 0.05 * size
    assert supple.Mesh(case.vertices, case.faces).notes == []
    edges = np.unique(np.sort(case.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    assert len(case.vertices) - len(edges) + len(case.faces) == 0  # Euler's number of a torus
    assert len(set(np.bincount(case.faces.ravel()))) > 3
    assert supple.geometry.face_areas(case.vertices, case.faces).sum() == pytest.approx(1)
    again = shapes.bumpy_torus(size)
    assert (case.vertices == again.vertices).all() and (case.faces == again.faces).all()


# --- speed ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> dict:
    out = tmp_path_factory.mktemp("speed")
    names = "eigenbasis,solve,forward,edit_natural"
    done = invoke(
        *("speed", "--sizes", SIZE, "--runs", 1, "--threads", 1, "--out", out, "--only", names)
    )
    assert done.exit_code == 0, done.output
    assert (out / "speed.png").read_bytes().startswith(b"\x89PNG")
    assert "## eigenbasis" in (out / "speed.md").read_text()
    return report.load(out / "speed.json")


def test_json_says_what_was_measured_on_what(written):
    assert {"cpu", "flags", "cores", "memory_bytes"} <= written["machine"].keys()
    assert written["versions"]["scipy"]
    assert written["settings"]["meshes"] == [["torus", SIZE]]
    for row in written["rows"]:
        assert {"task", "contender", "ours", "mesh", "size", "threads", "status"} <= row.keys()
        if row["status"] == "measured":
            seconds = row["seconds"]
            assert 0 < seconds["low"] <= seconds["median"] <= seconds["high"]
            assert len(seconds["all"]) == seconds["runs"] == 1
            assert row["peak_bytes"] >= 0
            assert row["vertices"] == len(shapes.bumpy_torus(SIZE).vertices)
        else:
            assert row["message"]


def test_every_contender_has_a_row_and_ours_is_the_unit(written):
    names = {(row["task"], row["contender"]) for row in written["rows"]}
    assert names == {
        (task.name, each.name)
        for task in tasks.chosen(["eigenbasis", "solve", "forward", "edit_natural"])
        for each in task.contenders
    }
    first = written["rows"][0]
    assert first["contender"] == "supple" and first["times_ours"] == 1.0


def test_eigenfunctions_of_all_are_equally_good(written):
    measured = [row for row in written["rows"] if row["task"] == "eigenbasis" and "seconds" in row]
    assert measured
    for row in measured:
        assert row["facts"]["residual"] < 1e-8, row["contender"]


def test_pytorch_computes_what_ours_does(written):
    if importlib.util.find_spec("torch") is None:
        pytest.skip("PyTorch is not installed")
    row = next(row for row in written["rows"] if row["contender"].startswith("PyTorch"))
    assert row["facts"]["difference from supple, same weights"] < 1e-4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sizes", "many"], "no list of whole numbers"),
        (["--threads", "0"], "no list of whole numbers"),
        (["--only", "knitting"], "no task 'knitting'"),
        (["--only", "solve", "--against", "no-such-commit"], "knows no commit"),
    ],
)
def test_bad_options_are_refused_before_any_work(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    done = invoke("speed", *arguments)
    assert done.exit_code == 2
    assert message in done.output
    assert list(tmp_path.iterdir()) == []


# --- what cannot be had ---------------------------------------------------------------------------


def measure(task: contender.Task, **changed) -> list[dict]:
    return runner.Comparison(settings(**changed)).run([task])


def test_a_function_that_this_build_lacks_is_reported(monkeypatch):
    with pytest.raises(contender.NotAvailable, match=r"supple\.geometry\.no_such_function"):
        contender.attribute("supple.geometry.no_such_function")
    monkeypatch.delattr(supple.geometry, "SparseCholesky", raising=False)
    with pytest.raises(contender.NotAvailable, match="SparseCholesky"):
        tasks.find("factor", "supple").setup(shapes.bumpy_torus(SIZE), 1)


def fake_worker(monkeypatch, script: str) -> None:
    """Contenders' processes run `script` in the place of the worker."""
    start = runner.subprocess.Popen

    def other(command, **options):
        return start([sys.executable, "-c", script, *command[3:]], **options)

    monkeypatch.setattr(runner.subprocess, "Popen", other)


def task_of(*contenders: contender.Contender) -> contender.Task:
    return contender.Task("fake", "nothing", contenders)


OURS = contender.Contender("ours", lambda *_: None, ours=True)
PEER = contender.Contender("peer", lambda *_: None)

ANSWERS = """
import json, sys
request = json.loads(sys.argv[1])
def say(**values): print(json.dumps(values), flush=True)
"""


def test_what_is_not_there_or_breaks_is_a_row(monkeypatch):
    fake_worker(
        monkeypatch,
        ANSWERS
        + """
if request["contender"] == "ours":
    say(status="not available in this build", message="supple.magic")
else:
    sys.exit("no luck")
""",
    )
    ours, peer = measure(task_of(OURS, PEER))
    assert ours["status"] == "not available in this build"
    assert ours["message"] == "supple.magic"
    assert peer["status"] == "failed"
    assert peer["message"] == "no luck"
    assert "seconds" not in ours and "seconds" not in peer


SERVE = """
say(ready=True, vertices=request["size"], faces=1)
for line in sys.stdin:
    command = line.split()[0]
    if command == "quit":
        break
    heavy = request["contender"] == "peer" and request["size"] > 500
    seconds = 0.5 if request["threads"] == 1 else 0.25
    say(seconds=seconds, peak_bytes=7, facts={}, heavy=heavy)
"""


def test_over_the_limit_is_said_and_larger_sizes_are_skipped(monkeypatch):
    fake_worker(monkeypatch, ANSWERS + SERVE)
    ask = runner.Worker.ask

    def impatient(worker: runner.Worker, command: str, limit: float) -> dict:
        answer = ask(worker, command, limit)
        if answer.get("heavy"):
            worker.close()
            raise runner.OverLimit("more than 7 s")
        return answer

    monkeypatch.setattr(runner.Worker, "ask", impatient)
    meshes = tuple(runner.Mesh("torus", size) for size in (1500, 500, 1000))
    rows = measure(task_of(OURS, PEER), meshes=meshes, runs=2)
    statuses = {(row["contender"], row["size"]): row["status"] for row in rows}
    assert statuses == {
        ("ours", 500): "measured",
        ("peer", 500): "measured",
        ("ours", 1000): "measured",
        ("peer", 1000): "over the limit",
        ("ours", 1500): "measured",
        ("peer", 1500): "skipped",
    }
    assert "over the limit at 1000 vertices: more than 7 s" in rows[-1]["message"]


def test_a_process_that_does_not_answer_in_time_is_ended(monkeypatch):
    fake_worker(monkeypatch, "import time; time.sleep(3600)")
    worker = runner.Worker({"threads": 1}, runner.Build("this"), ours=True)
    with pytest.raises(runner.OverLimit, match="more than 0 s"):
        worker.answer(0)
    assert worker._process.returncode is not None


def test_a_peer_runs_with_its_best_number_of_threads(monkeypatch):
    monkeypatch.setattr(runner.os, "sched_getaffinity", lambda _: {0, 1})
    fake_worker(monkeypatch, ANSWERS + SERVE)
    ours, peer = measure(task_of(OURS, PEER), runs=3)
    assert ours["threads"] == 1 and ours["seconds"]["median"] == 0.5
    assert peer["threads"] == 2 and peer["seconds"]["median"] == 0.25
    assert peer["seconds_with_threads"] == {"1": 0.5, "2": 0.25}
    assert peer["times_ours"] == 0.5
    assert peer["seconds"]["runs"] == 3


def test_builds_take_turns_and_peers_are_left_out(monkeypatch):
    fake_worker(monkeypatch, ANSWERS + SERVE)
    builds = (runner.Build("base"), runner.Build("new"))
    rows = runner.Comparison(settings(peers=False), builds).run([task_of(OURS, PEER)])
    assert [(row["build"], row["contender"]) for row in rows] == [("base", "ours"), ("new", "ours")]


# --- peak memory ----------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_peak_memory_counts_what_was_freed_again_but_not_what_was_before():
    from supple_training.compare.worker import PeakMemory

    before = np.ones(8_000_000)
    peak = PeakMemory()
    within = np.ones(4_000_000)
    del within
    assert 25e6 < peak.grown() < 60e6
    assert len(before)


# --- diff -----------------------------------------------------------------------------------------


def document(median: float = 1.0, spread: float = 0.01, **changed) -> dict:
    """A made-up comparison of one of ours and one peer."""

    def seconds(middle: float) -> dict:
        return {
            "median": middle,
            "low": middle * (1 - spread),
            "high": middle * (1 + spread),
            "runs": 7,
            "all": [middle],
        }

    common = {"task": "solve", "title": "solve", "mesh": "torus", "size": 1000, "threads": 2}
    common |= {"status": "measured", "peak_bytes": 10_000_000, "build": "this"}
    rows = [
        {**common, "contender": "supple", "ours": True, "seconds": seconds(median), **changed},
        {**common, "contender": "peer", "ours": False, "seconds": seconds(1.0)},
    ]
    return {"schema": report.SCHEMA, "machine": {"cpu": "A", "cores": 2}, "rows": rows}


@pytest.fixture
def diff(tmp_path):
    def run(base: dict, new: dict, *options: str):
        paths = []
        for name, made in (("base", base), ("new", new)):
            paths.append(tmp_path / f"{name}.json")
            paths[-1].write_text(json.dumps(made))
        return invoke("diff", *paths, *options)

    return run


@pytest.mark.parametrize(
    ("new", "code", "words"),
    [
        (document(1.5), 1, "1 slower beyond noise, 0 faster"),
        (document(0.5), 0, "0 slower beyond noise, 1 faster"),
        (document(1.03), 0, "0 slower beyond noise, 0 faster"),
        (document(1.5, spread=0.6), 0, "0 slower beyond noise, 0 faster"),
    ],
    ids=["slower", "faster", "below the floor", "within noise"],
)
def test_only_what_is_slower_beyond_noise_fails(diff, new, code, words):
    done = diff(document(), new)
    assert done.exit_code == code, done.output
    assert words in done.output


def test_the_floor_can_be_set(diff):
    assert diff(document(), document(1.2), "--noise", "0.5").exit_code == 0


def test_a_slower_peer_does_not_fail_but_is_said(diff):
    new = document()
    new["rows"][1]["seconds"] = document(2.0)["rows"][0]["seconds"]
    done = diff(document(), new)
    assert done.exit_code == 0
    assert "the peers took 2.00 times as long" in done.output


def test_another_machine_is_said(diff):
    new = copy.deepcopy(document())
    new["machine"]["cpu"] = "B"
    assert "another machine: cpu A, then B" in diff(document(), new).output


def test_what_only_one_has_is_shown_and_no_failure():
    base = document()
    base["rows"][0] = {
        **{name: value for name, value in base["rows"][0].items() if name != "seconds"},
        "status": "not available in this build",
    }
    (change,) = difference.changes(base, document())
    assert change.verdict == "base: not available in this build"
    assert change.ratio is None
    (change,) = difference.changes(document(), base)
    assert change.verdict == "new: not available in this build"


@pytest.mark.parametrize("text", ["{", '{"schema": "other"}', "[]"])
def test_a_file_that_is_no_comparison_is_refused(tmp_path, text):
    path = tmp_path / "speed.json"
    path.write_text(text)
    done = invoke("diff", path, path)
    assert done.exit_code == 2
    assert "speed.json" in done.output.replace("\n", "")


# --- the peers are what they say ------------------------------------------------------------------


def test_the_residual_is_that_of_the_equation():
    case = shapes.bumpy_torus(SIZE)
    functions, values, reported = supple.geometry.eigenbasis(case.vertices, case.faces, 20)
    laplacian, mass = kernels.operators(case)
    assert kernels.residual(laplacian, mass, values, functions) == pytest.approx(reported, rel=0.5)
    assert kernels.residual(laplacian, mass, values + 0.1, functions) > 1e-4


def test_pytorch_step_has_the_loss_of_ours():
    torch = pytest.importorskip("torch")
    pytest.importorskip("cholespy")
    from supple_training.compare import networks, torch_paper

    case = shapes.bumpy_torus(SIZE)
    surface = torch_paper.Surface(case)
    pair = (case.vertices, case.faces, shapes.bent(case.vertices))
    ours = supple.train([pair], signal="rotation", config="paper", epochs=100, max_steps=1)
    network = torch_paper.Network(ours.initial)
    signal = torch.from_numpy(networks.rotations(case).astype(np.float32))
    step = torch_paper.TrainingStep(surface, network, signal, pair[2])
    assert step.loss().item() == pytest.approx(ours.steps[0]["loss"], rel=1e-3)


# --- another commit -------------------------------------------------------------------------------

# Makes a wheel whose package says what the file VALUE says.
PACKAGE = """
import pathlib, sys, zipfile
value = pathlib.Path("VALUE").read_text()
if value == "broken":
    sys.exit("this cannot be built")
tag = f"cp{sys.version_info.major}{sys.version_info.minor}-none-any"
pathlib.Path("dist").mkdir(exist_ok=True)
with zipfile.ZipFile(f"dist/supple-1.0-{tag}.whl", "w") as wheel:
    info = "supple-1.0.dist-info/"
    wheel.writestr("supple/__init__.py", value)
    wheel.writestr(info + "METADATA", "Metadata-Version: 2.1\\nName: supple\\nVersion: 1.0\\n")
    wheel.writestr(info + "WHEEL", f"Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: {tag}\\n")
    wheel.writestr(info + "RECORD", "")
"""


@pytest.fixture
def checkout(tmp_path):
    """A git repository of two commits, with a change since."""
    folder = tmp_path / "checkout"
    (folder / "scripts").mkdir(parents=True)
    (folder / "scripts" / "package.py").write_text(PACKAGE)
    (folder / ".gitignore").write_text("dist\n")

    def git(*arguments: str) -> None:
        who = ("-c", "user.name=A", "-c", "user.email=a@example.org")
        subprocess.run(["git", "-C", folder, *who, *arguments], check=True, capture_output=True)

    git("init", "-q", "-b", "main")
    for value in ("broken", "committed"):
        (folder / "VALUE").write_text(value)
        git("add", "-A")
        git("commit", "-q", "-m", value)
    (folder / "VALUE").write_text("changed")
    return folder


def worktrees(folder) -> int:
    listed = subprocess.run(["git", "-C", folder, "worktree", "list"], capture_output=True)
    return len(listed.stdout.splitlines())


def test_a_commit_and_the_checkout_are_built_side_by_side(checkout):
    commit = machine.commit(checkout, "main")
    assert machine.commit(checkout) == f"{commit}+changes"
    assert machine.commit(checkout, "nothing") is None
    with against.both(checkout, commit) as (base, new):
        assert (base / "supple" / "__init__.py").read_text() == "committed"
        assert (new / "supple" / "__init__.py").read_text() == "changed"
    assert not base.exists()
    assert worktrees(checkout) == 1


def test_a_build_that_fails_says_why_and_leaves_nothing(checkout):
    broken = machine.commit(checkout, "main~1")
    with (
        pytest.raises(against.BuildError, match="this cannot be built"),
        against.both(checkout, broken),
    ):
        pass
    assert worktrees(checkout) == 1
