# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches: supple.point_cache, and bakes that are killed while they write."""

import hashlib
import random
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import supple

POINTS, FRAMES = 3000, 120
HEADER = np.dtype(
    [
        ("magic", "S12"),
        ("version", "<i4"),
        ("points", "<i4"),
        ("start", "<f4"),
        ("rate", "<f4"),
        ("frames", "<i4"),
    ]
)


def frame(number, points=POINTS):
    """Frame `number` of a made-up animation: other values in each."""
    grid = np.arange(3 * points, dtype=np.float32).reshape(points, 3)
    return np.sin(grid * np.float32(0.01) + np.float32(number))


def key(number):
    return hashlib.blake2b(b"frame %d" % number, digest_size=16).hexdigest()


def bake(path, frames=FRAMES, points=POINTS):
    """A bake as a user writes one; returns the numbers of the frames it computed."""
    kept = supple.KeptFrames(path)
    computed = []
    with supple.PointCacheWriter(path, points, frame_count=frames, start=5) as cache:
        for number in range(frames):
            positions = kept.find(key(number))
            if positions is None:
                computed.append(number)
                positions = frame(number, points)
            cache.append(key(number), positions)
    return computed


def read(path):
    """Header and frames of a PC2 file, with NumPy alone; bytes after them may follow."""
    content = path.read_bytes()
    header = np.frombuffer(content, HEADER, count=1)[0]
    assert header["magic"] == b"POINTCACHE2"
    assert content[11] == 0
    count, points = int(header["frames"]), int(header["points"])
    values = np.frombuffer(content, "<f4", count=count * points * 3, offset=HEADER.itemsize)
    return header, values.reshape(count, points, 3)


def code_of(call, *arguments, **named):
    with pytest.raises(supple.SuppleError) as caught:
        call(*arguments, **named)
    return caught.value.code


@pytest.fixture
def path(tmp_path):
    return tmp_path / "bäke 1.pc2"


def part_of(path):
    return path.with_name(path.name + ".part")


def keys_of(path):
    return path.with_name(path.name + ".keys")


# --- the classes ----------------------------------------------------------------------------------


def test_round_trip(path):
    assert bake(path, frames=4, points=7) == [0, 1, 2, 3]
    header, values = read(path)
    assert tuple(header)[1:] == (1, 7, 5.0, 1.0, 4)
    assert path.stat().st_size == HEADER.itemsize + values.nbytes
    reader = supple.PointCacheReader(path)
    assert (reader.points, reader.start, reader.rate, reader.frames) == (7, 5.0, 1.0, 4)
    for number in range(4):
        assert reader.read(number).dtype == np.float32
        assert np.array_equal(reader.read(number), frame(number, 7))
        assert np.array_equal(values[number], frame(number, 7))
    assert code_of(reader.read, 4) == "index_out_of_range"
    assert code_of(supple.PointCacheReader, path.with_name("none")) == "array_file"


def test_keys_are_digits_or_bytes(path):
    with supple.PointCacheWriter(path, 7, frame_count=2) as cache:
        cache.append(bytes.fromhex(key(0)), frame(0, 7).astype(np.float64))
        cache.append(key(1).upper(), frame(1, 7).tolist())
    kept = supple.KeptFrames(path)
    assert len(kept) == 2
    assert np.array_equal(kept.find(key(0)), frame(0, 7))
    assert np.array_equal(kept.find(bytes.fromhex(key(1))), frame(1, 7))
    assert kept.find(key(2)) is None
    assert code_of(kept.find, b"short") == "bad_option"


def test_an_exception_keeps_the_unfinished_one(path):
    with pytest.raises(RuntimeError), supple.PointCacheWriter(path, 7, frame_count=9) as cache:
        cache.append(key(0), frame(0, 7))
        raise RuntimeError
    assert not path.exists()
    assert supple.PointCacheReader(part_of(path)).frames == 1
    assert code_of(cache.append, key(1), frame(1, 7)) == "bad_option"
    assert bake(path, frames=9, points=7) == list(range(1, 9))
    assert sorted(file.name for file in path.parent.iterdir()) == [path.name, path.name + ".keys"]


def test_leaving_early_is_an_error_unless_it_was_closed_or_discarded(path):
    def leave(how):
        with supple.PointCacheWriter(path, 7, frame_count=9) as cache:
            cache.append(key(0), frame(0, 7))
            how(cache)

    assert code_of(leave, lambda cache: None) == "bad_option"
    assert part_of(path).exists()
    leave(lambda cache: cache.close())
    assert part_of(path).exists()
    leave(lambda cache: cache.discard())
    assert list(path.parent.iterdir()) == []


def test_what_is_refused(path):
    assert code_of(supple.PointCacheWriter, path, 0, frame_count=1) == "bad_option"
    nowhere = path.parent / "nowhere" / "cache.pc2"
    assert code_of(supple.PointCacheWriter, nowhere, 7, frame_count=1) == "array_file"
    with supple.PointCacheWriter(path, 7, frame_count=1) as cache:
        assert code_of(cache.append, key(0), frame(0, 6)) == "wrong_shape"
        assert code_of(cache.append, key(0), np.zeros(21)) == "wrong_shape"
        assert code_of(cache.append, key(0), np.full((7, 3), np.nan)) == "not_finite"
        cache.append(key(0), frame(0, 7))


# --- kills ----------------------------------------------------------------------------------------

WORKER = """
import signal, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
import resource, test_point_cache
if int(sys.argv[3]):
    # The system kills it within the write that would make a file larger.
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY))
print("ready", flush=True)
test_point_cache.bake(Path(sys.argv[2]))
"""
FRAME_BYTES = POINTS * 12
ALL_BYTES = HEADER.itemsize + FRAMES * FRAME_BYTES


def started(path, limit=0):
    worker = subprocess.Popen(
        [sys.executable, "-c", WORKER, str(Path(__file__).parent), str(path), str(limit)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert worker.stdout.readline() == "ready\n"
    return worker


def size(path):
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return -1


def killed_at(path, size_wanted):
    """Kills a bake once its unfinished file has that size; it may be done by then."""
    worker = started(path)
    while size(part_of(path)) < size_wanted and worker.poll() is None:
        pass
    worker.send_signal(signal.SIGKILL)
    worker.communicate()


def check_what_is_there(path):
    """Every frame that is counted is right, and the frames found are no fewer; returns how many."""
    kept = supple.KeptFrames(path)
    found = 0
    for number in range(FRAMES):
        positions = kept.find(key(number))
        if positions is not None:
            assert np.array_equal(positions, frame(number))
            found += 1
    for file in (path, part_of(path)):
        if file.exists():
            header, values = read(file)
            assert (header["points"], header["start"], header["rate"]) == (POINTS, 5, 1)
            assert supple.PointCacheReader(file).frames == len(values) <= found
            for number, positions in enumerate(values):
                assert np.array_equal(positions, frame(number))
    return found


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    path = tmp_path_factory.mktemp("uninterrupted") / "cache.pc2"
    assert bake(path) == list(range(FRAMES))
    return path.read_bytes(), keys_of(path).read_bytes()


def check_resume(path, uninterrupted, found):
    assert len(bake(path)) == FRAMES - found
    assert (path.read_bytes(), keys_of(path).read_bytes()) == uninterrupted
    assert set(path.parent.iterdir()) == {path, keys_of(path)}


@pytest.mark.parametrize("seed", range(20))
def test_killed_at_any_moment(path, uninterrupted, seed):
    killed_at(path, random.Random(seed).randint(-1, ALL_BYTES))
    check_resume(path, uninterrupted, check_what_is_there(path))


def test_killed_again_and_again(path, uninterrupted):
    found = 0
    for share in (0.6, 0.1, 0.4, 0.0, 0.9):
        killed_at(path, int(share * ALL_BYTES))
        before, found = found, check_what_is_there(path)
        assert found >= before
    check_resume(path, uninterrupted, found)


@pytest.mark.parametrize("into_frame", [1, FRAME_BYTES // 2 + 1, FRAME_BYTES - 1])
def test_killed_within_a_write(path, uninterrupted, into_frame):
    worker = started(path, HEADER.itemsize + 40 * FRAME_BYTES + into_frame)
    worker.communicate()
    assert worker.returncode == -signal.SIGXFSZ
    assert size(part_of(path)) == HEADER.itemsize + 40 * FRAME_BYTES + into_frame
    assert len(read(part_of(path))[1]) == check_what_is_there(path) == 40
    check_resume(path, uninterrupted, 40)


def test_a_full_disk_leaves_the_bake_of_before(path):
    bake(path, frames=3)
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3 * FRAME_BYTES + 100, limits[1]))
    try:
        with pytest.raises(supple.SuppleError, match="Make room") as caught:
            bake(path, frames=5)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.code == "array_file"
    assert path.read_bytes() == before
    assert supple.PointCacheReader(part_of(path)).frames == 3
    assert bake(path, frames=5) == [3, 4]


def test_a_folder_that_cant_be_written():
    with pytest.raises(supple.SuppleError, match="may write to") as caught:
        supple.PointCacheWriter("/sys/cache.pc2", 7, frame_count=1)
    assert caught.value.code == "array_file"
