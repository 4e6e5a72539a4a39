"""The flag that ends the driver may be set by a signal handler, at any moment."""

import os
import signal
import threading

from hero_driver.node import EndFlag

DEADLINE_S = 20.0


def test_a_signal_in_the_middle_of_a_wait_ends_it_and_never_hangs():
    before = signal.getsignal(signal.SIGUSR2)
    try:
        for _ in range(200):
            flag = EndFlag()
            signal.signal(signal.SIGUSR2, lambda *_, flag=flag: flag.set())
            sender = threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGUSR2))
            sender.start()
            assert flag.wait(DEADLINE_S)
            sender.join()
            assert flag.wait(0.0)
    finally:
        signal.signal(signal.SIGUSR2, before)


def test_a_flag_that_nobody_sets_lets_the_waiting_go_on():
    assert not EndFlag().wait(0.001)
