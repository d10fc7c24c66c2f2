"""Commands that are ended by a signal at some moment, each in a process forked from one that has loaded everything.

    python -m tests.cli.sudden_ends SIGNAL SECONDS[,SECONDS...] -- COMMAND...

starts the command once for each moment, with `{number}` in its words replaced by the number of the moment, and prints a
line of JSON for each: number, exit code (as a shell has it), what was said. JAX has not started where it is forked.
"""

import json
import os
import signal
import sys
import tempfile
import time


LONGEST = 120.0  # s, after which a command counts as hanging


def main(words: list[str]) -> None:
    """Run the commands one after the other."""
    number, moments, *command = words[0], words[1].split(","), *words[3:]
    import jaxdamp.cli
    from jaxdamp.cli import application, fitting, riding, tuning  # what commands load

    del application, fitting, riding, tuning
    for count, moment in enumerate(moments):
        with tempfile.TemporaryFile() as said:
            child = os.fork()
            if not child:
                os.dup2(said.fileno(), 1)
                os.dup2(said.fileno(), 2)
                signal.signal(signal.SIGINT, signal.default_int_handler)
                sys.argv = ["jaxdamp", *(word.replace("{number}", str(count)) for word in command)]
                try:
                    jaxdamp.cli.main()
                except SystemExit as end:
                    code = end.code if isinstance(end.code, int) else 1
                    sys.stdout.flush()
                    os._exit(code)
                os._exit(0)
            time.sleep(float(moment))
            code = _ended(child, getattr(signal, number))
            said.seek(0)
            print(json.dumps({"number": count, "code": code, "said": said.read().decode()}), flush=True)


def _ended(child: int, number: int) -> int:
    """The exit code of a process that gets a signal; −1 if it hangs."""
    if os.waitpid(child, os.WNOHANG)[0]:  # ended before; there is nothing to end
        return 0
    os.kill(child, number)
    latest = time.monotonic() + LONGEST
    while time.monotonic() < latest:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            return 128 - code if code < 0 else code
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


if __name__ == "__main__":
    main(sys.argv[1:])
