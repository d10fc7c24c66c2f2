"""Processes beside that of a command, in a Python of their own: this one has computed with JAX."""

import subprocess
import sys

import pytest

from jaxdamp import _second_process


SCRIPT = """
import os, signal, sys, threading, time, weakref
from jaxdamp import _second_process as second

class Record:
    pass

def where(*of): return os.getpid(), of
def times(of): of.times = getattr(of, "times", 0) + 1; return of.times
def refused(): raise ValueError("no")
def ends(): os.getpid() == parent or os._exit(3); return os.getpid()

parent, record, other = os.getpid(), Record(), Record()
os.sched_getaffinity = lambda pid: {0, 1}
with second.opened(lambda: None):
    assert second.count() == 1
    waiting = second.elsewhere(where, record, shared=[record])
    assert second.elsewhere(where) is None, "one process computes one thing"
    pid, (same,) = waiting()
    assert pid != parent and same is record, "what both know comes back as it is"
    counts = [second.elsewhere(times, each, shared=[each])() for each in (record, other, record)]
    assert counts == [1, 1, 2], "each is sent once"
    assert second.anywhere(where)[0] == parent, "this process has nothing to do"
    try:
        second.elsewhere(refused)()
    except ValueError as error:
        assert str(error) == "no"
    else:
        raise AssertionError("an error is raised here")
    assert second.elsewhere(lambda: 1) is None, "what cannot be sent is not begun"
    begun, enough = threading.Event(), threading.Event()
    def busy():
        begun.set()
        enough.wait()
    thread = threading.Thread(target=second.anywhere, args=(busy,))
    thread.start()
    begun.wait()
    assert second.anywhere(where)[0] == pid, "this process computes"
    assert second.anywhere(lambda: os.getpid()) == parent, "what cannot be sent is computed here"
    assert second.anywhere(ends) == parent, "what a process that ended has left is computed here"
    assert second.anywhere(where)[0] == parent
    enough.set()
    thread.join()
with second.opened(lambda: None):
    second.elsewhere(time.sleep, 60.0)  # nobody waits for it
def deaf():
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    time.sleep(60.0)
with second.opened(lambda: None):
    second.elsewhere(deaf)
inside, outside = os.pipe()
class Forgotten: pass
def forgets():
    def last(reference):
        os.write(outside, b".")
        time.sleep(60.0)
    thing = Forgotten()
    reference = weakref.ref(thing, last)
    del thing
with second.opened(lambda: None):
    second.elsewhere(forgets)
    os.read(inside, 1)  # it ends inside the callback, and says nothing
import jax
jax.devices()
with second.opened(lambda: None):
    assert second.count() == 0, "the threads of JAX would be missing"
    assert second.elsewhere(where) is None and second.anywhere(where)[0] == parent
print("whole")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")
def test_work_is_done_beside_and_comes_back() -> None:
    """Results, errors, shared objects; what cannot be sent, and a process that ends."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=50)
    assert done.returncode == 0 and done.stdout == "whole\n" and not done.stderr, done.stderr


def test_without_processes_all_is_computed_here() -> None:
    """As in a notebook."""
    assert _second_process.count() == 0
    assert _second_process.elsewhere(sum, (1, 2)) is None
    assert _second_process.anywhere(sum, (1, 2)) == 3


ENDED_AT_ONCE = """
import os, time
from jaxdamp import _second_process as second
from jaxdamp.cli.interrupt import watched
fork = os.fork
def slowly():
    if not (pid := fork()):
        time.sleep(0.3)  # as on a busy machine
    return pid
os.fork, second.usable_cores = slowly, lambda: 2
with watched():
    with second.opened(lambda: None):
        assert second.count() == 1
    time.sleep(0.3)
print("whole")
"""


def test_a_command_that_ends_before_its_processes_have_begun_is_not_stopped_by_their_end() -> None:
    done = subprocess.run([sys.executable, "-c", ENDED_AT_ONCE], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "whole\n", "")
