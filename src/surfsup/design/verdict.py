"""What is said of a finished design: by the solver, and beside searches without gradients."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import accumulate

from surfsup.design.figure import draw_rivals
from surfsup.design.folder import write_whole
from surfsup.design.proof import Verdict, judged
from surfsup.design.record import processor_seconds
from surfsup.design.rivals import by_model, by_solver, evolution, first, for_work, random_search
from surfsup.design.run import DesignRun

Tell = Callable[[int, int], None]
SHORT = (0.05, 0.01, 0.001)  # of what the best gained over the start: how near to the best counts as reached


@dataclass(frozen=True)
class Proof:
    """The first and the best design, each in both simulators.

    Attributes:
        first, best: their rewards.
    """

    first: Verdict
    best: Verdict

    @property
    def holds(self) -> bool:
        """Whether the true solver, too, likes the best design more than the first."""
        if self.best.true is None:
            return False
        return self.first.true is None or self.best.true > self.first.true

    def text(self) -> str:
        """A few lines for a terminal."""

        def number(reward: float | None) -> str:
            return "undefined" if reward is None else f"{reward:.4f}"

        said = (
            "holds: the solver, too, prefers the best design"
            if self.holds
            else "FAILS: the best design fooled the learned simulator; the solver does not prefer it to the first"
        )
        return (
            f"solver        first {number(self.first.true)} (learned {number(self.first.learned)}), "
            f"best {number(self.best.true)} (learned {number(self.best.learned)})\nverdict       {said}"
        )


def prove(run: DesignRun, tell: Tell) -> Proof:
    """Run the first and the best design in SPlisHSPlasH; ``proof.json`` and both trajectories stay in the folder.

    Raises:
        InputError: the solver is not installed.
        SolverError: it stopped.
    """
    verdicts = []
    for done, (label, number) in enumerate((("first", 0), ("best", run.best)), start=1):
        verdicts.append(judged(run.task, run.designs[number], run.simulator, run.model, run.folder / label))
        tell(done, 2)
    proof = Proof(*verdicts)
    write_whole(run.folder / "proof.json", json.dumps({**asdict(proof), "holds": proof.holds}, indent=2) + "\n")
    return proof


def compare_rivals(run: DesignRun, with_solver: bool, tell: Tell) -> str:
    """CMA-ES and random search with as many simulations, those by which the run measured slopes among them, and CMA-ES
    on the solver with as much processor time: wall time tells nothing on a machine that others use too.

    ``rivals.json`` and ``rivals.png`` stay in the folder; returned is what came of it in a few lines.

    Raises:
        InputError: the `cma` package is not installed.
    """
    count, score = run.simulations, by_model(run.task, run.simulator)
    best_so_far = {"gradient": over_simulations(run)}
    seconds = {"gradient": run.work}
    methods = {
        "CMA-ES": lambda: first(evolution(run.task, score, run.seed), count),
        "random search": lambda: first(random_search(run.task, score, run.seed), count),
    }
    if with_solver:
        methods["CMA-ES on the solver"] = lambda: for_work(evolution(run.task, by_solver(run.task), run.seed), run.work)
    designs = {}
    for done, (name, search) in enumerate(methods.items(), start=1):
        began = processor_seconds()
        found = search()
        seconds[name] = processor_seconds() - began
        best_so_far[name] = list(accumulate((reward for _, reward in found), max))
        values, _ = max(found, key=lambda pair: pair[1])
        designs[name] = {key: value.tolist() for key, value in values.items()}
        tell(done, len(methods))
    learned = {name: curve for name, curve in best_so_far.items() if name != "CMA-ES on the solver"}
    top = max(curve[-1] for curve in learned.values())
    targets = {f"within {share:.1%} of the best": top - share * (top - run.rewards[0]) for share in SHORT}
    targets["CMA-ES's best"] = best_so_far["CMA-ES"][-1]
    reached = {
        what: {name: reached_after(curve, target) for name, curve in learned.items()}
        for what, target in targets.items()
    }
    report = {
        "best_so_far": best_so_far,
        "processor_seconds": seconds,
        "designs": designs,
        "simulations_to_reach": reached,
    }
    write_whole(run.folder / "rivals.json", json.dumps(report, indent=2) + "\n")
    draw_rivals(learned, f"{run.task.name}: by the learned simulator", run.folder / "rivals.png")
    lines = [
        f"{name:<22}{best_so_far[name][-1]:.6f}  {len(best_so_far[name])} simulations, {seconds[name]:.0f} processor s"
        for name in best_so_far
    ]
    lines += [
        f"{what:<28}after " + ", ".join(f"{name} {after or 'never'}" for name, after in each.items())
        for what, each in reached.items()
    ]
    return "\n".join(lines)


def over_simulations(run: DesignRun) -> list[float]:
    """The best reward of the run's designs after each of its simulations."""
    curve: list[float] = []
    for number, best in enumerate(accumulate(run.rewards, max)):
        last = number + 1 == len(run.rewards)
        until = run.simulations if last else run.found_after[number + 1] - 1
        curve += [best] * (until - len(curve))
    return curve


def reached_after(best_so_far: Sequence[float], reward: float) -> int | None:
    """The number of simulations after which a reward was reached, None where it never was."""
    return next((number for number, best in enumerate(best_so_far, start=1) if best >= reward), None)
