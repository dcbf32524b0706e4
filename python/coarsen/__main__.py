"""``coarsen`` and ``python -m coarsen``: run the command line, turn every expected error into one line and status 2."""

from __future__ import annotations

import os
import sys

BAD_INPUT = 2
INTERRUPTED = 130


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    try:
        from .cli import app
    except KeyboardInterrupt:  # nothing is at hand yet to say it with
        sys.stderr.write("coarsen: interrupted; nothing was written\n")
        return INTERRUPTED
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in ("typer", "rich", "click", "shellingham"):
            raise
        sys.stderr.write("coarsen: the command line needs typer and rich: pip install 'coarsen-mesh[cli]'\n")
        return BAD_INPUT
    import typer

    from .console import complain

    try:
        status = typer.main.get_command(app).main(arguments, prog_name="coarsen", standalone_mode=False)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read our output has gone, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except (ValueError, OSError, ImportError, MemoryError) as error:
        complain(str(error) or type(error).__name__)
        return BAD_INPUT
    except Exception as error:
        if not hasattr(error, "format_message"):  # not one of the command line's own: a fault, to be seen whole
            raise
        text = error.format_message()
        complain(f"{text.rstrip('.')}; coarsen --help says more" if text else "no command; coarsen --help lists them")
        return BAD_INPUT
    if status == INTERRUPTED:  # some versions of typer return it, others raise
        complain("interrupted; nothing was written")
    return status if isinstance(status, int) else 0


if __name__ == "__main__":
    sys.exit(main())
