"""Station's side of the pages, without a browser: jobs, the worker, shipped recipes."""

import asyncio
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from hmi.jobs.queue import MOST_WAITING, Job, JobError, Jobs
from hmi.past.recipes import PastRecipes, RecipeList
from hmi.past.worker import PastWorker
from station.channel.worker import MOST_WAITING as MOST_QUESTIONS
from station.channel.worker import PanelBusyError, PanelWorker
from station.settings.recipe import load_recipes

PATIENCE_S = 60.0
WRITE = "import sys, pathlib; pathlib.Path(sys.argv[1], 'inspections.csv').write_bytes(b'x' * 5_000_000)"
FAIL = "import sys; sys.exit('the disk is full')"
WAIT = "import sys, time, pathlib; pathlib.Path(sys.argv[1], 'begun').touch(); time.sleep(600)"


async def until(jobs: Jobs, job: str, wanted: Callable[[Job], Any]) -> Job:
    deadline_s = time.monotonic() + PATIENCE_S
    while not wanted(known := jobs.get(job)):
        assert time.monotonic() < deadline_s, known
        await asyncio.sleep(0.02)
    return known


def with_jobs(home: Path, code: str, work: Callable[[Jobs], Any]) -> None:
    async def run() -> None:
        jobs = Jobs(home, "station-1", (sys.executable, "-c", code))
        try:
            await work(jobs)
        finally:
            await jobs.close()

    asyncio.run(run())


def test_a_jobs_file_is_named_with_its_place_and_no_other_is(tmp_path: Path) -> None:
    async def work(jobs: Jobs) -> None:
        folder = jobs.folder()
        job = jobs.begin("export", folder, [str(folder)]).id
        known = await until(jobs, job, lambda known: known.state == "done")
        assert [(file.path.name, file.size_bytes) for file in known.files] == [("inspections.csv", 5_000_000)]
        (folder / "secret").write_text("x")
        assert [file.path for file in known.files] == [folder / "inspections.csv"]

    with_jobs(tmp_path, WRITE, work)


def test_a_job_that_fails_tells_its_last_words_and_leaves_nothing(tmp_path: Path) -> None:
    async def work(jobs: Jobs) -> None:
        folder = jobs.folder()
        known = await until(jobs, jobs.begin("export", folder, [str(folder)]).id, lambda known: known.state == "failed")
        assert str(known.message) == "the disk is full"
        assert known.files == ()
        assert not folder.exists()

    with_jobs(tmp_path, FAIL, work)


def test_a_job_called_off_ends_its_process_and_too_many_are_refused(tmp_path: Path) -> None:
    before = set(psutil.Process().children())

    async def work(jobs: Jobs) -> None:
        folders = []
        started = []
        for _ in range(MOST_WAITING):
            folders.append(jobs.folder())
            started.append(jobs.begin("export", folders[-1], [str(folders[-1])]).id)
        with pytest.raises(JobError):
            jobs.folder()
        await until(jobs, started[0], lambda _: (folders[0] / "begun").exists())
        assert set(psutil.Process().children()) - before
        for job in started:
            await jobs.end(job)
            assert jobs.get(job).state == "ended"
        assert not set(psutil.Process().children()) - before
        assert not any(folder.exists() for folder in folders)
        jobs.folder()

    with_jobs(tmp_path, WAIT, work)


def test_folders_of_the_start_before_are_removed_and_none_of_this_one(tmp_path: Path) -> None:
    before = Jobs(tmp_path, "station-1").folder()
    jobs = Jobs(tmp_path, "station-1")
    assert before.exists(), "of pages that have the port, perhaps"
    folders = [jobs.folder(), jobs.folder()]
    assert [folder.exists() for folder in (before, *folders)] == [False, True, True]


def test_the_worker_refuses_more_than_it_can_hold() -> None:
    async def run() -> None:
        worker, going = PanelWorker(), threading.Event()
        try:
            tasks = [asyncio.create_task(worker.do(lambda: going.wait(PATIENCE_S))) for _ in range(MOST_QUESTIONS)]
            await asyncio.sleep(0)
            with pytest.raises(PanelBusyError):
                await worker.do(lambda: None)
            going.set()
            assert await asyncio.gather(*tasks) == [True] * MOST_QUESTIONS
            assert await worker.do(lambda: 7) == 7
        finally:
            going.set()
            worker.close()

    asyncio.run(run())


def test_recipes_shipped_are_not_edited_and_it_is_said_where_they_lie(tmp_path: Path) -> None:
    async def read(folder: Path | None) -> RecipeList:
        worker = PastWorker()
        try:
            return await PastRecipes(tmp_path, folder, worker).read()
        finally:
            worker.close()

    shipped = asyncio.run(read(None))
    assert not shipped.editable
    assert set(load_recipes(shipped.folder)) == {state.name for state in shipped.states} == set(load_recipes())
    own = tmp_path / "recipes"
    assert shipped.own_folder == own
    own.mkdir()
    assert asyncio.run(read(own)).editable
