"""Under which names the failures of several files of results are summed up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lerobot_env_bimanual.audit.result_files import Result


def result_names(results: Sequence[Result]) -> dict[Path, str]:
    """What each file's episodes are summed up under.

    Its task, and where a task has several: policy, variation, rung, and file of records. Rows that agree in all of these,
    such as several trainings, share a name.

    Args:
        results: of any tasks and policies.
    """
    names = {}
    for result in results:
        peers = [other for other in results if other.record.task == result.record.task]
        words = [result.record.task]
        for part in (_policy, _variation, _rung):
            if len({part(peer) for peer in peers}) > 1:
                words.append(part(result))
        alike = [peer for peer in peers if not peer.row and _rung(peer) == _rung(result)]
        if not result.row and len(alike) > 1:
            words.append(result.path.stem)
        names[result.path] = " ".join(words)
    return names


def _policy(result: Result) -> str:
    """Whose episodes they are; a record does not say it."""
    return result.row.config.policy_id if result.row else "record"


def _variation(result: Result) -> str:
    return f"variation {result.record.options.get('variation', 'any')}"


def _rung(result: Result) -> str:
    return result.record.perturb or "level 0"
