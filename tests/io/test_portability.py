"""Calls that macOS or Windows lack are guarded, and the package works without them."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from house import HOME, modules, tree

from cfddem.io import files

FILES = [*modules().values()]

POSIX_ONLY = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "posix", "syslog"}
"""Modules that Windows lacks."""

LACKING = {
    "sysconf",
    "getuid",
    "geteuid",
    "fork",
    "sched_getaffinity",
    "getloadavg",
    "uname",
    "mkfifo",
    "killpg",
    "nice",
}
"""Functions of `os` that Windows, or macOS, lacks."""

SIGNALS = {"SIGKILL", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGPIPE", "SIGSTOP", "SIGCONT"}


def unguarded(node: ast.AST, guarded: bool = False) -> Iterator[ast.AST]:
    """Nodes outside of `try` and of conditions, with those of functions."""
    for child in ast.iter_child_nodes(node):
        inner = guarded or isinstance(node, ast.Try | ast.If | ast.IfExp | ast.BoolOp)
        if not inner:
            yield child
        yield from unguarded(child, inner)


def names(node: ast.AST) -> Iterator[str]:
    """What a node needs of the system."""
    if isinstance(node, ast.Import):
        yield from (each.name for each in node.names if each.name in POSIX_ONLY)
    elif isinstance(node, ast.ImportFrom) and node.module in POSIX_ONLY:
        yield str(node.module)
    elif isinstance(node, ast.Attribute) and node.attr in {"os": LACKING, "signal": SIGNALS}.get(owner(node), ()):
        yield f"{owner(node)}.{node.attr}"


def owner(node: ast.Attribute) -> str:
    """Name of the module whose attribute a node takes; empty if it is none."""
    return node.value.id if isinstance(node.value, ast.Name) else ""


def test_calls_that_other_systems_lack_are_guarded() -> None:
    found = [
        f"{path.relative_to(HOME)}: {name}" for path in FILES for node in unguarded(tree(path)) for name in names(node)
    ]
    assert not found, "\n".join(found)


def test_the_check_finds_an_unguarded_call() -> None:
    text = (
        "import fcntl\ntry:\n    import pwd\nexcept ImportError:\n    pwd = 0\nos.getuid() if x else 0\nos.sysconf(1)"
    )
    assert [name for node in unguarded(ast.parse(text)) for name in names(node)] == ["fcntl", "os.sysconf"]


def test_texts_are_read_and_written_as_utf_8() -> None:
    """The default encoding of Windows is another one."""
    found = []
    for path in FILES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                given = {each.arg for each in node.keywords}
                if node.func.attr in ("read_text", "write_text") and "encoding" not in given:
                    found.append(f"{path.relative_to(HOME)}:{node.lineno}")
    assert not found, "\n".join(found)


def test_the_package_works_where_there_are_no_posix_modules(tmp_path: Path) -> None:
    """Without them, commands that do not compile work as usual, and a folder can be locked."""
    program = (
        "import sys\n"
        "sys.modules.update(dict.fromkeys(['fcntl', 'resource', 'pwd']))\n"
        "from cfddem.io.folder import lock\nfrom pathlib import Path\nlock(Path('.')).close()\n"
        "import cfddem.backend.compile, cfddem.run.runner\n"
        "sys.argv = ['cfddem', 'check', 'liquid-bed']\n"
        "from cfddem.cli.app import main\nmain()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "ok: no errors" in done.stdout, done.stderr


@pytest.mark.parametrize(("failure", "free"), [(None, True), (PermissionError(13, "locked"), False)])
def test_a_lock_of_windows(
    failure: OSError | None, free: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Windows:
        LK_NBLCK = 2

        @staticmethod
        def locking(number: int, mode: int, count: int) -> None:
            if failure is not None:
                raise failure

    monkeypatch.setattr(files, "fcntl", None)
    monkeypatch.setattr(files, "msvcrt", Windows)
    with (tmp_path / "lock").open("w", encoding="utf-8") as file:
        assert files.lock_file(file) is free
