"""The old words of the project do not return: names, comments, messages and pages use the terms of docs/glossary.md.

    python tests/test_vocabulary.py [PATH ...]

lists every old word below the paths (default: the whole repository) as ``file:line: old word: what to use instead``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
CHECKED = (
    *("src", "tests", "benchmarks", "examples", "docs", "scripts", ".github"),
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "Makefile", "pyproject.toml", "mkdocs.yml"),
)
SUFFIXES = {"", ".cff", ".cpp", ".css", ".hpp", ".html", ".js", ".md", ".py", ".pyi", ".toml", ".txt", ".yaml", ".yml"}

# Single words, also as parts of snake_case and CamelCase names: what to use instead.
WORDS = {
    # The solver.
    "farther": "beyond, further; delta_position",
    "crowding": "capped neighbors",
    "guard(s|ed|ing)?": "collision handling, resolve_collisions, collided",
    "felt|feels?": "boundary volume map; interacts with",
    # Data sets, training, evaluation, design.
    "judg(es?|ed|ing|e?ments?)": "evaluate, validate, score",
    "usable": "load_trajectories, valid",
    "crews?": "worker pool",
    "patiently": "with_retry",
    "wanted": "target, requested",
    "carpentry|sculptures": "procedural",
    # Private dialect.
    "told|tells?": "given, shows, reports",
    "ask(s|ed|ing)?": "query, request, require",
    "whoever": "users, callers",
    "nobody": "name the subject",
    "reckon(s|ed|ing)?": "compute, account for",
    # Spelling is American.
    r"neighbour\w*": "neighbor",
    r"colou(r|rs|red|ring|rful|rmap)": "color",
    "(centi|milli|kilo|micro|nano)?metres?": "meter",
    "centre[sd]?|centring": "center",
    r"behaviour\w*": "behavior",
    r"(fav|hon|lab|vap|harb)our\w*": "-or",
    "grey(s|ish|scale)?": "gray",
    "litres?|fibres?|artefacts?|whilst|learnt|licence|programmes?": "American spelling",
    "(un|mis)?(labell|modell|travell|cancell|signall|levell)(ed|ing|er|ers)": "one l",
    "analys(e|ed|ing)": "analyze",
    r"\w*(optim|minim|maxim|normal|initial|polygon|real|recogn|organ|summar|general|visual|serial|discret|parametr"
    "|parameter|voxel|quant|penal|regular|synchron|factor|vector|parallel|random|local|stabil|categor|custom|final"
    "|util|rasteri?|token)is(e[sd]?|ers?|ing|ations?)": "-ize",
}

# Whole names and phrases.
PHRASES = {
    # A sweep is a set of simulations over varied values.
    r"(?i:(pressure|divergence|density) sweeps?|sweeps? (of|over) (the )?(pressures?|particles))": "iteration, pass",
    r"(?i:the (solver's )?(own )?rule)\b(?! of)|solver's own rule": "the DFSPH pressure solve, the solver",
    r"(?i:\b(the|a|an|one|two|four|same|each) looks?)\b|look_natively|look_again": "neighbor search, query",
    r"of_rise|OF_RISE": "divergence_relaxation",
    r"of_excess|OF_EXCESS": "density_relaxation",
    r"own_density": "self_density",
    r"too_dense|MOST_DENSE": "density_excess",
    r"slope_of_solids|of_solids": "boundary_gradient, boundary_density",
    r"solid[_ ]map": "boundary volume map",
    r"SOLVER_STEPS|STEP_TIME(?<!SUBSTEP_TIME)": "SUBSTEPS, SUBSTEP_TIME",
    r"native\.paths\b|_path\.[ch]pp": "native.instruction_sets(), isa",
    r"Surroundings": "Environment",
    r"state_after": "state_from_frames",
    r"kinds\.KINDS\b|learned\.kinds": "learned.registry.LEARNED_SIMULATORS",
    r"(?<!f )courses?\b(?!-)": "trajectory_statistics, curve",
    r"while_wanted|while_sound": "until_canceled, until_diverged",
    r"(class|import) (Made|Pace|Seen|Drawing)\b|\b(Made|Pace|Seen|Drawing)\(": (
        "GenerationRecord, ProgressEstimate, TrainingDomain, SceneSampler"
    ),
    r"seen_through": "a term of the field",
    r"(?i:in turn)\b": "one after the other",
    r"\b(is|are) to be\b": "say who does what",
    r"(?i:what is left)\b": "the rest, the remainder",
    r"(?i:\b(goes|go|going|gone|went) on)\b": "continue, resume",
}

# Places where an old word stays: file pattern, the text around it, and why.
ALLOWED = (
    ("CHANGELOG.md", r"`[^`]*`", "names of removed options"),
    ("tests/test_vocabulary.py", r".*", "this list"),
    ("src/surfsup/datasets/generation/worker_pool.py", r"[Cc]ancelled", "names of the Python library and of dask"),
    ("examples/learn_to_pour.py", r"search\.(ask|tell)", "the interface of the library cma"),
    ("src/surfsup/design/baselines.py", r"strategy\.(ask|tell)", "the interface of the library cma"),
    ("src/surfsup/sph/rigid/body.py", r"SIGGRAPH course", "the title of a publication"),
    ("src/surfsup/sdf/neural/siren.py", r"centre", "a key of files of version 0.1"),
    ("tests/sdf/neural/test_siren.py", r"centre", "a key of files of version 0.1"),
    ("*.[ch]pp", r"lock_guard", "the name of the C++ library"),
    ("*.[ch]pp", r"include guard", "the term for headers"),
)

SUBWORD = re.compile("[A-Z]?[a-z]+|[A-Z]+")
COMPILED_WORDS = [(re.compile(pattern, re.IGNORECASE), instead) for pattern, instead in WORDS.items()]
COMPILED_PHRASES = [(re.compile(pattern), instead) for pattern, instead in PHRASES.items()]


@cache
def replacement(subword: str) -> str | None:
    """What to use instead of a single word; None if the word is fine."""
    return next((instead for pattern, instead in COMPILED_WORDS if pattern.fullmatch(subword)), None)


def old_words(text: str) -> Iterator[tuple[int, int, str]]:
    """Start, end and replacement of every old word of a text."""
    for match in SUBWORD.finditer(text):
        if instead := replacement(match.group()):
            yield *match.span(), instead
    for pattern, instead in COMPILED_PHRASES:
        for match in pattern.finditer(text):
            yield *match.span(), instead


def old_words_of_file(file: Path) -> Iterator[str]:
    """One line for every old word of a file that is not allowed there."""
    name = file.resolve().relative_to(ROOT).as_posix()
    text = file.read_text(encoding="utf-8")
    patterns = [pattern for files, pattern, _ in ALLOWED if fnmatch(name, files)]
    allowed = [match.span() for pattern in patterns for match in re.finditer(pattern, text)]
    for start, end, instead in sorted(old_words(text)):
        if not any(low <= start and end <= high for low, high in allowed):
            yield f"{name}:{text.count(chr(10), 0, start) + 1}: {text[start:end]}: use {instead}"


def files_below(paths: Iterable[Path]) -> Iterator[Path]:
    """All text files at or below the paths."""
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file() and file.suffix in SUFFIXES and "__pycache__" not in file.parts:
                yield file


def test_old_words_do_not_return() -> None:
    found = [line for file in files_below(ROOT / name for name in CHECKED) for line in old_words_of_file(file)]
    assert not found, f"{len(found)} old words:\n" + "\n".join(found)


def test_a_word_is_found_inside_names_but_not_inside_longer_words() -> None:
    for text in ("no_guard", "guarded", "NativeGuard", "Neighbours", "a metre", "asked for", "optimise", "one look"):
        assert list(old_words(text)), text
    for text in ("safeguards", "tasks", "neighbors", "symmetrical", "of course", "precise", "parameters", "look_at"):
        assert not list(old_words(text)), text


if __name__ == "__main__":
    chosen = [Path(argument).resolve() for argument in sys.argv[1:]] or [ROOT / name for name in CHECKED]
    lines = [line for file in files_below(chosen) for line in old_words_of_file(file)]
    print("\n".join([*lines, f"{len(lines)} old words"]))
    sys.exit(bool(lines))
