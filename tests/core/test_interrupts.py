"""Interrupts from the keyboard: programs that are started meanwhile ignore them."""

import signal
import subprocess
import sys

from lerobot_bimanual.interrupts import interrupts_ignored

ASKS = [sys.executable, "-c", "import signal; print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)"]


def test_a_program_started_meanwhile_ignores_interrupts_and_one_started_later_does_not():
    before = signal.getsignal(signal.SIGINT)
    with interrupts_ignored():
        meanwhile = subprocess.check_output(ASKS, text=True)
    later = subprocess.check_output(ASKS, text=True)
    assert (meanwhile.strip(), later.strip()) == ("True", "False")
    assert signal.getsignal(signal.SIGINT) is before
