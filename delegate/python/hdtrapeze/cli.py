"""The command `hdtrapeze`."""

import os
import signal
import sys
import traceback

from . import errors
from .interrupts import Interrupts


def main(arguments: list[str] | None = None) -> int:
    """Runs the command and gives its exit code (see flags.EXIT_CODES)."""
    is_process = arguments is None
    arguments = sys.argv[1:] if is_process else arguments
    interrupts = Interrupts()
    try:
        return _run(arguments, interrupts)
    except errors.Interrupted as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt as interrupt:
        print("error: Interrupted.", file=sys.stderr)
        terminated = getattr(interrupt, "terminated", False)
        return errors.EXIT_TERMINATED if terminated else errors.EXIT_INTERRUPTED
    except errors.HdTrapezeError as error:
        print(f"error: {error}", file=sys.stderr)
        if isinstance(error, errors.UsageError):
            from .flags import see_help

            print(see_help(arguments), file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:  # the reader of stdout has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except Exception as error:  # nobody foresaw it: still one line, and the rest for who asks
        if {"--verbose", "-v"} & set(arguments):
            traceback.print_exc()
        lines = str(error).strip().splitlines()
        print(f"error: {': '.join([type(error).__name__, *lines[:1]])}", file=sys.stderr)
        return errors.EXIT_RENDER
    finally:
        interrupts.restore(ends=is_process)


def _keep_drivers_quiet() -> None:
    """Has Mesa's layer that sorts devices stay away where it would complain of a display's absence.

    Devices are sorted here anyway.
    """
    if not ({"XDG_RUNTIME_DIR", "MESA_VK_DEVICE_SELECT"} & set(os.environ)):
        os.environ.setdefault("NODEVICE_SELECT", "1")


def _run(arguments: list[str], interrupts: Interrupts) -> int:
    _keep_drivers_quiet()
    with interrupts.held():
        from . import native
        from .flags import make_parser
        from .log import set_up_command

        wants_version = "--version" in arguments
        parser = make_parser(native.version() if wants_version else "")
    args = parser.parse_args(arguments)
    if args.command == "devices":
        from .devices import print_devices

        print_devices()
        return errors.EXIT_OK
    set_up_command(args.quiet, args.verbose)
    # usd-core takes half a second to load: not for --help.
    with interrupts.held():
        if args.command == "dump":
            from .dump import dump as command
        else:
            from .record import record as command
    command(args)
    return errors.EXIT_OK
