"""Interrupts from the keyboard: programs started in their absence do not see them."""

import signal
import subprocess
import sys
import threading

import pytest

from lerobot_bimanual.interrupts import interrupts_ignored

ASKS = [sys.executable, "-c", "import signal; print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)"]


def test_a_program_started_meanwhile_ignores_interrupts_and_one_started_later_does_not():
    with interrupts_ignored():
        meanwhile = subprocess.check_output(ASKS, text=True)
    later = subprocess.check_output(ASKS, text=True)

    assert (meanwhile.strip(), later.strip()) == ("True", "False")


def test_the_starter_answers_interrupts_again_whatever_happened():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(RuntimeError), interrupts_ignored():
        raise RuntimeError("it could not be started")

    assert signal.getsignal(signal.SIGINT) is before


def test_a_thread_that_may_not_decide_it_goes_on_all_the_same():
    happened = []

    def start() -> None:
        with interrupts_ignored():
            happened.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=start)
    thread.start()
    thread.join()

    assert happened == [signal.getsignal(signal.SIGINT)]
