"""How often the expert and the blind control solve a task on every rung: counts, and the seeds of the expert's failures."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_record import read
from lerobot_bimanual.ladder.result import LEAST_EXPERT_RATE, AxisRecord, rung_name
from lerobot_bimanual.output_file import write_file
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.results.statistics import SuccessRate

CERTIFICATE_SCHEMA_VERSION = 2
MOST_SEEDS = 10**9


@dataclass(frozen=True)
class CertifiedRung:
    """One rung of one task.

    Attributes:
        axis: its name; empty at level 0.
        level: 0 to 3.
        world: version of what the task's world does there.
        expert_failed: seeds that the expert did not solve.
        blind_solved: seeds that the blind control solved.
        planned_failed: of the expert's seeds those that an expert who planned at the reset, and never looked again, did not
            solve; None where nothing is moved later.

    Raises:
        ValueError: it is no rung.
    """

    axis: str
    level: int
    world: str
    expert_failed: tuple[int, ...]
    blind_solved: tuple[int, ...]
    planned_failed: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.level <= MAX_LEVEL or bool(self.axis) != bool(self.level):
            raise ValueError(
                f"level 0 is of no axis, levels 1 to {MAX_LEVEL} are of one; got {self.axis!r}, {self.level}"
            )

    @property
    def name(self) -> str:
        """As `--env.perturb` takes it; at level 0 in words."""
        return rung_name(self.axis, self.level)


@dataclass(frozen=True)
class RungCertificate:
    """All rungs of one task that change what happens, not only what is seen or said.

    Attributes:
        schema_version: version of this table of fields.
        task: name of the task.
        split: of the seeds.
        expert_seeds: the expert's first seed, and the one behind its last.
        blind_seeds: likewise of the blind control.
        versions: package -> version.
        axes: those of which there are rungs, by name.
        not_applicable: axes that find nothing to change in the task.
        rungs: level 0, then by axis and level.

    Raises:
        ValueError: a value is impossible or contradicts another.
    """

    schema_version: int
    task: str
    split: str
    expert_seeds: tuple[int, int]
    blind_seeds: tuple[int, int]
    versions: dict[str, str]
    axes: tuple[AxisRecord, ...]
    not_applicable: tuple[str, ...]
    rungs: tuple[CertifiedRung, ...]

    def __post_init__(self) -> None:
        for problem in self._problems():
            raise ValueError(problem)

    def _problems(self) -> Iterator[str]:
        if self.schema_version != CERTIFICATE_SCHEMA_VERSION:
            yield f"schema_version is {self.schema_version}, but must be {CERTIFICATE_SCHEMA_VERSION}"
        for name in ("expert_seeds", "blind_seeds"):
            start, stop = getattr(self, name)
            if not 0 <= start < stop <= MOST_SEEDS:
                yield f"{name} is {start}, {stop}, but must be a first seed and one behind it, up to {MOST_SEEDS}"
        names, keys = [axis.name for axis in self.axes], [(rung.axis, rung.level) for rung in self.rungs]
        if names != sorted(set(names)) or keys != sorted(set(keys)) or keys[:1] != [("", 0)]:
            yield "axes and rungs must be sorted, each once, and begin with level 0"
        if {axis for axis, _ in keys[1:]} != set(names):
            yield f"rungs must be of the axes {', '.join(names)}"
        for rung in self.rungs:
            for seeds, whole in (
                (rung.expert_failed, self.expert_seeds),
                (rung.blind_solved, self.blind_seeds),
                (rung.planned_failed or (), self.expert_seeds),
            ):
                if list(seeds) != sorted(set(seeds)) or not all(seed in range(*whole) for seed in seeds):
                    yield f"seeds of {rung.name} must rise and be among {whole[0]}:{whole[1]}"

    def rates(self, rung: CertifiedRung) -> dict[str, SuccessRate]:
        """Success of the expert, of the blind control, and where it was asked of who planned at the reset."""
        of_expert, of_blind = len(range(*self.expert_seeds)), len(range(*self.blind_seeds))
        rates = {
            "expert": SuccessRate(of_expert - len(rung.expert_failed), of_expert),
            "blind": SuccessRate(len(rung.blind_solved), of_blind),
        }
        if rung.planned_failed is not None:
            rates["planned_at_reset"] = SuccessRate(of_expert - len(rung.planned_failed), of_expert)
        return rates

    def is_certified(self, rung: CertifiedRung) -> bool:
        """Whether the expert solves enough there."""
        rate = self.rates(rung)["expert"]
        return rate.successes >= LEAST_EXPERT_RATE * rate.trials

    def find(self, axis: str, level: int) -> CertifiedRung | None:
        """A rung; None if it is not among those here."""
        return next((rung for rung in self.rungs if (rung.axis, rung.level) == (axis, level)), None)

    def write(self, path: Path) -> None:
        """Write a JSON file with one rung per line.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        content = asdict(self)
        parts = {}
        for name in ("axes", "rungs"):
            lines = ",\n  ".join(
                json.dumps(item, separators=(",", ":"), ensure_ascii=False) for item in content.pop(name)
            )
            parts[name] = f'"{name}": [\n  {lines}\n ]' if lines else f'"{name}": []'
        head = ",\n ".join(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in content.items())
        write_file(path, f"{{\n {head},\n {parts['axes']},\n {parts['rungs']}\n}}\n")

    @classmethod
    def read(cls, path: Path) -> Self:
        """The certificate in a file.

        Raises:
            BimanualError: the file cannot be read, or is no such certificate; the message names it.
        """
        return read(cls, path, "certificate")


def read_rung_certificates(folder: Path) -> dict[str, RungCertificate]:
    """The certificates in a folder, by task.

    Raises:
        BimanualError: there are none, one cannot be read, or two are of one task.
    """
    found: dict[str, RungCertificate] = {}
    for path in sorted(folder.glob("*.json")):
        certificate = RungCertificate.read(path)
        if certificate.task in found:
            raise BimanualError(
                f"{path} is another certificate of {certificate.task}; a folder holds one per task"
            )
        found[certificate.task] = certificate
    if not found:
        raise BimanualError(
            f"{folder} holds no certificates of rungs; `lerobot-bimanual expert evaluate-perturbed` writes them"
        )
    return found
