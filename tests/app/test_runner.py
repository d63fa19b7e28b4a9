"""The worker: results, progress, errors and cancelling, without a browser."""

import asyncio
import threading

import pytest

from app.runner import CancelledError, Runner


def run(coroutine):
    return asyncio.run(coroutine)


def test_returns_what_the_work_returned_and_ran_beside_the_event_loop():
    runner = Runner()
    thread = run(runner.run(lambda _report: threading.current_thread()))
    runner.close()
    assert thread is not threading.main_thread()


def test_an_error_of_the_work_reaches_who_waits():
    runner = Runner()
    with pytest.raises(ZeroDivisionError):
        run(runner.run(lambda _report: 1 / 0))
    runner.close()


def test_progress_is_seen_in_the_event_loop():
    runner, seen, go_on = Runner(), [], threading.Event()

    def work(report):
        report("half", 0.5)
        assert go_on.wait(30)

    def watch(text, share):
        seen.append((text, share, threading.current_thread() is threading.main_thread()))
        go_on.set()

    run(runner.run(work, watch))
    runner.close()
    assert seen == [("half", 0.5, True)]


def test_cancel_frees_the_page_at_once_and_ends_the_work_at_its_next_report():
    runner, began, ended, go_on = Runner(), threading.Event(), threading.Event(), threading.Event()

    def stubborn(report):
        began.set()
        assert go_on.wait(30)
        try:
            report("still here", 0.9)
        except CancelledError:
            ended.set()
            raise

    async def scene():
        waiting = asyncio.create_task(runner.run(stubborn))
        while not began.is_set():
            await asyncio.sleep(0.01)
        runner.cancel()
        with pytest.raises(CancelledError):
            await waiting
        assert await runner.run(lambda _report: "next") == "next"  # though the stubborn one is still in its thread
        go_on.set()
        while not ended.is_set():
            await asyncio.sleep(0.01)

    run(scene())
    runner.close()
    assert ended.is_set()
