"""The journal: whole records only, whatever happens while it is written; one writer; other files are refused."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
import xarray as xr

import suboctave as so
from suboctave.store.journal import Journal, read_journal


def dataset(i):
    return xr.Dataset({"a": ("x", np.arange(300.0) + i)}, attrs={"number": i})


def check(records):
    """A beginning of the records that were written, each as it was written."""
    for i, record in enumerate(records):
        assert (record.kind, record.fields) == ("analysis", {"name": f"n{i}"})
        assert record.dataset.identical(dataset(i))


def test_what_is_appended_is_read(tmp_path):
    path = tmp_path / "a.journal"
    journal = Journal.create(path)
    journal.append("run", {"title": "é", "value": [1.0, None]})
    journal.extend([("part", {"name": "a"}, dataset(0)), ("analysis", {}, dataset(1))])
    assert [r.kind for r in read_journal(path)] == ["run", "part", "analysis"]  # while it is being written
    journal.close()
    with pytest.raises(so.InputError, match="exists"):
        Journal.create(path)
    again = Journal.reopen(path)
    again.append("end")
    first, part, analysis, end = again.records
    assert (first.fields, first.block) == ({"title": "é", "value": [1.0, None]}, b"")
    assert part.dataset.identical(dataset(0))
    assert analysis.dataset.identical(dataset(1))
    assert end.kind == "end"
    again.remove()
    assert not list(tmp_path.iterdir())


def test_two_runs_do_not_write_the_same_journal(tmp_path):
    first = Journal.create(tmp_path / "j.journal")
    with pytest.raises(so.InputError, match="another run"):
        Journal.reopen(tmp_path / "j.journal")
    first.append("still", {"it": "writes"})
    first.close()
    Journal.reopen(tmp_path / "j.journal").close()


def test_a_power_cut_at_any_instant_leaves_whole_records(tmp_path):
    """What the log ahead of the database holds is cut off at any place."""
    journal = Journal.create(tmp_path / "a.journal")
    for i in range(3):
        journal.append("analysis", {"name": f"n{i}"}, dataset(i))
    whole = (tmp_path / "a.journal-wal").read_bytes()
    counts = []
    for cut in (*range(0, len(whole), 517), len(whole)):
        folder = tmp_path / str(cut)
        folder.mkdir()
        shutil.copy(tmp_path / "a.journal", folder)
        (folder / "a.journal-wal").write_bytes(whole[:cut])
        records = read_journal(folder / "a.journal")
        check(records)
        counts.append(len(records))
        reopened = Journal.reopen(folder / "a.journal")
        for i in range(len(records), 3):
            reopened.append("analysis", {"name": f"n{i}"}, dataset(i))
        check(reopened.records)
        assert len(reopened.records) == 3
        reopened.close()
    assert counts == sorted(counts)
    assert set(counts) == {0, 1, 2, 3}
    journal.close()


@pytest.mark.parametrize("wait", [0.003, 0.1])
def test_a_kill_at_any_instant_leaves_whole_records(tmp_path, wait):
    path = tmp_path / "a.journal"
    code = f"""
        import itertools, numpy as np, xarray as xr
        from suboctave.store.journal import Journal
        journal = Journal.create({str(path)!r})
        print("begun", flush=True)
        for i in itertools.count():
            data = xr.Dataset({{"a": ("x", np.arange(300.0) + i)}}, attrs={{"number": i}})
            journal.append("analysis", {{"name": f"n{{i}}"}}, data)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE)
    process.stdout.readline()
    time.sleep(wait)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    count = len(read_journal(path))
    journal = Journal.reopen(path)
    journal.append("analysis", {"name": f"n{count}"}, dataset(count))
    check(journal.records)
    journal.close()
    assert len(read_journal(path)) == count + 1


def test_killed_before_anything_was_written(tmp_path):
    path = tmp_path / "a.journal"
    path.touch()
    assert read_journal(path) == []
    Journal.reopen(path).close()
    assert read_journal(path) == []


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"my diary", "no journal of suboctave"),
        (b"x" * 5000, "no journal of suboctave"),
        (b"suboctave journal 1\n" + bytes(500), "an earlier version of suboctave"),
    ],
)
def test_other_files_are_refused_and_left(tmp_path, content, words):
    path = tmp_path / "a.journal"
    path.write_bytes(content)
    for use in (read_journal, Journal.reopen):
        with pytest.raises(so.InputError, match=words):
            use(path)
    assert path.read_bytes() == content


def test_another_database_is_refused(tmp_path):
    import sqlite3
    from contextlib import closing

    with closing(sqlite3.connect(tmp_path / "a.db")) as other:
        other.execute("CREATE TABLE diary (day TEXT)")
    with pytest.raises(so.InputError, match="no journal of suboctave"):
        Journal.reopen(tmp_path / "a.db")
    with pytest.raises(so.InputError, match="no such file"):
        read_journal(tmp_path / "nowhere")
