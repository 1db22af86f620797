# SPDX-License-Identifier: GPL-3.0-or-later
"""Kernels work whatever has become of their code on disk, and code that cannot be used is compiled
and kept again.
"""

import os
import pickle
import shutil

import pytest
from scope.scope_addon.machine_code.code_cache import SUFFIX, read_code, write_code
from scope.scope_addon.temporary import claim, discard
from scope.solver.shipped_code import can_run_shipped, shipped_processor

from .small_package import LONG_CALLEE, make_package

COUNT = 7
ONE = """
@kernel
def add{n}(x):
    return x + {n}.0
"""
# Prints the kernels' results, and which of them came from disk.
RUN = f"""
import package.scope_addon
from package.solver import kernels
found = [getattr(kernels, f"add{{n}}") for n in range({COUNT})]
print([kernel(1.0) for kernel in found])
print([sum(kernel.stats.cache_hits.values()) for kernel in found])
"""
RESULTS = [1.0 + n for n in range(COUNT)]


@pytest.fixture(scope="module")
def run(run_code):
    def run(folder, cache, before="", **environment):
        """Return which kernels came from disk, and what was written to stderr."""
        done = run_code(
            before + RUN, folder, dict(os.environ, **{"NUMBA_CACHE_DIR": str(cache), **environment})
        )
        results, hits = map(eval, done.stdout.splitlines())
        assert results == RESULTS
        return hits, done.stderr

    return run


@pytest.fixture(scope="module")
def made(run, tmp_path_factory):
    """A folder with the package and, in ``cache``, its compiled code."""
    folder = tmp_path_factory.mktemp("made")
    text = "from .kernel import kernel\n" + "".join(ONE.format(n=n) for n in range(COUNT))
    (make_package(folder) / "kernels.py").write_text(text)
    assert run(folder, folder / "cache")[0] == [0] * COUNT
    return folder


@pytest.fixture
def folder(made, tmp_path):
    """A copy with new modification times, as after unpacking an archive."""
    return shutil.copytree(made, tmp_path / "copy", copy_function=shutil.copyfile)


def code_files(cache):
    """Return the file of each kernel, in order."""
    files = sorted(cache.rglob("*.code"))
    assert [path.name.partition("-")[0] for path in files] == [
        f"kernels.add{n}" for n in range(COUNT)
    ]
    return files


def test_damaged_code_is_replaced(run, folder):
    empty, cut, first, middle, last, exchanged, sound = code_files(folder / "cache")
    exchanged.write_bytes(sound.read_bytes())
    empty.write_bytes(b"")
    cut.write_bytes(cut.read_bytes()[:500])
    for path, share in ((first, 0.0), (middle, 0.5), (last, 1.0)):
        content = bytearray(path.read_bytes())
        content[round(share * (len(content) - 1))] ^= 0x10
        path.write_bytes(content)
    assert run(folder, folder / "cache") == ([0] * (COUNT - 1) + [1], "")
    assert run(folder, folder / "cache") == ([1] * COUNT, "")


def test_content_that_numba_cannot_use_is_replaced(run, folder):
    """Its checksum is right."""
    parts = [((text,) * 9, set()) for text in ("", {})]
    contents = [
        b"",
        b"no pickle",
        *map(pickle.dumps, (None, (), (1, 2))),
        *(pickle.dumps(("package", pickle.dumps(each))) for each in parts),
    ]
    for n, (path, content) in enumerate(zip(code_files(folder / "cache"), contents, strict=True)):
        key = repr((("solver.kernels", f"add{n}", 3 + 4 * n), "(float64,)"))
        assert read_code(path, key, trusted=False)
        write_code(path, key, content)
    assert run(folder, folder / "cache") == ([0] * COUNT, "")
    assert run(folder, folder / "cache") == ([1] * COUNT, "")


LINK = """
import package.scope_addon
from package.solver.kernels import inner, outer
first = inner(1.0)
(result,) = inner.overloads.values()
print(sum(inner.stats.cache_hits.values()), result.library._shared_module is None)
print(outer(1.0) == first + inner(2.0), sum(outer.stats.cache_hits.values()))
"""
FIRST = """
import package.scope_addon
from package.solver.kernels import inner
inner(1.0)
"""


def test_code_for_other_kernels_is_read_where_one_is_compiled_that_calls_it(run_code, tmp_path):
    """To read it takes a third of the time of loading a kernel."""
    (make_package(tmp_path) / "kernels.py").write_text(LONG_CALLEE)
    environment = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    said = []
    for code in (FIRST, LINK, LINK):
        said.append(run_code(code, tmp_path, environment).stdout.splitlines())
    assert said == [[], ["1 True", "True 0"], ["1 True", "True 1"]]


def test_without_a_place_for_code_kernels_work(run, folder):
    (folder / "file").write_text("")
    for place in (folder / "file" / "cache", folder / "file"):
        hits, said = run(folder, place)
        assert hits == [0] * COUNT
        assert said.count("\n") == 1
        assert "cannot be kept" in said


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot limit a process's files")
def test_a_full_disk_leaves_no_part_of_a_file(run, folder):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
    hits, said = run(folder, folder / "full", limit, PYTHONDONTWRITEBYTECODE="1")
    assert hits == [0] * COUNT
    assert said.count("\n") == 1
    assert [path for path in (folder / "full").rglob("*") if path.is_file()] == []


def test_code_is_kept_whatever_the_times_of_the_sources_and_what_a_killed_compile_left_is_removed(
    run, folder
):
    first = code_files(folder / "cache")[0]
    own = first.parent
    before = set(os.listdir(own))
    draft = f".{first.stem}.scope-0123456789abcdef"
    (own / f"{draft}-lock").touch()
    (own / f"{draft}{SUFFIX}").write_bytes(first.read_bytes()[:100])
    written = claim(own, f".{first.stem}.", SUFFIX)  # by this process
    assert run(folder, folder / "cache") == ([1] * COUNT, "")
    assert set(os.listdir(own)) == before | {f"{written.stem}-lock"}
    discard(written)


@pytest.mark.skipif(os.name == "nt", reason="Windows needs a privilege for links")
def test_code_is_not_written_through_a_link(run, folder):
    file = code_files(folder / "cache")[0]
    elsewhere = folder / "elsewhere"
    elsewhere.write_text("a user's")
    file.unlink()
    file.symlink_to(elsewhere)
    run(folder, folder / "cache")
    assert elsewhere.read_text("utf-8") == "a user's"
    assert run(folder, folder / "cache") == ([1] * COUNT, "")


@pytest.mark.skipif(os.name == "nt", reason="Windows reports no owner")
def test_code_that_others_could_have_written_is_not_run(run, folder):
    groups, everyones, pipe, theirs, *sound = code_files(folder / "cache")
    groups.chmod(0o664)
    everyones.chmod(0o646)
    pipe.unlink()
    os.mkfifo(pipe)
    expected = [0, 0, 0, 1] + [1] * len(sound)
    if os.geteuid() == 0:
        os.chown(theirs, 12345, -1)
        expected[3] = 0
    assert run(folder, folder / "cache")[0] == expected
    assert run(folder, folder / "cache")[0] == [1] * COUNT


@pytest.mark.skipif(not can_run_shipped(), reason="no code is shipped for this processor")
def test_shipped_code_is_used_and_nothing_written(run, folder):
    shipped = folder / "package" / "assets" / "kernels"
    assert (
        run(folder, shipped, NUMBA_CPU_NAME=shipped_processor(), NUMBA_CPU_FEATURES="")[0]
        == [0] * COUNT
    )
    assert run(folder, folder / "other") == ([1] * COUNT, "")
    assert not (folder / "other").exists()
    code_files(shipped)[0].write_bytes(b"damaged")
    assert run(folder, folder / "other")[0] == [0] + [1] * (COUNT - 1)
    assert run(folder, folder / "other")[0] == [1] * COUNT


def test_a_changed_source_makes_code_stale(run, folder):
    with (folder / "package" / "solver" / "__init__.py").open("a") as source:
        source.write("# changed\n")
    assert run(folder, folder / "cache")[0] == [0] * COUNT
    assert len(list((folder / "cache").iterdir())) == 2
    for version in (folder / "cache").iterdir():
        os.utime(version, (1, 1))
    assert run(folder, folder / "cache")[0] == [1] * COUNT
    assert len(list((folder / "cache").iterdir())) == 1
