"""Terminations that are swallowed, and parents that are gone."""

import os
import signal
import subprocess
import sys
import time

import pytest

from lerobot_bimanual.interrupts import end_when_parent_ends, unwound_by_termination


class Finalized:
    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0)  # so that the signal is answered here


def is_swallowed() -> None:
    Finalized()
    time.sleep(20)


def becomes_another_error() -> None:
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(20)
    except SystemExit as end:
        raise TypeError("incompatible function arguments") from end


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.timeout(30, method="thread")  # the alarm is in use
@pytest.mark.parametrize("termination", [is_swallowed, becomes_another_error])
def test_a_termination_is_answered_also_where_it(termination):
    with pytest.raises(SystemExit) as exit_, unwound_by_termination():
        termination()
    assert exit_.value.code == 128 + signal.SIGTERM


def test_a_process_whose_parent_is_gone_before_it_could_ask_ends_itself():
    code = f"import os, signal; from {end_when_parent_ends.__module__} import end_when_parent_ends as end; end(signal.SIGTERM, {os.getpid() + 1})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGTERM
