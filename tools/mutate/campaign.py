"""Running the tests on mutants, several workspaces at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tools.mutate.covering import Covering
from tools.mutate.edits import Mutant
from tools.mutate.results import EQUIVALENT, INVALID, KILLED, SURVIVED, TIMEOUT, Result
from tools.mutate.table import Table
from tools.mutate.workspace import NOTHING_COLLECTED, Outcome, Workspace

BASELINE_LIMIT = 1800.0
"""Seconds that a test file without a mutation may take."""
COMPILE_LIMIT = 300.0
"""Seconds that compiling a mutated kernel in all its variants may add."""


class Campaign:
    """Mutants and their tests.

    Args:
        root: of the source tree.
        table: what is mutated and how it is tested.
        budget: s that the tests of one mutant may take without the mutation, the first file aside.
        note: called with a line of text about what goes on.
    """

    def __init__(self, root: Path, table: Table, budget: float, note: Callable[[str], None]) -> None:
        self.root, self.table, self.budget, self.note = root, table, budget, note
        self.graph = Covering(root)
        self.seconds: dict[str, float | None] = {}
        """Test file -> seconds without a mutation; None: it fails, so it tells nothing."""
        self._measuring = threading.Lock()

    def run(self, mutants: Iterator[Mutant], count: int, jobs: int, report: Callable[[Result], None]) -> None:
        """Test `count` mutants, those that do not compile aside; report each as it is done."""
        lock, left = threading.Lock(), [count]
        workspaces: list[Workspace] = []

        def work() -> None:
            workspace = Workspace(self.root)
            workspaces.append(workspace)
            try:
                while True:
                    with lock:
                        mutant = next(mutants, None) if left[0] > 0 else None
                        left[0] -= 1
                    if mutant is None:
                        return
                    result = self.tested(workspace, mutant)
                    with lock:
                        if left[0] < -jobs:
                            return  # stopped: what the tests said counts for nothing
                        if result.status == INVALID:
                            left[0] += 1
                        report(result)
            finally:
                workspace.close()

        with ThreadPoolExecutor(jobs) as pool:
            try:
                for done in [pool.submit(work) for _ in range(jobs)]:
                    done.result()
            except BaseException:
                left[0] = -count - 2 * jobs
                for workspace in workspaces:
                    workspace.stop()
                raise

    def tested(self, workspace: Workspace, mutant: Mutant) -> Result:
        """Return what the tests that cover a mutant say of it."""
        proof = self.table.proof(mutant)
        if proof:
            return Result(mutant, EQUIVALENT, proof)
        tests, whole = self._chosen(workspace, mutant.path)
        if not tests:
            return Result(mutant, SURVIVED, "no test covers the file")
        source = (self.root / mutant.path).read_bytes()
        is_kernel = not mutant.path.endswith(".py")
        workspace.write(mutant.path, mutant.edit.applied(source))
        try:
            outcome = workspace.pytest(tests, 4.0 * whole + 60.0 + COMPILE_LIMIT * is_kernel)
        finally:
            workspace.write(mutant.path, source)
        return Result(
            mutant, _status(outcome, is_kernel=is_kernel), outcome.failed, tuple(tests), round(outcome.seconds, 1)
        )

    def _chosen(self, workspace: Workspace, path: str) -> tuple[list[str], float]:
        """Return the test files to run, the fastest first, and the seconds they take unmutated."""
        taken: list[tuple[float, str]] = []
        for test in self.table.covering(path, self.graph):
            seconds = self._baseline(workspace, test)
            if seconds is None:
                continue
            if not taken or sum(s for s, _ in taken) + seconds <= self.budget:
                taken.append((seconds, test))
        return [test for _, test in sorted(taken)], sum(s for s, _ in taken)

    def _baseline(self, workspace: Workspace, test: str) -> float | None:
        with self._measuring:
            if test not in self.seconds:
                self.note(f"{test} without a mutation")
                outcome = workspace.pytest([test], BASELINE_LIMIT)
                if outcome.code in (0, NOTHING_COLLECTED):
                    self.seconds[test] = outcome.seconds if outcome.code == 0 else None
                else:
                    self.note(f"left out, since it fails without a mutation: {outcome.failed}")
                    self.seconds[test] = None
            return self.seconds[test]


def _status(outcome: Outcome, *, is_kernel: bool) -> str:
    if outcome.code is None:
        return TIMEOUT
    if outcome.code == 0:
        return SURVIVED
    if is_kernel and "KernelBuildError" in outcome.output:
        return INVALID
    return KILLED
