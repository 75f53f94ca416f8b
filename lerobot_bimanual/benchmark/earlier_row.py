"""The row that lies where a benchmark would write its own: of the same measurement, or not to be lost."""

from collections.abc import Iterator

from lerobot_bimanual.benchmark.flag_text import command_flags
from lerobot_bimanual.benchmark.pipeline import begun
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.results import PLACES, BadResult, ResultRow
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown

ADVICE = "choose another --output, or move the file"
TEST_PLACES = ("policy.path", "env.results_dir", "env.video_dir", "output_dir")
"""Flags of a test that only say where things lie."""


def read_earlier(plan: Plan, rival: ResultRow | None, first_test: range) -> ResultRow | None:
    """The row that is there already; None if there is none.

    Its name holds what was trained, and not all of how it was tested.

    Args:
        plan: of the benchmark that begins.
        rival: whom its test goes against until it is sure.
        first_test: seeds of the test's first evaluation.

    Raises:
        BimanualError: the row is of another measurement than is asked for, or cannot be read; the message names what
            differs.
    """
    if not plan.result.exists():
        return None
    try:
        row = ResultRow.read(plan.result)
    except BadResult as error:
        raise BadResult(f"{error}; {ADVICE}") from error
    for name, got, asked in _facts(plan, row, rival, first_test):
        if got != asked:
            raise BimanualError(
                f"{plan.result} would be replaced: its {name} is {shown(got)}, but {shown(asked)} is asked for; {ADVICE}"
            )
    return row


def _facts(
    plan: Plan, row: ResultRow, rival: ResultRow | None, first_test: range
) -> Iterator[tuple[str, object, object]]:
    """Name of something that decides what is measured, what it was, and what it would be."""
    against = None if rival is None else rival.checkpoint_sha256
    yield "policy that the test was stopped against (--stop_when_sure)", row.stopped_against, against
    played, asked = [episode.seed for episode in row.episodes], list(plan.seeds("test"))
    if rival is not None:
        asked = asked[: len(played)]  # it may have been sure before the last
    yield "list of tested seeds (--first_seed, --test_episodes)", played, asked
    validated = len(row.validation[0].episodes) if row.validation else 0
    yield "number of validation episodes (--val_episodes)", validated, plan.protocol.val_episodes
    yield from _flags("training", row.flags, plan.training_flags(), PLACES)
    test = plan.evaluation("test", row.checkpoint_step, None if rival is None else first_test)
    if before := begun(plan.run_folder, test):  # else the row comes from elsewhere
        yield from _flags("test", command_flags(before), command_flags(str(test)), TEST_PLACES)


def _flags(
    of: str, before: dict[str, str], now: dict[str, str], places: tuple[str, ...]
) -> Iterator[tuple[str, object, object]]:
    for name in sorted((before.keys() | now.keys()) - set(places)):
        yield f"flag --{name} of the {of}", before.get(name), now.get(name)
