"""Runs the main function of a command: an error becomes one line and an exit status, even if the output is closed.

Exit status: 0 done, 1 failed (the line on stderr says why), 2 wrong arguments (argparse), 130 Ctrl-C, 141 the reader of
the output is closed (as shells report a program that ends by a closed pipe). Knows neither ROS nor robots.
"""

import argparse
import errno
import io
import os
import signal
import sys
from contextlib import suppress
from importlib import import_module
from typing import IO, Callable, Mapping, NoReturn, Optional, Sequence, Tuple, Type

from .errors import HeroError
from .texts import make_printable

FAILED = 1
INTERRUPTED = 128 + signal.SIGINT
PIPE_CLOSED = 128 + signal.SIGPIPE
WRONG_ARGUMENTS = 2
"""As argparse ends."""

OUTPUT_ERRORS = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def run(main: Callable[[], Optional[int]], *errors: Type[Exception]) -> NoReturn:
    """Call main and end the process with its exit status (None: 0); a HeroError, or one of errors, prints a line: 1."""
    sys.exit(call(main, *errors))


def call(main: Callable[[], Optional[int]], *errors: Type[Exception]) -> int:
    """As run(), but return the exit status. The output is written by then, or given up."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of files need not be text of the terminal's encoding.
        sys.stdout.reconfigure(errors="backslashreplace")
    expected: Tuple[Type[Exception], ...] = (HeroError, *errors)
    status = 0
    try:
        status = main() or 0
    except expected as error:
        print_error(str(error) + find_line(error))
        status = FAILED
    except KeyboardInterrupt:
        status = INTERRUPTED
    except SystemExit as end:  # argparse: wrong arguments, or --help
        status = end.code if isinstance(end.code, int) else FAILED if end.code else 0
        if isinstance(end.code, str):
            print_error(end.code)
    except OSError as error:
        if error.filename is not None or error.errno not in OUTPUT_ERRORS:
            print_error("%s%s" % ("%s: " % error.filename if error.filename else "", error.strerror or error))
            return FAILED
        _discard(sys.stdout)
        return _report(error)
    for stream in (sys.stderr, sys.stdout):
        try:
            if stream is not None:
                stream.flush()
        except OSError as error:
            _discard(stream)
            lost = _report(error)
            status = status or lost
    return status


def run_named(package: str, programs: Mapping[str, str]) -> NoReturn:
    """Run the program that the first argument names: python3 -m PACKAGE NAME ...; programs: their modules by name."""
    command = "python3 -m " + package
    if len(sys.argv) < 2 or sys.argv[1] not in programs:
        sys.exit(f"{command}: the first argument must be one of: {', '.join(programs)}")
    name = sys.argv.pop(1)
    try:
        program = import_module(f"{package}.{programs[name]}")
    except ModuleNotFoundError as error:
        sys.exit(f"{command} {name}: {error.name} is missing; install python3-{error.name}")
    run(program.main)


def check_node_arguments(package: str, name: str, text: Optional[str], arguments: Sequence[str] = ()) -> None:
    """End the process for --help, which prints text, and for arguments other than these and remappings (_x:=1)."""
    usage = " ".join(arguments) or "[_PARAMETER:=VALUE ...] [TOPIC:=TOPIC ...]"
    parser = argparse.ArgumentParser(
        prog=name,
        usage=f"rosrun {package} {name} {usage}",
        description=text,
        epilog="" if arguments else f"Parameters and topics: {package}/README.md",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for argument in arguments:
        parser.add_argument(argument, help=argparse.SUPPRESS)
    parser.parse_args([word for word in sys.argv[1:] if ":=" not in word])


def say(text: str, stream: Optional[IO[str]] = None, end: str = "\n") -> None:
    """Write a line at once, to stdout unless stream is given; the program goes on even if its output is closed."""
    stream = stream or sys.stdout
    if stream is None:  # the program was started without
        return
    try:
        # In one piece: threads write side by side.
        stream.write(text + end)
        stream.flush()
    except OSError as error:
        _discard(stream)
        _report(error)


def find_line(error: BaseException, script: Optional[str] = None) -> str:
    """Return where in the user's script an error was raised, for the end of a message; nothing for other programs."""
    from traceback import walk_tb  # a tenth of the start of small programs

    main = sys.modules["__main__"]
    if script is None and main.__spec__ is None:  # not python3 -m
        script = getattr(main, "__file__", None)
    lines = [line for frame, line in walk_tb(error.__traceback__) if frame.f_code.co_filename == script]
    return " (%s, line %d)" % (os.path.basename(script), lines[-1]) if script and lines else ""


def print_error(text: str) -> None:
    """Write a line with the program's name to stderr."""
    folder, name = os.path.split(sys.argv[0])
    program = os.path.basename(folder) if name == "__main__.py" else name  # python3 -m PACKAGE
    with suppress(OSError):
        print(f"{program}: {make_printable(text)}", file=sys.stderr, flush=True)


def _report(failure: OSError) -> int:
    """Print why the output is lost, unless it is a pipe whose reader has ended; return the exit status."""
    if isinstance(failure, BrokenPipeError):
        return PIPE_CLOSED
    print_error(f"the output cannot be written: {failure.strerror}")
    return FAILED


def _discard(stream: IO[str]) -> None:
    """Redirect a stream to /dev/null: what it buffers would fail again, at exit with a traceback."""
    null_fd = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null_fd, stream.fileno())
    os.close(null_fd)
